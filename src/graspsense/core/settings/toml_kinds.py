"""Which kind of TOML file was named, so that a file in the place of another kind is told as such."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

from graspsense.core.components.entries import TABLE_OF_ROLE
from graspsense.core.values.errors import ConfigError


class TomlKind(NamedTuple):
    """A kind of TOML file.

    `called` is what it is, `place` what can be named where it is expected; `marks` are keys by which it is recognised,
    `needed` those of which it must have one; `use` is a command that takes it.
    """

    called: str
    place: str
    marks: frozenset[str]
    needed: frozenset[str]
    use: str


_PIPELINE: Final = frozenset({"extends", "run", *TABLE_OF_ROLE.values()})
KINDS: Final[Mapping[str, TomlKind]] = {
    "pipeline": TomlKind(
        called="a pipeline",
        place="a pipeline",
        marks=_PIPELINE,
        needed=_PIPELINE,
        use="graspsense run --pipeline {file}",
    ),
    "scene": TomlKind(
        called="a scene",
        place="a scene",
        marks=frozenset(
            {"width_m", "terms", "mass_kg", "patch", "share", "friction", "offset_m", "identified"}
        ),
        needed=frozenset({"width_m"}),
        use="graspsense run --object {file}",
    ),
    "experiment": TomlKind(
        called="an experiment",
        place="an experiment",
        marks=frozenset({"title", "question", "kind", "parts", "seeds", "sweep", "data", "judge", "variants"})
        | (_PIPELINE - {"extends", "classifier"}),
        needed=frozenset({"title"}),
        use="graspsense experiment {file}",
    ),
    "manifest": TomlKind(
        called="a manifest",
        place="a recording, nor a manifest of recordings",
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
            f"{file} is {kind.called}, not {KINDS[expected].place}. Use it as in: {kind.use.format(file=file)}"
        )
