"""Writes `docs/roles/*.md` from the code: the methods of each role, the fields of its entry, and its checks.

    python docs/role_pages.py

A test compares the pages with the output of this script.
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
from graspsense.scaffold.make import KINDS, plugin_module, words_of
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
            f"This page describes the role `{role}`. A component of this role is selected in the table `[{table}]` "
            "of a pipeline file.",
            "",
            f"- `graspsense plugins new NAME --role {role}` creates a package to start from: the example below.",
            "- `graspsense plugins check NAME` checks whether a component conforms to the role.",
            "- [The tutorial](../tutorial.md) creates a package by hand.",
            "- [What flows](signals.md) describes the values that pass between components.",
            f"- The hook [{HOOKS[role]}](../hooks.md#{_anchor(role)}) declares components of this role.",
            "",
            "## Methods",
            "",
            f"`graspsense.plugin_api.{base.__name__}`: {_text(base)}",
            "",
            *_methods(base),
            *(_many() if role == "sensor-backend" else ()),
            "## Fields of the entry",
            "",
            *_entry(getattr(entries, f"{base.__name__}Entry")),
            "## Complete example",
            "",
            *_example(role),
        ]
    else:
        lines += [
            "`graspsense plugins check DISTRIBUTION` checks the distribution itself before its components. It builds "
            "an editable installation as a wheel, to verify that the wheel is complete.",
            "",
        ]
    lines += [
        "## Conformance checks",
        "",
        f"There are {len(CHECKS[role])} checks, and at least {FLOOR[role]} of them must run. A check that does not "
        "apply is skipped, with a reason.",
        "",
        "| check | requirement |",
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
    lines = [HEAD + "# Hook reference", ""]
    lines += [
        "This page lists every hook with its signature and the fields of the entries that it returns. "
        "[Hooks](../hooks.md) has the rules, and an example of each hook.",
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
        must = "" if getattr(method, "__isabstractmethod__", False) else " (optional)"
        lines += [f"### {name}{must}", "", f"    {name}{signature}", "", _text(function), ""]
    return lines


def _many() -> list[str]:
    """Return the section on batch backends, with the docstring of each option."""
    body = ast.parse(inspect.getsource(roles.BatchOptions)).body[0].body  # type: ignore[attr-defined]
    options = [
        f"- `{one.target.id}: {ast.unparse(one.annotation)}`: {' '.join(text.value.value.split())}"
        for one, text in pairwise(body)
        if isinstance(one, ast.AnnAssign)
    ]
    return [
        "## Many grasps at once",
        "",
        f"`graspsense.plugin_api.BatchBackend`: {_text(roles.BatchBackend)} Experiments and simulated trials use this "
        "class. A sensor backend does not have to be a batch backend.",
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
        default = "required" if one.default is attrs.NOTHING else f"`{one.default!r}`"
        kind = strict._kind_words(one.type).replace("graspsense.core.entries.", "").replace("|", "or")
        lines.append(f"| `{one.name}` | {_cell(kind)} | {default} |")
    return [*lines, "", _text(cls), ""]


def _example(role: str) -> list[str]:
    kind, words = KINDS[role], words_of("lab-thing", [role])
    template = files("graspsense.scaffold").joinpath(f"templates/{role}/{kind.module}.py.txt")
    module = Template(template.read_text(encoding="utf-8")).substitute(words)
    lines = []
    for name, text in (("plugin", plugin_module([role], words)), (kind.module, module)):
        lines += [f"`src/lab_thing/{name}.py`:", "", "```python", text.rstrip(), "```", ""]
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
