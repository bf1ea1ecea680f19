"""The columns of a grasp of another program, in SI units: checks, and the recording that they are."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from keyword import iskeyword
from typing import Any, Final

import numpy as np
from attrs import evolve, field, frozen
from numpy.typing import NDArray

from graspsense.core.values.channel import Channel, FastChannel, TactileArray
from graspsense.core.values.errors import DataDamaged, counted
from graspsense.core.values.fingers import FingerForce, opposed_forces
from graspsense.core.values.signals import CHANNELS, NO_PADS, Frame, GraspEvent, Phase, Reading
from graspsense.recording.replayable import Recording
from graspsense.sources.columns.fast_samples import most_in_a_tick, signals_in_ticks, values_in_ticks
from graspsense.sources.formats.table import Numbers
from graspsense.sources.formats.topic_clocks import Messages, common_clock

Spans = tuple[tuple[float, float], ...]
"""Begin and end (s) of each of several events."""
LARGE_LOSS: Final = 0.05
"""Share of the samples beyond which leaving them out is told as a warning, and not advised."""
GLITCHES: Final = 0.03
"""Share of the samples up to which those that no gripper has are glitches, and not all in another unit."""
FEWEST_AT_A_RATE: Final = 20
GOES_ON: Final = 0.1
"""Share of its range by which the gap changes at most where only the clock begins anew."""
LONGEST_S: Final = 9e9
"""Longest time whose nanoseconds have 64 bits."""
STEADY_RATE: Final = 2.0
"""Samples of a slower sensor are at least so many, and at most so many times as far apart as they usually are."""
PLAUSIBLE: Final = {
    "gap": (-0.05, 0.5, "m", {"mm": 1e-3, "um": 1e-6}),
    "force": (-2000.0, 2000.0, "N", {"mN": 1e-3}),
    "effort": (-5000.0, 5000.0, "N", {"mN": 1e-3}),
    "velocity": (-5.0, 5.0, "m/s", {"mm/s": 1e-3}),
    "time between samples": (0.0, 1.0, "s", {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}),
}
"""Quantity to its plausible range, the unit of that, and the units that a column out of range is most likely in."""


NAMES: Final = ("t_s", "gap_m", "left_n", "right_n", "effort_n", "velocity_m_s")
"""The columns of a grasp that are no further channels."""


@frozen(kw_only=True, eq=False)
class GraspColumns:
    """The samples of a grasp: each column has shape (n,), each array in `arrays` has shape (n, cells).

    A channel of `scalars` or `arrays` that was sampled at other times has them in `times`, as m increasing numbers (s)
    on the clock of `t_s`. Its values have m rows: those of a fast channel one number for each axis, those of a tactile
    array one for each cell. Samples of a fast channel outside of the times of `t_s` are left out, and the notes of the
    recording say so. `units` names the units that are not SI, by `t`, `gap`, `force` or the name of a further channel.
    `notes` say how the columns came about.
    """

    source: str
    t_s: Numbers
    gap_m: Numbers
    left_n: Numbers
    right_n: Numbers
    effort_n: Numbers | None = None
    velocity_m_s: Numbers | None = None
    scalars: Mapping[str, Numbers] = field(factory=dict)
    fingers: tuple[FingerForce, ...] = ()
    """Those of `scalars` that are the forces of single fingers; `finger_sides` gives `left_n` and `right_n`."""
    arrays: Mapping[str, Numbers] = field(factory=dict)
    shapes: Mapping[str, tuple[int, ...]] = field(factory=dict)
    """Rows and columns of the cells of an array (else there is one row), with the components of a cell as a third
    number where there are several, or samples and axes of a fast channel.

    A fast channel with several numbers in a sample of `t_s` needs it, unless it has `times`."""
    times: Mapping[str, Numbers] = field(factory=dict)
    """The times (s) of the channels that have their own."""
    fast: frozenset[str] = frozenset()
    """Those of `arrays` that are the samples of a fast channel."""
    units: Mapping[str, str] = field(factory=dict)
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    """What looks wrong, found while the columns were read."""
    lines: NDArray[np.int64] | None = None
    """The line of each sample in a text file."""
    events: Mapping[str, Spans] = field(factory=dict)
    """The events that others labelled, by their names, on the clock of `t_s`; those outside of it are left out."""

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.t_s)

    @property
    def force_n(self) -> Numbers:
        """The mean force of both pads."""
        with np.errstate(over="ignore", invalid="ignore"):  # where a force is infinite, or nearly
            mean: Numbers = (self.left_n + self.right_n) / 2.0
        return mean

    def place(self, k: int) -> str:
        """Return where the sample with this index is, in words."""
        return f"sample {k + 1}" if self.lines is None else f"line {self.lines[k]}"

    def rows(self, which: Any, part: str = "") -> GraspColumns:
        """Return these samples (a slice, numbers, or a mask); `part` says in words which they are."""
        named = {name: values[which] for name in NAMES if (values := getattr(self, name)) is not None}
        return evolve(
            self,
            source=f"{self.source}, {part}" if part else self.source,
            **named,
            scalars=self._rows(self.scalars, which),
            arrays=self._rows(self.arrays, which),
            times=self._rows(self.times, which),
            lines=None if self.lines is None else self.lines[which],
        )

    def _rows(self, channels: Mapping[str, Numbers], which: Any) -> dict[str, Numbers]:
        """Return these samples of channels; of one with its own times, those within the times of the samples."""
        t_s = self.t_s[which]
        chosen = {}
        for name, values in channels.items():
            rows = which
            if name in self.times:
                time_s = self.times[name]
                rows = (time_s >= t_s[0]) & (time_s <= t_s[-1]) if len(t_s) else np.zeros(len(time_s), bool)
            chosen[name] = values[rows]
        return chosen


def is_channel_name(name: str) -> bool:
    """Return whether a further channel can have this name, which no channel of every gripper has."""
    plain = re.fullmatch(r"[a-z][a-z0-9_]*", name) is not None
    return plain and not iskeyword(name) and name not in (*CHANNELS, "force", "t")


def finger_sides(fingers: Sequence[FingerForce], forces: Mapping[str, Numbers]) -> tuple[Numbers, Numbers]:
    """Return `left_n` and `right_n` of a hand from the force of each finger, by the rule of its fingers."""
    forces_of = opposed_forces(fingers)
    rows = np.column_stack([forces[finger.name] for finger in fingers]).tolist()
    left, right = np.array([forces_of(row) for row in rows], dtype=np.float64).reshape(-1, 2).T
    return left, right


def without_missing(columns: GraspColumns) -> GraspColumns:
    """Return the samples that have a time, a gap and both forces.

    If most lack one, all are returned, unless those that have them come at a steady rate, as those of a slower sensor.
    Gap and forces that have rows of their own, as topics that were written to one table, hold their last values.
    """
    rarest = min(np.count_nonzero(~np.isnan(values)) for values in (columns.t_s, *_needed(columns).values()))
    if 2 * int(_known(columns).sum()) < rarest:
        columns = _held(columns)
    known = _known(columns)
    if known.all() or (2 * int(known.sum()) < len(known) and not _at_a_steady_rate(known)):
        return columns
    return only(columns, known, f"without a number ({columns.place(int(np.argmin(known)))})")


def _needed(columns: GraspColumns) -> dict[str, Numbers]:
    return {"gap": columns.gap_m, "left force": columns.left_n, "right force": columns.right_n}


def _known(columns: GraspColumns) -> NDArray[np.bool_]:
    every = (columns.t_s, *_needed(columns).values())
    known: NDArray[np.bool_] = np.logical_and.reduce([~np.isnan(values) for values in every])
    return known


def _held(columns: GraspColumns) -> GraspColumns:
    """Return the rows of the gap or of a force, whichever has most, with the last values of the others.

    They are the columns themselves if one has no number, or if its own time goes back.
    """
    order = np.argsort(columns.t_s, kind="stable")
    in_order = all(
        (np.diff(order[~np.isnan(column[order])]) > 0).all() for column in _needed(columns).values()
    )
    if in_order:  # the rows of one come after those of another
        columns = columns.rows(order)
    values = _needed(columns)
    rows = {name: np.flatnonzero(~np.isnan(column)) for name, column in values.items()}
    rises = bool((np.diff(columns.t_s) >= 0.0).all()) and np.ptp(columns.t_s) < LONGEST_S
    if not rises or not all(map(len, rows.values())):
        return columns
    ns = np.round((columns.t_s - columns.t_s[0]) * 1e9).astype(np.int64)
    stamps = {name: ns[known].tolist() for name, known in rows.items()}
    clock = common_clock(
        columns.source, {name: Messages(recorded_ns=t, stamped_ns=t) for name, t in stamps.items()}
    )
    most = max(rows.values(), key=len)
    at_ns = ns - clock.began_ns
    most = most[(at_ns[most] >= clock.begin_ns) & (at_ns[most] <= clock.end_ns)]

    def held(name: str) -> Numbers:
        last, old = clock.topics[name].latest(at_ns[most])
        return np.where(old, np.nan, values[name][rows[name][last]])

    words = "gap and force have rows of their own: the last value of each is used"
    return evolve(
        columns.rows(most),
        gap_m=held("gap"),
        left_n=held("left force"),
        right_n=held("right force"),
        notes=(*columns.notes, words),
        warnings=(*columns.warnings, *clock.notices),
    )


def _at_a_steady_rate(known: NDArray[np.bool_]) -> bool:
    """Return whether the rows that are known are spread evenly over all rows."""
    rows = np.flatnonzero(known)
    if len(rows) < FEWEST_AT_A_RATE:
        return False
    apart = np.diff(np.concatenate(([-1], rows, [len(known)])))
    return bool(apart.max() <= STEADY_RATE * np.median(apart))


def only(columns: GraspColumns, kept: NDArray[np.bool_], what: str) -> GraspColumns:
    """Return the samples that are kept, with a note on the others, and a warning if they are many."""
    lost = int((~kept).sum())
    words = f"{counted(lost, 'sample')} {what} {'was' if lost == 1 else 'were'} dropped, of {len(kept)}"
    large = lost > LARGE_LOSS * len(kept)
    rows = columns.rows(kept)
    return evolve(
        rows, notes=(*rows.notes, words), warnings=(*rows.warnings, words) if large else rows.warnings
    )


@np.errstate(all="ignore")  # what is infinite, or too large, is refused in words
def checked_recording(columns: GraspColumns, *, rate_hz: float | None = None) -> Recording:
    """Return the recording that these columns are; `rate_hz` is that of a single sample.

    Samples without a number are left out, with a note. Raises DataDamaged if columns differ in length, if a channel has
    another shape than `shapes` says, if most samples have no number, if a time does not increase, or if a value is in
    another unit. It names the column.
    """
    for misfit in _misfits(columns):
        raise DataDamaged(f"{columns.source}: {misfit}")
    columns = _within_ticks(without_missing(columns))
    steps = _time_steps(columns, rate_hz)
    _check_complete(columns)
    _check_plausible(columns, "gap", "gap", columns.gap_m)
    _check_plausible(columns, "force", "force", np.concatenate((columns.left_n, columns.right_n)))
    _check_plausible(columns, "effort", "force", columns.effort_n)
    _check_plausible(columns, "velocity", "gap", columns.velocity_m_s)
    velocities = columns.velocity_m_s
    if velocities is None:
        velocities = np.diff(columns.gap_m, prepend=columns.gap_m[:1]) / steps
    _check_plausible(columns, "time between samples", "t", np.array([np.median(steps)]))
    try:
        channels = _channels(columns)
    except ValueError as error:  # a name or a size that no channel can have
        raise DataDamaged(f"{columns.source}: {error}") from error
    return Recording(
        name=columns.source,
        readings=tuple(_readings(columns, steps, velocities, channels)),
        rate_hz=1.0 / float(np.median(steps)),
        units=_units(columns.units),
        notes=columns.notes,
        channels=channels,
        events=_events(columns),
    )


def _events(columns: GraspColumns) -> dict[str, tuple[GraspEvent, ...]]:
    """Return the labelled events, as far as they are within the samples."""
    begin_s, end_s = columns.t_s[[0, -1]].tolist()
    return {
        name: tuple(
            GraspEvent(max(begin, begin_s), Phase.APPROACH, name, "label", until_s=min(end, end_s))
            for begin, end in spans
            if begin <= end_s and end >= begin_s
        )
        for name, spans in columns.events.items()
    }


def _misfits(columns: GraspColumns) -> Iterator[str]:
    """Yield how columns differ in length, number of dimensions or names from what is needed."""
    for name, time_s in columns.times.items():
        if name not in columns.scalars and name not in columns.arrays:
            yield f"`times` names {name!r}, which is neither a scalar nor an array"
        wrong = np.flatnonzero(~(np.diff(time_s) > 0.0)) if np.ndim(time_s) == 1 else np.zeros(1, int)
        if len(wrong) or not np.isfinite(time_s).all():
            place = str(int(wrong[0]) + 2) if len(wrong) else "that is no number"
            yield f"the times of {name!r} do not increase at sample {place}"
    named = {name: values for name in NAMES if (values := getattr(columns, name)) is not None}
    for name, values in (*named.items(), *columns.scalars.items(), *columns.arrays.items()):
        dimensions, needed = (2, "row") if name in columns.arrays else (1, "number")
        if np.ndim(values) != dimensions:
            yield f"{name!r} has the shape {np.shape(values)}, and one {needed} for each sample is needed"
        place, rows = ("`times`", columns.times[name]) if name in columns.times else ("t_s", columns.t_s)
        if len(values) != len(rows):
            behind = " for it" if name in columns.times else ""
            yield f"{name!r} has {len(values)} samples, and {place} has {len(rows)}{behind}"
    for finger in columns.fingers:
        if finger.name not in columns.scalars:
            yield f"`fingers` names {finger.name!r}, which is not in `scalars`"
    for name in sorted(columns.fast - columns.arrays.keys()):
        yield f"`fast` names {name!r}, which is not in `arrays`"
    for name, values in columns.arrays.items():
        yield from _misfits_of_shape(columns, name, values.shape[1])


def _misfits_of_shape(columns: GraspColumns, name: str, width: int) -> Iterator[str]:
    """Yield that a channel does not have the shape that `shapes` says, or needs one and has none."""
    shape = columns.shapes.get(name)
    own = name in columns.times
    if name in columns.fast and shape is None and not own and width > 1:
        yield (
            f"the fast channel {name!r} has {width} numbers a sample, which can be axes or samples: write "
            f"shapes={{{name!r}: (1, {width})}} for {width} axes, ({width}, 1) for {width} samples, or give the times "
            "of its own samples in `times`"
        )
    per_row = 1 if shape is None else (shape[1] if own and name in columns.fast else math.prod(shape))
    if shape is not None and per_row != width:
        yield f"{name!r} has {width} numbers a sample, and `shapes` says {' x '.join(map(str, shape))}"


def _within_ticks(columns: GraspColumns) -> GraspColumns:
    """Return the columns without the samples of fast channels that are outside of the times of the ticks.

    Raises DataDamaged if a channel with its own times has none within them.
    """
    arrays, times, notes = dict(columns.arrays), dict(columns.times), [*columns.notes]
    for name, time_s in columns.times.items():
        within = (time_s >= columns.t_s[0]) & (time_s <= columns.t_s[-1])
        if len(time_s) and not within.any():
            raise DataDamaged(
                f"{columns.source}: the times of {name!r} are {time_s[0]:g} to {time_s[-1]:g} s, and those of t_s "
                f"{columns.t_s[0]:g} to {columns.t_s[-1]:g} s: give both in seconds on one clock"
            )
        if name in columns.fast and not within.all():
            arrays[name], times[name] = arrays[name][within], time_s[within]
            notes.append(f"{int((~within).sum())} samples of {name} are before or after those of the gap")
    return evolve(columns, arrays=arrays, times=times, notes=tuple(notes))


def _time_steps(columns: GraspColumns, rate_hz: float | None) -> Numbers:
    """Return the time between samples (s), that of the first sample equal to the second's. Raises DataDamaged."""
    if len(columns) == 1 and rate_hz is not None:
        return np.array([1.0 / rate_hz])
    if len(columns) < 2:
        raise DataDamaged(f"{columns.source} has {len(columns)} samples; a grasp needs at least two")
    check_increasing(columns)
    steps = np.diff(columns.t_s)
    return np.concatenate((steps[:1], steps))


def check_increasing(columns: GraspColumns) -> None:
    """Raise DataDamaged with the sample at which the time does not increase."""
    wrong = np.flatnonzero(~(np.diff(columns.t_s) > 0.0))
    if len(wrong):
        k = int(wrong[0])
        t0, t1 = columns.t_s[k].item(), columns.t_s[k + 1].item()
        raise DataDamaged(
            f"{columns.source}, {columns.place(k + 1)}: the time goes from {t0!r} to {t1!r}; it must increase. "
            + _advice_on_times(columns)
        )


def _advice_on_times(columns: GraspColumns) -> str:
    """Return what to do about times that do not increase, as far as it would help: it is tried on these times."""
    t_s = columns.t_s
    split = 'If the rows come from several grasps, split the file by a column: split = "COLUMN"'
    steady = f"leave time out and write rate_hz = SAMPLES A SECOND. {split}"
    steps = np.diff(t_s)
    back = steps < 0.0
    if back.all():
        return "The rows are in the reverse order of time: turn them round"
    if back.any():
        moved = np.abs(np.diff(columns.gap_m)[back])
        goes_on = bool((moved <= GOES_ON * np.ptp(columns.gap_m)).all())
        return (
            f"The gap goes on there, as where a counter or a clock begins anew: {steady}"
            if goes_on
            else f'If a grasp begins there, write split = "time" in the manifest. {split}'
        )
    if not t_s[-1] > t_s[0]:
        return f"All {len(t_s)} rows have one time, as if it had been written with too few digits: {steady}"
    new = 1 + int((steps > 0.0).sum())
    lost = len(t_s) - new
    values = np.column_stack((columns.gap_m, columns.left_n, columns.right_n))
    same = steps == 0.0
    twice = not (same[1:] & same[:-1]).any() and bool((np.diff(values, axis=0)[same] == 0.0).all())
    if twice or lost <= LARGE_LOSS * len(t_s):
        return (
            f'If rows are repeated, write duplicates = "drop" in the manifest, which leaves out {lost} of {len(t_s)}. '
            + split
        )
    stamps, begins = np.unique(t_s, return_index=True)
    # The first stamp may have begun before the recording.
    whole = slice(1, None) if len(stamps) > 2 else slice(None)
    rate_hz = float(np.ptp(begins[whole]) / np.ptp(stamps[whole]))
    resolution = float(np.diff(stamps).min())
    return (
        f"The times are stamps with a resolution of {resolution:g} s, and {lost} of {len(t_s)} rows have that of the "
        f"row before, so no row is a repetition. If the rows were taken at a steady rate, leave out time and write "
        f"rate_hz = {rate_hz:.3g}"
    )


def _check_complete(columns: GraspColumns) -> None:
    for what, values in _needed(columns).items():
        missing = np.flatnonzero(~np.isfinite(values))
        if len(missing) == len(values):
            raise DataDamaged(f"{columns.source}: the {what} has no number")
        if len(missing):
            place = columns.place(int(missing[0]))
            raise DataDamaged(f"{columns.source}, {place}: the {what} is missing or infinite")


def _check_plausible(columns: GraspColumns, quantity: str, unit_of: str, values: Numbers | None) -> None:
    """Raise DataDamaged if a value is far from those of any gripper, as it is in another unit."""
    if columns.units.get(unit_of, "") or values is None:
        return
    low, high, unit, others = PLAUSIBLE[quantity]
    worst = int(np.argmax(np.maximum(values - high, low - values)))
    extreme = float(values[worst])
    if low <= extreme <= high:
        return
    beyond = np.count_nonzero((values < low) | (values > high)) / len(values)
    if beyond <= GLITCHES:
        raise DataDamaged(
            f"{columns.source}, {columns.place(worst % len(columns))}: the {quantity} is {extreme:g} {unit} there, "
            f"which no gripper has, and plausible in {100 * (1.0 - beyond):.1f} % of the samples: leave out what is no "
            "measurement"
        )
    advice = [
        f"in {unit}, write its unit behind it: [{unit}]"
        for unit, f in others.items()
        if low <= f * extreme <= high
    ]
    advice = advice[:1] or ["in another unit, multiply it by its factor"]
    if quantity == "force":
        advice += ["in counts [counts]"]
        advice += ["in gram-force [gf]"] if bool((values == np.round(values)).all()) else []
    raise DataDamaged(
        f"{columns.source}: the {quantity} reaches {extreme:g} {unit}, which no gripper has. Plausible is "
        f"{low:g} to {high:g} {unit}. If the column is {', '.join(advice)}"
    )


def _units(units: Mapping[str, str]) -> dict[str, str]:
    """Return the units of the channels of a frame that are not SI units."""
    t, gap, force = units.get("t", ""), units.get("gap", ""), units.get("force", "")
    named = {"t": t, "gap": gap, "velocity": f"{gap or 'm'}/{t or 's'}" if gap or t else ""}
    named |= dict.fromkeys(("force_left", "force_right"), force)
    return {name: unit for name, unit in named.items() if unit}


def _channels(columns: GraspColumns) -> tuple[Channel, ...]:
    fingers = {finger.name: finger for finger in columns.fingers}
    scalars = [fingers.get(name) or Channel(name, columns.units.get(name, "1")) for name in columns.scalars]
    return (*scalars, *(_array(columns, name, values) for name, values in columns.arrays.items()))


def _array(columns: GraspColumns, name: str, values: Numbers) -> Channel:
    """Return the tactile array or the fast channel that several columns are."""
    width = values.shape[1]
    shape = columns.shapes.get(name, (1, width))
    down, across, components = shape if len(shape) > 2 else (*shape, 1)
    if name not in columns.fast:
        unit = columns.units.get(name, "counts")
        return TactileArray(name, unit, finger=name, rows=down, columns=across, components=components)
    across *= components
    if name in columns.times:
        samples, axes = max(most_in_a_tick(columns.t_s, columns.times[name]), 1), width
    else:
        samples, axes = down, across
    names = {1: ("value",), 2: ("x", "y"), 3: ("x", "y", "z")}.get(axes) or [f"axis_{k}" for k in range(axes)]
    t_s = columns.times.get(name, columns.t_s)
    a_row = 1 if name in columns.times else samples
    rate_hz = a_row / float(np.median(np.diff(t_s))) if len(t_s) > 1 else 0.0
    return FastChannel(name, columns.units.get(name, "1"), rate_hz, samples=samples, axes=tuple(names))


def _readings(
    columns: GraspColumns, steps: Numbers, velocities: Numbers, channels: Sequence[Channel]
) -> list[Reading]:
    n = len(columns)
    absent = [math.nan] * n
    efforts = absent if columns.effort_n is None else columns.effort_n.tolist()
    times = columns.t_s.tolist()
    every = (*columns.scalars.values(), *columns.arrays.values())
    series = [
        values_in_ticks(columns.t_s, columns.times.get(channel.name), values, channel)
        for channel, values in zip(channels, every, strict=True)
    ]
    frames = zip(
        times, steps.tolist(), columns.gap_m.tolist(), velocities.tolist(), efforts, columns.left_n.tolist(),
        columns.right_n.tolist(), absent, absent, [0] * n, strict=True,
    )  # fmt: skip
    signals = signals_in_ticks(channels, series, n)
    return [Reading(Frame(*frame), NO_PADS, own) for frame, own in zip(frames, signals, strict=True)]
