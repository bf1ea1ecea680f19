"""The control tables of labelled trials: the width of the object alone, and features from before contact.

A classifier with one of these tables is a baseline for the full feature set.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Final, TypedDict

from graspsense.core.components.registry import installed
from graspsense.core.learn.labelled import ControlFeatures
from graspsense.core.values.features import FeatureTable
from graspsense.recording.before_contact import NAMES, SPAN_S

BEFORE_CONTACT: Final = f"the first {SPAN_S:g} s of the approach: gap, velocity, effort and pad forces"

FIRST_LINE: Final = "the first frame of the recording alone: gap, velocity, effort and pad forces"


class Controls(TypedDict):
    """The fields of `Labelled` that hold the control tables, or the reasons why there are none."""

    before_contact: ControlFeatures | None
    no_before_contact: str
    first_line: ControlFeatures | None
    width: ControlFeatures | None
    no_width: str


def controls(
    table: FeatureTable,
    before_contact: FeatureTable | None,
    *,
    before_what: str = BEFORE_CONTACT,
    no_before: str = "",
    first_line: FeatureTable | None = None,
    width_meaning: str = "",
) -> Controls:
    """Return the controls of a table of features.

    `before_contact` holds features of the same trials from before contact, None with the reason in `no_before`.
    `before_what` says what these are. `first_line` holds the numbers of the first frame of trials that were imported.
    `width_meaning` says what the width means in these data. The width is the feature that an installed feature set
    declares as such, unless the gap does not change.
    """
    width, no_width = None, "none of the features is declared to be the width"
    if (name := width_feature(table.names)) is not None:
        what = f"{name} alone" + (f": {width_meaning}" if width_meaning else "")
        width, no_width = ControlFeatures(table=table.columns([name]), what=what), ""
        if before_contact is not None and _is_gap_at_start(width.table, before_contact):
            width = None
            no_width = f"{name} is the gap at the start in every trial: the gap does not change, so it tells no width"
    return Controls(
        before_contact=None
        if before_contact is None
        else ControlFeatures(table=before_contact, what=before_what),
        no_before_contact=no_before if before_contact is None else "",
        first_line=None if first_line is None else ControlFeatures(table=first_line, what=FIRST_LINE),
        width=width,
        no_width=no_width,
    )


def without_constant_gap(known_controls: Controls, gaps: Iterable[Iterable[float]]) -> Controls:
    """Return controls without the width of the object if the gap does not change in any recording.

    `gaps` has those of each recording; none is read after one that changes.
    """
    width = known_controls["width"]
    if width is None or bool((width.table.values != width.table.values).all()):
        return known_controls  # there is none in any trial
    known = False
    for gap in gaps:
        values = {value for value in gap if not math.isnan(value)}
        if len(values) > 1:
            return known_controls
        known = known or bool(values)
    if not known:
        return known_controls
    why = "the gap does not change in any recording, so it tells no width"
    return Controls(**{**known_controls, "width": None, "no_width": why})


def _is_gap_at_start(width: FeatureTable, opening: FeatureTable) -> bool:
    """Return whether the gap at the contact is exactly that at the start in every trial with an approach."""
    if NAMES[0] not in opening.names:
        return False
    start, gap = opening.columns([NAMES[0]]).values, width.values
    known = (start == start) & (gap == gap)
    return bool(known.any()) and bool((start[known] == gap[known]).all())


def width_feature(names: Sequence[str]) -> str | None:
    """Return the feature that an installed feature set declares as the width of the object, None if there is none."""
    widths = {entry.width for entry in installed().feature_sets()}
    return next((name for name in names if name in widths), None)
