"""Writes `docs/roles/*.md` from the code: the methods of each role, the fields of its entry, and its checks.

    python docs/role_pages.py

A test compares the pages with the output of this script.
"""

from __future__ import annotations

import ast
import enum
import inspect
import re
import sys
from collections.abc import Iterable, Sequence
from functools import partial
from importlib import import_module
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from string import Template
from textwrap import dedent, indent
from typing import Any

import attrs

from graspsense import (
    classifier_api,
    experiment_api,
    gripper_api,
    plugin_api,
    simulator_api,
    testing_api,
)
from graspsense.core.components import compiled_features, entries, hookspecs, roles, strict
from graspsense.core.control import contact, free_motion, tick
from graspsense.core.values import signals
from graspsense.scaffold.make import KINDS, plugin_module, words_of
from graspsense.testing import CHECKS
from graspsense_sim_gripper.scene.terms import Term
from graspsense_sim_gripper.scene.terms.registry import TERMS

DOORS = (plugin_api, gripper_api, classifier_api, experiment_api, testing_api, simulator_api)
"""The public modules for authors of plugins."""
DOOR_OF = {name: door for door in DOORS for name in door.__all__}
FOLDER = Path(__file__).parent / "roles"
TITLES = {
    "sensor-backend": "A gripper",
    "controller": "A controller",
    "feature-set": "A feature set",
    "classifier": "A classifier",
    "dataset": "A reader of a data set",
    "distribution": "A distribution",
}
HELPERS = {
    "Settings": ("setting",),
    "Contact and rest": (
        *("CONTACT_FORCE_N", "REST_SPEED_M_S", "REST_WINDOW_S"),
        *("both_touch", "RestState", "update_rest", "at_rest", "first_rest"),
        *("RestCourse", "follow_rest"),
        *("gap_resolution", "window_of_rest"),
    ),
    "Phases that a controller reports": ("APPROACH", "SQUEEZE", "HOLD"),
    "Outcomes that a controller reports": (
        *("RUNNING", "STEADY", "NEVER_STEADY", "NOTHING_THERE", "TOO_WIDE", "SIDE_IMPACT"),
        *("ONE_FINGER", "CRUSHED", "SLIPPED"),
    ),
    "Kinds of command": ("EFFORT", "VELOCITY", "POSITION", "FORCE"),
    "Features and tables": ("missing", "in_words", "table_of"),
    "Further channels": ("signal_type", "no_signals", "no_pads", "opposed_forces"),
    "Tests of a plugin": (
        *("parametrize_checks", "create", "model_gripper", "drive"),
        *("squeeze", "with_channels", "sample_table", "a_trial"),
    ),
}
GRIPPER_EXAMPLE = (
    "\n- [A gripper on a network socket](../tcp_gripper.md) has an example with a fake server, the options of the "
    "conformance checks, and what to do with a gripper that closes by itself, or has one force sensor or none."
)
FASTER: dict[str, tuple[str, str, Any, tuple[str, ...]]] = {
    "controller": ("Free motion in closed form", "free_motion", free_motion, ("FreeMotion", "FreeLimits")),
    "feature-set": ("A compiled form", "compiled", compiled_features, ("CompiledFeatures", "TickColumns")),
}
"""What a role may declare so that simulated grasps take less time: title, attribute, module and names of classes."""
FLOWING = (
    *("Reading", "Frame", "Pads", "Image", "Samples", "Command"),
    *("Channel", "TactileArray", "FastChannel", "FingerForce", "DeviceInfo", "Mounting"),
    *("Trace", "ImageTrace", "SampleTrace", "Features", "FeatureTable", "Prediction"),
    *("Reason", "FeatureValue", "Contribution", "RunInfo", "GraspEvent", "Trial"),
)
EXAMPLE = "\n\nExample::\n\n"
"""What stands before the example in the docstring of a hook."""
HEAD = "<!-- Written by docs/role_pages.py from the code: change that. -->"


def _text_of_page(blocks: Sequence[str]) -> str:
    """Return the text of a page: blocks, as all functions here return them, with an empty line between."""
    return f"{HEAD}\n" + "\n\n".join(blocks) + "\n"


def _table(header: str, rows: Iterable[str]) -> str:
    """Return the block of a table."""
    return "\n".join([header, "|---" * (header.count("|") - 1) + "|", *rows])


def _fields_section(name: str) -> list[str]:
    """Return the section on a class of values: its fields and its meaning."""
    return [f"## {name}", f"    {_fields_of(public(name))}", _text(public(name))]


def dataset_page() -> str:
    """Return the page of a reader of a data set, which is a function and no component."""
    return _text_of_page(
        [
            f"# {TITLES['dataset']}",
            "This page describes readers of recorded grasps. A manifest ([import](../import.md)) describes most files "
            "without any code. A reader is for files that a manifest cannot describe.",
            "A reader is a function `recordings(folder)` that yields a `LabelledRecording` for each grasp. With the "
            "name of its entry, the data set can be",
            "- evaluated: `graspsense evaluate NAME:FOLDER`;\n"
            "- imported into a store, with its recordings: `graspsense import NAME:FOLDER --save DIR`;\n"
            "- looked at before: `graspsense import NAME:FOLDER --check`;\n"
            "- replayed grasp by grasp: `graspsense replay NAME:FOLDER#3`, or `gripper.recording=NAME:FOLDER#3` of the "
            "gripper `replay`.",
            "`graspsense plugins new NAME --role dataset` creates a package to start from: the example below. The hook "
            "[graspsense_datasets](hooks.md#graspsense_datasets) declares readers.",
            "A reader that raises an exception ends its data set: the recordings before are used, and the error is "
            "told. `each_readable` reads one file, and yields an `UnreadableRecording` in its place if that fails, so "
            "that the reader goes on with the next one. Whatever the file makes a library raise becomes an error that "
            "names the file.",
            "`graspsense plugins check DISTRIBUTION --data NAME=FOLDER` (in a test `parametrize_checks(DISTRIBUTION, "
            "data={NAME: FOLDER})`) reads the sound examples in this folder twice, which must give the same, and then "
            "with an empty file and with a word in each column: the error must name the file and the column.",
            *_fields_section("LabelledRecording"),
            *_fields_section("Recording"),
            *_fields_section("GraspColumns"),
            f"`checked_recording(columns)`: {_text(public('checked_recording'))}",
            *_fields_section("StoredGrasp"),
            "## Fields of the entry",
            *_entry(entries.DatasetEntry),
            "## Complete example",
            *_example("dataset"),
        ]
    )


def page(role: str) -> str:
    """Return the page of a role."""
    if role == "dataset":
        return dataset_page()
    blocks = [f"# {TITLES[role]}"]
    if role != "distribution":
        kind = entries.ROLES[role]  # type: ignore[index]
        base = public(kind.entry.__name__.removesuffix("Entry"))
        blocks += [
            f"This page describes the role `{role}`. A component of this role is selected in the table "
            f"`[{kind.table}]` of a pipeline file.",
            f"- `graspsense plugins new NAME --role {role}` creates a package to start from: the example below.\n"
            "- `graspsense plugins check NAME` checks whether a component conforms to the role.\n"
            "- [The tutorial](../tutorial.md) creates a package by hand.\n"
            "- [Values and units](signals.md) describes the values that pass between components.\n"
            "- [Helpers](helpers.md) describes the functions and constants that a component is written with.\n"
            f"- The hook [{kind.hook}](hooks.md#{kind.hook}) declares components of this role."
            + GRIPPER_EXAMPLE
            * (role == "sensor-backend"),
            *_attributes(base, kind.declared),
            "## Methods",
            f"`graspsense.plugin_api.{base.__name__}`: {_text(base)}",
            *_methods(base),
            *(_many() if role == "sensor-backend" else ()),
            *(_faster(*FASTER[role]) if role in FASTER else ()),
            "## Fields of the entry",
            *_entry(kind.entry),
            "## Complete example",
            *_example(role),
        ]
    else:
        blocks.append(
            "`graspsense plugins check DISTRIBUTION` checks the distribution itself before its components. It builds "
            "an editable installation as a wheel, to verify that the wheel is complete."
        )
    rows = (f"| `{check.id}` | {_cell(check.title)} |" for check in CHECKS[role])
    blocks += [
        "## Conformance checks",
        f"There are {len(CHECKS[role])} checks. One that does not apply is skipped, with a reason.",
        _table("| check | requirement |", rows),
    ]
    return _text_of_page(blocks)


def signals_page() -> str:
    """Return the page of the values that pass between the parts."""
    blocks = ["# Values and units", _text(signals)]
    for name in FLOWING:
        blocks += [*_fields_section(name), *_documented_fields(public(name))]
    rows = (f"| `{name}` | {unit} |" for name, unit in signals.CHANNELS.items())
    return _text_of_page([*blocks, "## Channels", _table("| channel | unit |", rows)])


def hooks_page() -> str:
    """Return the page of every hook and of what it gives."""
    blocks = [
        "# Hook reference",
        "This page has every hook: its signature, an example, and the fields of the entries that it returns. "
        "[Hooks](../hooks.md) has the rules. A module of hooks also says `GRASPSENSE_API = (2, 0)`.",
        "An observer (`graspsense_run_starting`, `graspsense_grasp_event`, `graspsense_run_finished`) is called a few "
        "times in a grasp. It cannot change the run. An exception in it does not stop the grasp; it is reported once, "
        "as a warning of the logger `graspsense.plugins`.",
    ]
    specs = {name: spec for name, spec in vars(hookspecs).items() if name.startswith("graspsense_")}
    for name, spec in specs.items():
        signature = f"{name}{inspect.signature(spec)}".replace("'", "")
        blocks += [f"## {name}", f"    {signature}", _text(spec).partition(EXAMPLE)[0]]
        blocks.append(f"```python\n{hook_example(spec)}\n```")
        given = re.search(r"Iterable\[(\w+)\]", signature)
        if given:
            blocks += _entry(getattr(entries, given[1]))
    return _text_of_page(blocks)


def hook_example(spec: Any) -> str:
    """Return the module of a plugin that implements a hook as the example in its docstring does.

    The example of a hook that gives entries is the statement that yields one. A role that `plugins new` knows has the
    module that it writes.
    """
    if EXAMPLE not in inspect.cleandoc(spec.__doc__):
        role = spec.__name__.removeprefix("graspsense_").removesuffix("s").replace("_", "-")
        return plugin_module([role], words_of("lab-thing", [role])).rstrip()
    example = dedent(inspect.cleandoc(spec.__doc__).partition(EXAMPLE)[2])
    entry = re.match(r"yield (\w+)\(", example)
    if entry is None:
        return example
    names = {"graspsense.plugin_api": ["hookimpl"]}
    names.setdefault(DOOR_OF[entry[1]].__name__, []).insert(0, entry[1])
    imports = "".join(f"from {door} import {', '.join(names[door])}\n" for door in sorted(names))
    arguments = ", ".join(inspect.signature(spec).parameters)
    return f"{imports}\n\n@hookimpl\ndef {spec.__name__}({arguments}):\n{indent(example, '    ')}"


def terms_page() -> str:
    """Return the page of the terms of a simulated object, and of what declares one."""
    blocks = [
        "# Terms of a simulated object",
        "The force of an object is the sum of its terms. A term of a [scene](../simulator.md#a-scene-of-your-own) has "
        "a `type` and the parameters below, in the SI units that their names end with; those with a value may be left "
        "out. d is the compression in metres.",
    ]
    for name, kind in TERMS.items():
        parameters = (
            f"`{key}`"
            + (f" ({kind.params._field_defaults[key]:g})" if key in kind.params._field_defaults else "")
            for key in kind.params._fields
        )
        blocks += [f"## {name}", _text(kind.params), f"Parameters: {', '.join(parameters)}."]
        blocks += _documented_fields(kind.params)
    blocks += [
        "## Term",
        "[A term of your own](../simulator.md#a-term-of-your-own) is declared by these fields.",
        f"    {_fields_of(Term)}",
        _text(Term),
        *_documented_fields(Term),
    ]
    return _text_of_page(blocks)


def helpers_page() -> str:
    """Return the page of the functions and constants of `plugin_api` that a component is written with."""
    blocks = [
        "# Helpers",
        "These functions and constants are for use in components and their tests. The "
        "features and controllers of graspsense use the same functions, so that all of them agree on contact and rest. "
        "They are in `graspsense.plugin_api` unless another module is named.",
    ]
    for title, names in HELPERS.items():
        blocks.append(f"## {title}")
        constants = [name for name in names if not callable(public(name))]
        if constants:
            blocks.append(_table("| constant | value | meaning |", map(_constant, constants)))
        for name in names:
            if name not in constants:
                blocks += _helper(name)
    return _text_of_page(blocks)


def _helper(name: str) -> list[str]:
    """Return the section on one function or named tuple: signature, meaning and example."""
    helper = public(name)
    door = DOOR_OF[name]
    home = [] if door is plugin_api else [f"It is in `{door.__name__}`."]
    told = (*home, _meaning(helper), *_docstring_example(helper))
    return [f"### {name}", f"    {name}{_signature(helper)}", *told]


def public(name: str) -> Any:
    """Return what a public name stands for."""
    return getattr(DOOR_OF[name], name)


def _signature(called: Any) -> str:
    """Return the signature of a function or class; the quotes of annotations go, those of default values stay."""
    signature = re.sub(r"(: |-> )'([^']+)'", r"\1\2", str(inspect.signature(called)))
    return re.sub(r"ForwardRef\('?(\w+)'?\)", r"\1", signature)


def names_page() -> str:
    """Return the page of every public name, in the groups of its module."""
    blocks = [
        "# Public names",
        "Everything that a plugin may import. The roles, [signals](signals.md) and [helpers](helpers.md) have pages "
        "with examples.",
    ]
    for door in DOORS:
        title = door.__name__.rpartition(".")[2]
        blocks += [f"## graspsense.{title}", _text(door).partition("\n\n")[0]]
        for title, names in door.PUBLIC.groups.items():
            rows = (_public_row(home, name) for name, home in names)
            blocks += [f"### {title}", _table("| name | meaning |", rows)]
    return _text_of_page(blocks)


def _public_row(home: str, name: str) -> str:
    """Return the row of a name: with its signature if it is called, and the first sentence of its meaning."""
    value = getattr(import_module(home), name)
    if not callable(value):
        _, meaning = _docstrings(import_module(home)).get(name, ("", ""))
        return f"| `{name}` | {_cell(_sentence(meaning) or f'the value {value!r}')} |"
    if inspect.isclass(value):
        shown = name if issubclass(value, BaseException | enum.Enum) else _fields_of(value)
    else:
        shown = f"{name}{_signature(value)}"
    return f"| {_cell(f'`{shown}`')} | {_cell(_sentence(inspect.getdoc(value) or ''))} |"


def _fields_of(cls: Any) -> str:
    """Return a class with its fields, without them if it has none."""
    fields = getattr(cls, "_fields", None) or tuple(
        field.alias for field in getattr(cls, "__attrs_attrs__", ()) if field.init
    )
    return f"{cls.__name__}({', '.join(fields)})" if fields else cls.__name__


def _sentence(text: str) -> str:
    """Return the first sentence of a docstring."""
    return re.split(r"(?<=[.:]) (?=[A-Z])", " ".join(text.partition("\n\n")[0].split()))[0]


def _docstrings(thing: Any) -> dict[str, tuple[str, str]]:
    """Return the annotation and the docstring of each name of a class or a module that has a docstring below it."""
    tree = ast.parse(inspect.getsource(thing))
    body = tree.body if inspect.ismodule(thing) else tree.body[0].body  # type: ignore[attr-defined]
    documented = {}
    for statement, text in pairwise(body):
        if isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant):
            if isinstance(statement, ast.AnnAssign):
                kind = ast.unparse(statement.annotation)
                documented[ast.unparse(statement.target)] = kind, str(text.value.value)
            elif isinstance(statement, ast.Assign):
                documented[ast.unparse(statement.targets[0])] = "", str(text.value.value)
    return documented


def _in_a_line(text: str) -> str:
    return " ".join(text.split())


def _constant(name: str) -> str:
    """Return the row of a constant, with the docstring that follows it in its module."""
    documented = _docstrings(signals) | _docstrings(contact) | _docstrings(tick)
    home = "" if DOOR_OF[name] is plugin_api else f" (in `{DOOR_OF[name].__name__}`)"
    return f"| `{name}` | {public(name):g} | {_cell(_in_a_line(documented[name][1]))}{home} |"


def _attributes(base: Any, declared: Sequence[str]) -> list[str]:
    """Return what the class of a component declares by attributes."""
    if not declared:
        return []
    rows = []
    for name, (kind, text) in _docstrings(base).items():
        kind = kind.removeprefix("ClassVar[").removesuffix("]" * kind.startswith("ClassVar"))
        rows.append(f"| `{name}` | {_cell(kind)} | {_cell(_in_a_line(text))} |")
    for name in declared:
        if isinstance(value := vars(base).get(name), property):
            kind = str(inspect.signature(value.fget).return_annotation)  # type: ignore[arg-type]
            rows.append(f"| `{name}` | {_cell(kind)} | {_cell(_in_a_line(inspect.getdoc(value) or ''))} |")
    return ["## What the class declares", _table("| attribute | type | meaning |", rows)]


def _methods(base: Any) -> list[str]:
    blocks = []
    for name, method in vars(base).items():
        function = method.__func__ if isinstance(method, staticmethod) else method
        if name.startswith("_") or not callable(function):
            continue
        signature = (
            re.sub(r"'([^']+)'", r"\1", str(inspect.signature(function)))
            .replace("self, ", "")
            .replace("(self)", "()")
        )
        must = "" if getattr(method, "__isabstractmethod__", False) else " (optional)"
        must = " (ready to use)" if name in ("result", "undefined") else must
        blocks += [f"### {name}{must}", f"    {name}{signature}", _text(function)]
    return blocks


def _many() -> list[str]:
    """Return the section on batch backends, with the docstring of each option."""
    options = [
        f"- `{name}: {kind}`: {_in_a_line(text)}"
        for name, (kind, text) in _docstrings(roles.BatchOptions).items()
    ]
    return [
        "## Many grasps at once",
        f"`graspsense.simulator_api.BatchBackend`: {_text(roles.BatchBackend)} Experiments and simulated trials use "
        "this class. A sensor backend does not have to be a batch backend.",
        *_documented_fields(roles.BatchBackend),
        *_methods(roles.BatchBackend),
        f"`BatchOptions`: {_text(roles.BatchOptions)}",
        "\n".join(options),
        f"`Grasped`: {_text(roles.Grasped)}",
    ]


def _faster(title: str, attribute: str, module: Any, classes: Sequence[str]) -> list[str]:
    """Return the section on what a class may declare so that simulated grasps take less time."""
    blocks = [f"## {title}", f"`{attribute}` is optional. {_text(module)}"]
    for name in classes:
        cls = public(name)
        blocks += [f"### {name}", f"    {_fields_of(cls)}"]
        blocks += [_meaning(cls), *_documented_fields(cls), *_docstring_example(cls)]
    return blocks


def _meaning(thing: Any) -> str:
    """Return the docstring up to its example."""
    return _text(thing).partition("\n\n>>> ")[0]


def _docstring_example(thing: Any) -> list[str]:
    """Return the example of a docstring, nothing if there is none."""
    example = (inspect.getdoc(thing) or "").partition("\n\n>>> ")[2]
    return [f"```pycon\n>>> {example}\n```"] if example else []


def _documented_fields(cls: Any) -> list[str]:
    """Return a list of the fields of a class that have a docstring; nothing if none has one."""
    lines = [f"- `{name}`: {_in_a_line(text)}" for name, (kind, text) in _docstrings(cls).items() if kind]
    return ["\n".join(lines)] if lines else []


def _text(thing: Any) -> str:
    """Return a docstring as Markdown: one paragraph a blank line."""
    return re.sub(r"(?<!\n)\n(?!\n)", " ", inspect.getdoc(thing) or "")


def _entry(cls: Any) -> list[str]:
    rows = []
    meanings: dict[str, tuple[str, str]] = {}
    for base in reversed(cls.__mro__[:-1]):
        meanings |= _docstrings(base)
    attrs.resolve_types(cls)
    for field in attrs.fields(cls):
        empty = field.default.factory() if isinstance(field.default, attrs.Factory) else field.default
        default = "required" if field.default is attrs.NOTHING else f"`{empty!r}`"
        kind = re.sub(r"(?:graspsense|collections)(?:\.[a-z_]+)*\.", "", strict._kind_words(field.type))
        kind = kind.replace("|", "or")
        meaning = _cell(_in_a_line(meanings[field.name][1]))
        rows.append(f"| `{field.name}` | {_cell(kind)} | {default} | {meaning} |")
    return [_table("| field | type | default | meaning |", rows), _text(cls)]


def _example(role: str) -> list[str]:
    kind, words = KINDS[role], words_of("lab-thing", [role])
    template = files("graspsense.scaffold").joinpath(f"templates/{role}/{kind.module}.py.txt")
    module = Template(template.read_text(encoding="utf-8")).substitute(words)
    blocks = []
    for name, text in (("plugin", plugin_module([role], words)), (kind.module, module)):
        blocks += [f"`src/lab_thing/{name}.py`:", f"```python\n{text.rstrip()}\n```"]
    return blocks


def _cell(text: str) -> str:
    """Return a text for a cell of a table: a bracket begins a link only outside of code."""
    parts = text.replace("|", "\\|").split("`")
    parts[::2] = (part.replace("[", "\\[") for part in parts[::2])
    return "`".join(parts)


PAGES = {
    "signals": signals_page,
    "hooks": hooks_page,
    "terms": terms_page,
    "helpers": helpers_page,
    "names": names_page,
    **{role: partial(page, role) for role in TITLES},
}
"""Each page in docs/roles, and what gives its text."""


def main() -> None:
    """Write every page."""
    FOLDER.mkdir(exist_ok=True)
    for name, made in PAGES.items():
        (FOLDER / f"{name}.md").write_text(made(), encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
