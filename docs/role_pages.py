"""Writes `docs/roles/*.md` from the code: what each role must do, what an entry declares, what is checked.

    python docs/role_pages.py

A test compares the pages with what this gives.
"""

from __future__ import annotations

import ast
import inspect
import re
import sys
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from string import Template
from typing import Any

import attrs

from graspsense.core import entries, hookspecs, roles, signals, strict
from graspsense.core.entries import TABLE_OF_ROLE
from graspsense.core.features import Features, FeatureTable, Prediction
from graspsense.core.trace import Trace
from graspsense.core.trial import GraspEvent, RunInfo, Trial
from graspsense.scaffold.make import KINDS
from graspsense.testing import CHECKS, FLOOR

FOLDER = Path(__file__).parent / "roles"
TITLES = {
    "sensor-backend": "A gripper",
    "controller": "A controller",
    "feature-set": "A feature set",
    "classifier": "A classifier",
    "distribution": "A distribution",
}
BASES = {
    "sensor-backend": roles.SensorBackend,
    "controller": roles.Controller,
    "feature-set": roles.FeatureSet,
    "classifier": roles.Classifier,
}
HOOKS = {
    "sensor-backend": "graspsense_sensor_backends",
    "controller": "graspsense_controllers",
    "feature-set": "graspsense_feature_sets",
    "classifier": "graspsense_classifiers",
}
WORDS = {
    "name": "lab-thing",
    "part": "lab-thing",
    "package": "lab_thing",
    "api": "(1, 0)",
    "term": "lab_thing",
}
FLOWING: tuple[Any, ...] = (
    *(signals.Frame, signals.Pads, signals.Command, roles.Reading, roles.DeviceInfo),
    *(Trace, Features, FeatureTable, Prediction, RunInfo, GraspEvent, Trial),
)
HEAD = "<!-- Written by docs/role_pages.py from the code: change that. -->\n"


def page(role: str) -> str:
    """Return the page of a role."""
    lines = [HEAD + f"# {TITLES[role]}", ""]
    if role != "distribution":
        base: Any = BASES[role]
        table = TABLE_OF_ROLE[role]  # type: ignore[index]
        lines += [
            f"Role `{role}`, chosen in the table `[{table}]` of a pipeline file. `graspsense plugins "
            f"new NAME --role {role}` "
            "makes a package to start from, which is the example below; `graspsense plugins check "
            "NAME` tells whether it "
            f"conforms. How a package is made by hand: [the tutorial](../tutorial.md). "
            "What the values hold: [what flows](signals.md). The hook: "
            f"[{HOOKS[role]}](../hooks.md#{_anchor(role)}).",
            "",
            "## What it must do",
            "",
            f"`graspsense.plugin_api.{base.__name__}`: {_text(base)}",
            "",
            *_methods(base),
            *(_many() if role == "sensor-backend" else ()),
            "## What its entry declares",
            "",
            *_entry(getattr(entries, f"{base.__name__}Entry")),
            "## A whole one",
            "",
            *_example(role),
        ]
    else:
        lines += [
            "What `graspsense plugins check DISTRIBUTION` looks at before the components it brings. "
            "An editable installation is "
            "built as a wheel, to see that nothing stays behind.",
            "",
        ]
    lines += [
        "## What is checked",
        "",
        f"{len(CHECKS[role])} checks; {FLOOR[role]} of them must run. One that does not apply is "
        "skipped, with its reason.",
        "",
        "| check | demands |",
        "|---|---|",
        *(f"| `{one.id}` | {_cell(one.title)} |" for one in CHECKS[role]),
        "",
    ]
    return "\n".join(lines)


def signals_page() -> str:
    """Return the page of the values that pass between the parts."""
    lines = [HEAD + "# What flows", "", _text(signals), ""]
    for cls in FLOWING:
        names = getattr(cls, "_fields", None) or tuple(one.name for one in attrs.fields(cls))
        lines += [f"## {cls.__name__}", "", f"    {cls.__name__}({', '.join(names)})", "", _text(cls), ""]
    lines += ["## Channels", "", "| channel | unit |", "|---|---|"]
    lines += [f"| `{name}` | {unit} |" for name, unit in signals.CHANNELS.items()]
    return "\n".join([*lines, ""])


def hooks_page() -> str:
    """Return the page of every hook and of what it gives."""
    lines = [HEAD + "# Hooks and what they give", ""]
    lines += [
        "Every hook with its signature, as the code has it, and the fields of what it gives. "
        "[Hooks](../hooks.md) has the rules, and an example of each.",
        "",
    ]
    specs = {name: spec for name, spec in vars(hookspecs).items() if name.startswith("graspsense_")}
    for name, spec in specs.items():
        signature = f"{name}{inspect.signature(spec)}".replace("'", "")
        lines += [
            f"## {name}",
            "",
            f"    {signature}",
            "",
            f"{_text(spec)} [Example]({_section(signature)}).",
            "",
        ]
        given = re.search(r"Iterable\[(\w+)\]", signature)
        if given:
            lines += _entry(getattr(entries, given[1]))
    return "\n".join(lines)


def _section(signature: str) -> str:
    """Return the link to the section of hooks.md with this signature as its heading."""
    kept = re.sub(r"[^\w\s-]", "", signature.lower()).strip()
    return "../hooks.md#" + re.sub(r"[-\s]+", "-", kept)


def _anchor(role: str) -> str:
    """Return the anchor that the heading of this role's hook has in hooks.md."""
    spec = getattr(hookspecs, HOOKS[role])
    return _section(f"{HOOKS[role]}{inspect.signature(spec)}".replace("'", "")).partition("#")[2]


def _methods(base: Any) -> list[str]:
    lines = []
    for name, method in vars(base).items():
        function = method.__func__ if isinstance(method, staticmethod) else method
        if name.startswith("_") or not callable(function):
            continue
        signature = (
            re.sub(r"'([^']*)'", r"\1", str(inspect.signature(function)))
            .replace("self, ", "")
            .replace("(self)", "()")
        )
        must = "" if getattr(method, "__isabstractmethod__", False) else " (may be left out)"
        lines += [f"### {name}{must}", "", f"    {name}{signature}", "", _text(function), ""]
    return lines


def _many() -> list[str]:
    """Return what a backend offers that can do many grasps at once, with the text below each of its options."""
    body = ast.parse(inspect.getsource(roles.BatchOptions)).body[0].body  # type: ignore[attr-defined]
    options = [
        f"- `{one.target.id}: {ast.unparse(one.annotation)}`: {' '.join(text.value.value.split())}"
        for one, text in pairwise(body)
        if isinstance(one, ast.AnnAssign)
    ]
    return [
        "## Many grasps at once",
        "",
        f"`graspsense.plugin_api.BatchBackend`: {_text(roles.BatchBackend)} Experiments and simulated trials then "
        "ask it for them; it need not be one.",
        "",
        *_methods(roles.BatchBackend),
        f"`BatchOptions`: {_text(roles.BatchOptions)}",
        "",
        *options,
        "",
        f"`Grasped`: {_text(roles.Grasped)}",
        "",
    ]


def _text(thing: Any) -> str:
    """Return a docstring as Markdown: one paragraph a blank line."""
    return re.sub(r"(?<!\n)\n(?!\n)", " ", inspect.getdoc(thing) or "")


def _entry(cls: Any) -> list[str]:
    lines = ["| field | type | default |", "|---|---|---|"]
    attrs.resolve_types(cls)
    for one in attrs.fields(cls):
        default = "must be given" if one.default is attrs.NOTHING else f"`{one.default!r}`"
        kind = strict._kind_words(one.type).replace("graspsense.core.entries.", "").replace("|", "or")
        lines.append(f"| `{one.name}` | {_cell(kind)} | {default} |")
    return [*lines, "", _text(cls), ""]


def _example(role: str) -> list[str]:
    kind = KINDS[role]
    words = {**WORDS, "Class": "LabThing" + kind.suffix}
    lines = []
    for name in ("plugin", kind.module):
        text = (
            files("graspsense.scaffold")
            .joinpath(f"templates/{role}/{name}.py.txt")
            .read_text(encoding="utf-8")
        )
        lines += [
            f"`src/lab_thing/{name}.py`:",
            "",
            "```python",
            Template(text).substitute(words).rstrip(),
            "```",
            "",
        ]
    return lines


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("[", "\\[")


def main() -> None:
    """Write every page."""
    FOLDER.mkdir(exist_ok=True)
    for role in TITLES:
        (FOLDER / f"{role}.md").write_text(page(role), encoding="utf-8")
    (FOLDER / "hooks.md").write_text(hooks_page(), encoding="utf-8")
    (FOLDER / "signals.md").write_text(signals_page(), encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
