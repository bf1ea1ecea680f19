"""Checkpoints: times after the contact at which a grasp that goes on is recognised from what was measured so far.

A model of whole grasps is wrong for a part of one: the features of the rest are missing, and those of the squeeze have
other values. A model therefore has a further model for each checkpoint, which was trained and calibrated on the same
part of the training grasps. Training and a grasp that goes on cut the trace by the same rule:
`trace.until(contact_s + after_s)`.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite, nan
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from attrs import evolve, frozen

from graspsense.core.components.caller import option
from graspsense.core.components.roles import FeatureSet
from graspsense.core.learn.labelled import ControlFeatures, Labelled
from graspsense.core.values.errors import ConfigError
from graspsense.core.values.features import Features, FeatureTable, missing
from graspsense.core.values.limits import CHECKPOINTS
from graspsense.core.values.signals import HOLD, SQUEEZE

if TYPE_CHECKING:
    from graspsense.core.values.trace import Trace

USED_TIME: Final = "used_time"
"""Time from the contact to the checkpoint, or to the end of the grasp before it (s)."""
USED_FORCE: Final = "used_force"
"""Largest mean force of the pads from the contact to the checkpoint, or to the end of the grasp (N)."""


def contact_of(trace: Trace) -> float | None:
    """Return the time at which the controller saw the contact of both pads, None if it did not."""
    squeezed = (trace.phase >= SQUEEZE) & (trace.phase <= HOLD)
    return float(trace.t_s[int(squeezed.argmax())]) if squeezed.any() else None


def reaches(trace: Trace, contact_s: float, after_s: float) -> bool:
    """Return whether the grasp still goes on at a time (s) after the contact."""
    later = trace.t_s >= contact_s + after_s
    return bool(later.any()) and int(trace.phase[int(later.argmax())]) <= HOLD


def used(trace: Trace, contact_s: float, after_s: float | None = None) -> tuple[float, float]:
    """Return the time (s) and the largest mean force of the pads (N) from the contact to a checkpoint.

    Both end with the grasp, where the release begins; without a checkpoint, they are those of the whole grasp.
    """
    during = (trace.t_s >= contact_s) & (trace.phase <= HOLD)
    if after_s is not None:
        during &= trace.t_s <= contact_s + after_s
    if not during.any():
        return 0.0, nan
    forces = np.array([trace.force_left_n[during], trace.force_right_n[during]])
    known = np.isfinite(forces)
    counts = known.sum(axis=0)
    mean = np.where(known, forces, 0.0).sum(axis=0)[counts > 0] / counts[counts > 0]
    return float(trace.t_s[during][-1] - contact_s), float(mean.max()) if len(mean) else nan


def checkpoints_of(text: str | None) -> tuple[float, ...]:
    """Return the checkpoints that a user typed: `0.1,0.2`; none for None.

    Raises ConfigError unless they increase from above 0.
    """
    if text is None:
        return ()
    try:
        times = tuple(float(part) for part in text.split(","))
    except ValueError:
        raise ConfigError(
            f"checkpoints {text!r}: write seconds after the contact, as in 0.1,0.2,0.4"
        ) from None
    if not all(isfinite(t) and t > 0.0 for t in times) or list(times) != sorted(set(times)):
        raise ConfigError(f"checkpoints {text!r}: write increasing times above 0 s, as in 0.1,0.2,0.4")
    return checked_checkpoints(times)


def checked_checkpoints(times: Sequence[float]) -> tuple[float, ...]:
    """Return the checkpoints (s). Raises ConfigError for too many of them."""
    if too_many := CHECKPOINTS.exceeded(len(times)):
        raise ConfigError(too_many)
    return tuple(times)


class CheckpointFeatures(FeatureSet[Any]):
    """Extracts the features of a whole grasp, and those at each checkpoint, in one pass over the trials.

    The names of the features at a checkpoint are `name@0.2`. Those of a grasp that has ended before are missing.
    """

    def __init__(self, feature_set: FeatureSet[Any], checkpoints_s: Sequence[float]) -> None:
        super().__init__(feature_set.config)
        self._feature_set, self._checkpoints_s = feature_set, tuple(checkpoints_s)
        # The channels of the set within it; a set whose entry declares them has none of its own.
        self.requires = getattr(feature_set, "requires", ())  # type: ignore[misc]

    def extract(self, trace: Trace) -> Features:
        """Return the features of the whole grasp, and those at each checkpoint with what they cost."""
        whole = self._feature_set.extract(trace)
        names, values, units = list(whole.names), list(whole.values), list(whole.units)
        reasons = dict(whole.reasons)
        contact_s = contact_of(trace)
        for after_s in (*self._checkpoints_s, None):
            part, cost = None, (nan, nan)
            if contact_s is not None:
                cost = used(trace, contact_s, after_s)
                if after_s is not None and reaches(trace, contact_s, after_s):
                    part = self._feature_set.extract(trace.until(contact_s + after_s))
            if after_s is not None:
                names += [_at(name, after_s) for name in whole.names]
                units += whole.units
                values += part.values if part is not None else (nan,) * len(whole.names)
            names += [_at(USED_TIME, after_s), _at(USED_FORCE, after_s)]
            units += [trace.units["t"], trace.units["force_left"]]
            values += cost
        why = (
            "no contact"
            if contact_s is None
            else "not defined at this checkpoint, or the grasp ended before it"
        )
        absent = [name for name, value in zip(names, values, strict=True) if value != value]
        reasons = {**missing(absent, why), **reasons}
        return Features(names=tuple(names), values=tuple(values), units=tuple(units), reasons=reasons)


def with_checkpoints(feature_set: FeatureSet[Any], checkpoints_s: Sequence[float]) -> FeatureSet[Any]:
    """Return a feature set that extracts the features at these checkpoints as well, if there are any."""
    return (
        CheckpointFeatures(feature_set, checked_checkpoints(checkpoints_s)) if checkpoints_s else feature_set
    )


def _at(name: str, after_s: float | None) -> str:
    return f"{name}@{'end' if after_s is None else f'{after_s:g}'}"


@frozen(kw_only=True, eq=False)
class CheckpointTrials:
    """The trials that reach a checkpoint: `rows` are their numbers among all trials.

    `used_s` and `used_n` have a value for each of *all* trials, NaN without a contact: what is spent by the checkpoint,
    or by the end of the grasp if that comes first.
    """

    after_s: float | None
    """None for the whole grasps."""
    labelled: Labelled
    rows: np.ndarray[Any, np.dtype[np.int64]]
    used_s: np.ndarray[Any, np.dtype[np.float64]]
    used_n: np.ndarray[Any, np.dtype[np.float64]]


def split_checkpoints(labelled: Labelled, checkpoints_s: Sequence[float]) -> tuple[CheckpointTrials, ...]:
    """Return the trials at each checkpoint, and last the whole grasps, of trials with `CheckpointFeatures`.

    Raises ConfigError if the trials do not have these features, or if fewer than two labels reach a checkpoint.
    """
    table = labelled.table
    if _at(USED_TIME, None) not in table.names:
        raise ConfigError(
            f"{labelled.source} gives features and not the traces of its trials, so nothing is known of a part of a "
            f"grasp: leave out {option('checkpoints', python='checkpoints_s')}, or use simulated grasps"
        )
    names = [name for name in table.names if "@" not in name]
    parts = []
    for after_s in (*checkpoints_s, None):
        cost = table.columns([_at(USED_TIME, after_s), _at(USED_FORCE, after_s)]).values
        if after_s is None:
            part, rows = _with_columns(labelled, names, names), np.arange(len(labelled))
        else:
            part = _with_columns(labelled, [_at(name, after_s) for name in names], names)
            lasts = table.columns([_at(USED_TIME, None)]).values[:, 0]
            with np.errstate(invalid="ignore"):
                rows = np.flatnonzero(lasts >= after_s)
            part = part.rows(rows)
            if len(part.classes) < 2:
                raise ConfigError(
                    f"only {len(rows)} of {len(labelled)} grasps still go on {after_s:g} s after the contact: choose "
                    "earlier checkpoints"
                )
        parts.append(
            CheckpointTrials(after_s=after_s, labelled=part, rows=rows, used_s=cost[:, 0], used_n=cost[:, 1])
        )
    return tuple(parts)


def _with_columns(labelled: Labelled, columns: Sequence[str], names: Sequence[str]) -> Labelled:
    """Return the trials with these columns of their table under these names; variants have the names already."""
    table = labelled.table.columns(columns)
    variants = {
        name: ControlFeatures(table=variant.table.columns(names), what=variant.what)
        for name, variant in labelled.variants.items()
        if set(names) <= set(variant.table.names)
    }
    return evolve(
        labelled,
        table=FeatureTable(names=tuple(names), units=table.units, values=table.values),
        variants=variants,
    )
