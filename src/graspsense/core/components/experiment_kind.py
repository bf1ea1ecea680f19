"""What the classes that a kind of experiment names must be."""

from __future__ import annotations

from typing import Any

import attrs

from graspsense.core.components.entries import ExperimentKindEntry
from graspsense.core.components.registry.parts import Resource
from graspsense.core.values.errors import ComponentFailed

RESULT_FIELDS = ("source", "simulated")
"""The fields of every result: where its trials are from, in words, and whether they are simulated."""


def class_of_kind(kind: Resource[ExperimentKindEntry], part: str) -> Any:
    """Return the class that a kind names as its `keys` or its `result`.

    Raises PluginUnavailable if it cannot be imported, ComponentFailed if values of it can be neither read nor written.
    """
    cls = kind.load(part)
    if not (isinstance(cls, type) and attrs.has(cls)):
        raise ComponentFailed(
            f"{getattr(kind.entry, part)}, `{part}` of the kind {kind.qualified}, is no class of attrs: decorate it "
            "with @frozen(kw_only=True)"
        )
    names = {*attrs.fields_dict(cls), *dir(cls)}
    lacking = [name for name in RESULT_FIELDS if part == "result" and name not in names]
    if lacking:
        raise ComponentFailed(
            f"{kind.entry.result}, `result` of the kind {kind.qualified}, has no {' and no '.join(lacking)}: give it "
            "`source: str`, where its trials are from, in words, and `simulated: bool`, whether they are simulated"
        )
    return cls
