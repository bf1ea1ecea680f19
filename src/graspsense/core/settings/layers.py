"""The layers of settings: files that extend one another, options and flags.

A file of another kind of TOML, in the place of a pipeline, is told as such.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any, Final, NamedTuple

from attrs import define, field, frozen

from graspsense.core.components.caller import set_option
from graspsense.core.components.entries import TABLE_OF_ROLE, PipelineEntry
from graspsense.core.components.registry import Plugins
from graspsense.core.components.strict import InvalidValue, shown
from graspsense.core.files.toml_text import (
    KeyPath,
    TomlError,
    key_lines,
    key_parts,
    labelled_values,
    settings_text,
    toml_values,
)
from graspsense.core.values.errors import ConfigError, UnknownName


class TomlKind(NamedTuple):
    """A kind of TOML file.

    `called` is what it is; `marks` are keys by which it is recognised, `needed` those of which it must have one; `use`
    is a command that takes it.
    """

    called: str
    marks: frozenset[str]
    needed: frozenset[str]
    use: str


_PIPELINE: Final = frozenset({"extends", "run", *TABLE_OF_ROLE.values()})
KINDS: Final[Mapping[str, TomlKind]] = {
    "pipeline": TomlKind(
        called="a pipeline",
        marks=_PIPELINE,
        needed=_PIPELINE,
        use="graspsense run --pipeline {file}",
    ),
    "scene": TomlKind(
        called="a scene",
        marks=frozenset(
            {"width_m", "terms", "mass_kg", "patch", "share", "friction", "offset_m", "identified"}
        ),
        needed=frozenset({"width_m"}),
        use="graspsense run --object {file}",
    ),
    "experiment": TomlKind(
        called="an experiment",
        marks=frozenset({"title", "question", "kind", "parts", "seeds", "sweep", "data", "judge", "variants"})
        | (_PIPELINE - {"extends", "classifier"}),
        needed=frozenset({"title"}),
        use="graspsense experiment {file}",
    ),
    "manifest": TomlKind(
        called="a manifest of recordings",
        marks=frozenset(
            {"files", "list", "time", "gap", "force", "left", "right", "label", "rate_hz", "zero"}
        ),
        needed=frozenset({"files", "list"}),
        use="graspsense import {file} --check",
    ),
}


def toml_kind(values: Mapping[str, Any], expected: str = "") -> str:
    """Return the kind of file that these top-level keys are of: the one that knows most of them.

    It is `expected` where another kind fits no better, and also where none knows a key; without it, that is empty.
    """

    def fit(name: str) -> tuple[int, bool, bool]:
        kind = KINDS[name]
        return len(kind.marks & values.keys()), bool(kind.needed & values.keys()), name == expected

    best = max(KINDS, key=fit)
    return best if KINDS[best].marks & values.keys() else expected


def refuse_other_kind(values: Mapping[str, Any], expected: str, file: str) -> None:
    """Raise ConfigError if the content of a TOML file is that of another kind than expected."""
    kind_found = toml_kind(values, expected)
    if kind_found != expected:
        kind = KINDS[kind_found]
        raise ConfigError(
            f"{file} is {kind.called}, not {KINDS[expected].called}. Use it as in: {kind.use.format(file=file)}"
        )


@frozen(eq=False, kw_only=True)
class Layer:
    """Values from one origin.

    `label` names the origin; `typed` is what the user typed, for an origin that is not a file. What is typed applies to
    the component that is selected in the end. Of any other layer, the keys of a table are dropped if a later layer
    changes the `type` of the table.
    """

    label: str
    values: Mapping[str, Any]
    lines: Mapping[KeyPath, int] = field(factory=dict)
    typed: str = ""
    options: Mapping[KeyPath, str] = field(factory=dict)
    """What the user typed to set single keys of it, in place of their lines."""

    def where(self, path: KeyPath) -> str:
        """Return the place of a key: what the user typed, or the file with the line where there is one.

        That of a table is followed by what the user typed for keys of it.
        """
        for end in range(len(path), 0, -1):
            if path[:end] in self.options:
                return self.options[path[:end]]
        ends = (end for end in range(len(path), 0, -1) if path[:end] in self.lines)
        place = next((f"{self.label}:{self.lines[path[:end]]}" for end in ends), self.label)
        return " with ".join(
            [place, *(typed for key, typed in self.options.items() if key[: len(path)] == path)]
        )

    def complain(self, problem: InvalidValue, known: Iterable[str] = ()) -> str:
        """Return a problem in one line: origin, key, text; `known` are the paths of the keys that there are."""
        if self.typed:
            return f"{self.typed}: {problem.words(known)}"
        where = self.where(problem.path)
        key = f"{dotted(problem.path)}: " if problem.path and where not in self.options.values() else ""
        return f"{where}: {key}{problem.words(known)}"


@frozen
class Flag:
    """A command-line flag that sets one key: `Flag("--gripper", "gripper.type", "pr2")`; None is one not given."""

    name: str
    key: str
    value: Any

    def layer(self) -> Layer:
        """Return it as a layer."""
        values = _nested(self.key.split("."), self.value)
        return Layer(label=self.name, values=values, typed=f"{self.name} {self.value}")


@define
class Merged:
    """The merged values of one table, and the layer that set each key last."""

    values: dict[str, Any] = field(factory=dict)
    owner: dict[KeyPath, Layer] = field(factory=dict)

    def add(
        self, path: KeyPath, values: Mapping[str, Any], layer: Layer, into: dict[str, Any] | None = None
    ) -> None:
        """Merge the values of a later layer. Tables are merged, lists replaced.

        `path` is that of the table, and `into` the table where it is one within the values.
        """
        into = self.values if into is None else into
        self.owner[path] = layer
        for key, value in values.items():
            here = (*path, key)
            if isinstance(value, Mapping):
                inner = into.get(key)
                if not isinstance(inner, dict):
                    inner = into[key] = {}
                self.add(here, value, layer, inner)
            else:
                was_table = isinstance(into.get(key), dict)
                into[key] = value
                self.owner[here] = layer
                if was_table:
                    for below in [path for path in self.owner if path[: len(here)] == here and path != here]:
                        del self.owner[below]

    def owner_of(self, path: KeyPath) -> Layer | None:
        """Return the layer that set this key, or the table that contains it; None for a default."""
        for end in range(len(path), 0, -1):
            if path[:end] in self.owner:
                return self.owner[path[:end]]
        return None


def pipeline_layers(pipeline: str, plugins: Plugins) -> list[Layer]:
    """Return the layers of a pipeline; the first one extends nothing.

    `pipeline` is a path that ends in `.toml`, or a name that a plugin provides. Raises ConfigError.
    """
    layers: list[Layer] = []
    seen: list[tuple[str, str]] = []
    asked, base, asker = pipeline, Path(), ""
    while True:
        source, label, base = _located(asked, base, asker, plugins)
        identity = os.path.realpath(source) if isinstance(source, Path) else str(source)
        if identity in (earlier for earlier, _ in seen):
            names = " -> ".join([*(name for _, name in seen), label])
            raise ConfigError(f"{asker}extends forms a circle: {names}")
        seen.append((identity, label))
        layer = read_toml(source, label, "pipeline")
        values = dict(layer.values)
        extends = values.pop("extends", None)
        layers.insert(0, Layer(label=label, values=values, lines=layer.lines))
        if extends is None:
            return layers
        asker = f"{layer.where(('extends',))}: "
        if not isinstance(extends, str):
            raise ConfigError(
                f"{asker}extends: expected the name of a pipeline or the path of a .toml file, "
                f"found {shown(extends)}"
            )
        asked = extends


def _located(asked: str, base: Path, asker: str, plugins: Plugins) -> tuple[Traversable, str, Path]:
    """Return the file of a pipeline, its name in errors, and the folder that its `extends` is relative to."""
    if asked.endswith(".toml"):
        path = base / asked
        return path, str(path), path.parent
    try:
        shipped = plugins.resource(PipelineEntry, asked)
    except UnknownName as error:
        hint = "\n  A file is given with its ending .toml"
        if os.path.isfile(base / asked):  # of pathlib, it raises for a name that is too long
            hint += f"; there is a file {str(base / asked)!r} without it: rename it"
        elif os.path.isfile(base / f"{asked}.toml"):
            hint += f": {base / asked}.toml"
        raise UnknownName(f"{asker}{error}{hint}") from None
    resource = shipped.file()
    return (
        resource,
        f"pipeline {shipped.qualified}",
        resource.parent if isinstance(resource, Path) else Path(),
    )


def read_toml(source: Traversable, label: str, what: str) -> Layer:
    """Read a TOML file, which errors call `label`; `what` is its kind, as in `KINDS`, or any other word.

    Raises ConfigError, also for a file of another kind.
    """
    return toml_layer(settings_text(source, label, what), label, what)


def toml_layer(text: str, label: str, what: str) -> Layer:
    """Return the values of a TOML text, with `label` and `what` as in `read_toml`. Raises ConfigError."""
    values = labelled_values(text, label)
    if what in KINDS:
        refuse_other_kind(values, what, label)
    return Layer(label=label, values=values, lines=key_lines(text))


def option_layers(options: Sequence[str]) -> tuple[list[Layer], list[str]]:
    """Return a layer for each option `a.b=VALUE`, and a complaint for each malformed one.

    VALUE is a TOML value; any other text is a string. Raises ConfigError if the options are no list of texts.
    """
    if isinstance(options, str | Mapping) or not all(isinstance(name, str) for name in options):
        example = options if isinstance(options, str) else "run.seed=3"
        raise ConfigError(f"options: expected a list of texts, as in [{example!r}], found {options!r}")
    layers, complaints = [], []
    for option in options:
        key, equals, value = option.partition("=")
        parts = key_parts(key)
        if not equals or not parts:
            complaints.append(
                f"{set_option(option)}: expected TABLE.KEY=VALUE, as in {set_option('run.seed=3')}"
            )
            continue
        values = _nested(parts, _toml_value(value))
        layers.append(Layer(label="-o", values=values, typed=set_option(option)))
    return layers, complaints


def typed_path(layer: Layer) -> KeyPath:
    """Return the path of the key that an option sets."""
    path: list[str] = []
    values: Any = layer.values
    while isinstance(values, Mapping) and len(values) == 1:
        ((key, values),) = values.items()
        path.append(key)
    return tuple(path)


def _toml_value(text: str) -> Any:
    """Return the TOML value of this text, or the text itself unless it is exactly one value."""
    try:
        value = toml_values(f"value = {text}")["value"]
        # Within brackets, a comment hides the end, and a second key is not TOML.
        return value if len(toml_values(f"value = [{text}]")["value"]) == 1 else text
    except TomlError:
        return text


def _nested(parts: Sequence[str], value: Any) -> dict[str, Any]:
    for part in reversed(parts):
        value = {part: value}
    return dict(value)


def dotted(path: Iterable[str | int]) -> str:
    """Return a key in dotted form: `gripper.terms[2].stiffness`."""
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else part
    return text
