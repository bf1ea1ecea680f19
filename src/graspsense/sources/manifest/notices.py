"""What looks wrong in the columns of a grasp, each with the option that mends it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

import numpy as np

from graspsense.core.control.contact import CONTACT_FORCE_N, both_touch
from graspsense.core.values.errors import DataDamaged
from graspsense.sources.columns.channel_facts import usual_range
from graspsense.sources.columns.grasp_columns import GraspColumns
from graspsense.sources.columns.recording_notices import FEWEST, PART, ZERO_SAMPLES, force_of_pads
from graspsense.sources.manifest.closings import CLOSED, OPEN
from graspsense.sources.manifest.steps import NOISE, squeezes
from graspsense.sources.manifest.turns import apart

if TYPE_CHECKING:
    from graspsense.sources.formats.table import Numbers
    from graspsense.sources.manifest.description import Manifest

BEGINS_LOADED: Final = 0.25
"""Share of its range above which the force of the first sample is that of a contact, or of a wrong zero."""
JUMP: Final = 20.0
"""A time step of so many usual ones is a jump."""
HOLE: Final = 5.0
HOLE_S: Final = 0.05
HOLE_FORCE: Final = 0.2
"""A step of so many usual ones, and so long, is a hole under this share of the force, or where the force changes so."""
SHORTEST_S: Final = 0.1
"""No grasp is shorter (s)."""
FASTER: Final = 0.4
SAME: Final = 0.15
"""Logarithm of the rates of a clock that are different, and share by which fingers that go on move otherwise."""
RISES: Final = 0.1
FEWEST_RISING: Final = 8
"""Share of its first rise that a force makes in the second quarter of the time of that, also one of a soft object, and
fewest samples that show it."""
OFFSET: Final = 0.05
"""Share of the range of a pad that its force may have without contact."""
WEAK_N: Final = 0.02
STRONG_N: Final = 300.0
"""A force whose range is not between those of the usual grippers is in another unit."""
WIDEST_M: Final = 5e-4
"""No gripper opens less (m)."""
NO_GLITCH: Final = 0.05
"""Share of the samples with closed, and with open fingers, from which on these are no glitches of the gap."""
TURNED: Final = 0.3
"""Share of its range by which a force is less with closed fingers than with open ones if its sign is turned."""
MEET_M: Final = 5e-4
"""Fingers that press in a smaller gap press on each other,"""
BELOW_ZERO_M: Final = -0.005
"""and no fingertips are pressed into each other so far (m)."""
_OFFSET: Final = ' If the fingers were free, the sensor has an offset: zero = "10 samples"'
_FOUND: Final = 'split = "force" finds them, '


def notices_of(columns: GraspColumns, keys: Manifest) -> Iterator[str]:
    """Yield a sentence for each thing that looks wrong in the columns of a manifest with these keys."""
    yield from columns.warnings
    if len(columns) < 2:
        return
    pulls = list(_of_sign(columns))
    if not pulls and columns.units.get("force") and _is_steady(columns.force_n):
        pulls = [*filter(None, [falls_on_closing(columns)])]
    yield from pulls
    if not columns.units.get("force"):
        yield from _of_unit(columns)
    if not pulls:
        yield from _of_gap(columns)
        yield from _of_zero(columns, zeroed=bool(keys.zero))
    yield from _of_time(columns, divided=keys.split == "force")
    if _is_felt(columns.force_n):
        yield from _of_holes(columns)
        if not {"t", "gap"} & {name for name, unit in columns.units.items() if unit}:
            yield from apart(columns.t_s, columns.gap_m, columns.force_n)


def falls_on_closing(columns: GraspColumns) -> str:
    """Return a sentence if the force of a pad is less where the fingers are closed than where they are open.

    Without a gap, if it is negative where it is largest by far.
    """
    gap = columns.gap_m
    known = np.isfinite(gap) & np.isfinite(columns.force_n)
    low, high = usual_range(gap[known]) if known.any() else (0.0, 0.0)
    closed, free = known & (gap < low + CLOSED * (high - low)), known & (gap > low + OPEN * (high - low))
    # Of several objects, the widest may be held where the fingers are open for the others.
    widest = free & (gap >= np.quantile(gap[known], 1.0 - NO_GLITCH)) if free.any() else free
    for name, pad in force_of_pads(columns.left_n, columns.right_n).items():
        if not known.any() or not _is_felt(pad[known]):
            continue
        least, most = usual_range(pad[known])
        if min(closed.mean(), free.mean()) > NO_GLITCH:
            turned = float(np.median(pad[closed]) - np.median(pad[widest])) < -TURNED * (most - least)
        else:
            turned = least < -2.0 * abs(most) and 2.0 * abs(float(pad[known][:ZERO_SAMPLES].mean())) < -least
        if turned:
            return (
                f"{name} falls where the fingers close. Turn its sign and write its zero (-FORCE and zero = "
                '"10 samples", or 999 - FORCE), or turn that of a position that grows on closing: gap = "OPENING - '
                'POSITION"'
            )
    return ""


def _of_gap(columns: GraspColumns) -> Iterator[str]:
    gap = columns.gap_m
    began = float(np.median(gap[:3]))  # the first sample can be from before the sensor was ready
    force, span = columns.force_n, float(np.ptp(gap))
    pressed = float(gap[int(force.argmax())])
    touched = float(gap[int((force > force.min() + BEGINS_LOADED * np.ptp(force)).argmax())])
    if span == 0.0 and not columns.units.get("gap"):
        yield "the gap does not change during the recording: is it another column?"
    if span > 0.0 and gap.min() > 0.0 and gap.max() < WIDEST_M and not columns.units.get("gap"):
        yield (
            f"the gap reaches {gap.max() * 1e3:.2g} mm only, which no gripper opens to: if it is in another unit, "
            "write that behind it, as [m] or [mm]"
        )
    meets = pressed < MEET_M and touched < gap.max() and _is_felt(force)
    if (meets or gap.min() < BELOW_ZERO_M) and gap.max() > 0.0 and not columns.units.get("gap"):
        yield (
            f"the gap goes down to {gap.min() * 1e3:.3g} mm, and fingers meet at 0: did they press on each other, or "
            'is it measured from another zero? Then add the difference: gap = "POSITION + 20 [mm]"'
        )
    if span > 0.0 and (pressed - began > 0.2 * span or pressed - touched > PART * span):
        yield (
            "the gap rises while the force rises: is it a position that grows on closing? Write the gap as a "
            f'difference: gap = "{max(1, math.ceil(float(gap.max()) * 10.0)) / 10.0:g} - POSITION"'
        )


def _of_unit(columns: GraspColumns) -> Iterator[str]:
    """Yield what tells that forces called newtons are in another unit."""
    pads = np.concatenate((columns.left_n, columns.right_n))
    low, high = usual_range(columns.force_n)
    if high - low > 20.0 and bool((pads == np.round(pads)).all()):
        yield (
            "the forces are whole numbers, as counts of a sensor are: give a factor to newtons, or write "
            'force = "COLUMN [counts]", or [gf] for the grams of a scale'
        )
    elif not WEAK_N < high - low < STRONG_N and _is_felt(columns.force_n):
        yield (
            f"the force reaches {high:.4g} N, which few grippers have: if it is in another unit, write that behind "
            "it, as [gf] for the grams of a scale, [mN], [kN] or [counts]"
        )


def _of_sign(columns: GraspColumns) -> Iterator[str]:
    """Yield that a force is negative where it is largest, and not all along."""
    low, high = usual_range(columns.force_n)
    for name, pad in force_of_pads(columns.left_n, columns.right_n).items():
        least, most = usual_range(pad)
        loaded = least < -OFFSET * (high - low) and abs(least) > abs(most)
        if _is_felt(pad) and loaded and 2.0 * abs(float(pad[:ZERO_SAMPLES].mean())) < abs(least):
            yield f"{name} is negative where it is largest: is it a pull? Turn its sign: -FORCE"


def _of_zero(columns: GraspColumns, *, zeroed: bool) -> Iterator[str]:
    """Yield what looks wrong in the zero of the forces, and whether a contact was before."""
    force = columns.force_n
    low, high = usual_range(force)
    felt = _is_felt(force)
    steady, begins = _is_steady(force), (float(columns.left_n[0]), float(columns.right_n[0]))
    touched = not columns.units.get("force") and both_touch(*begins, CONTACT_FORCE_N)
    wider = columns.gap_m > columns.gap_m[0] + PART * np.ptp(columns.gap_m)
    free, least = (float(np.median(force[wider])), PART) if wider.any() else (low, BEGINS_LOADED)
    loaded = force[0] - free > least * (high - low) or (touched and not steady)
    if felt and (loaded or _rises_at_first(force)):
        if zeroed:
            yield (
                "the recording begins in contact, so the zero of its first samples removes a part of the force: leave "
                "zero out, and subtract the known zero of the sensor"
            )
        else:
            yield (
                "the recording begins in contact: there is no approach, so features from before the contact are "
                "missing, and a zero that was set there takes a part of all forces."
                + _OFFSET
                * (loaded and steady)
            )
    elif not zeroed:
        for name, pad in force_of_pads(columns.left_n, columns.right_n).items():
            least, most = usual_range(pad)
            offset = abs(float(pad[:ZERO_SAMPLES].mean()))
            if _is_felt(pad) and _is_steady(pad) and offset > OFFSET * (most - least):
                yield f'{name} does not begin at zero: if the fingers were free then, write zero = "10 samples"'


def _rises_at_first(force: Numbers) -> bool:
    """Return whether a force rises from the first sample on, so that none is of free fingers.

    It rises already in the first quarters of the time until it reaches a `PART` of its range.
    """
    low, high = usual_range(force)
    reached = int((force > low + PART * (high - low)).argmax())
    if reached < FEWEST_RISING:
        return False
    begin, later = (float(part.mean()) for part in np.array_split(force[:reached], 4)[:2])
    noise = float(np.median(np.abs(np.diff(force, 2)))) * math.sqrt(4.0 / reached)
    return later - begin > max(NOISE * noise, RISES * PART * (high - low))


def _of_time(columns: GraspColumns, *, divided: bool) -> Iterator[str]:
    steps = np.diff(columns.t_s)
    usual = float(np.median(steps))
    lasts_s = float(columns.t_s[-1] - columns.t_s[0])
    if not columns.units.get("t") and len(columns) >= FEWEST and 0.0 < lasts_s < SHORTEST_S:
        yield (
            f"the recording lasts {lasts_s * 1e3:.2g} ms only: if the time is not in s, write its unit behind it, or a "
            "factor that makes it seconds"
        )
    if not any(columns.units.get(name) for name in ("t", "gap")):
        yield from _of_rate(columns.t_s, columns.gap_m)
    several = not divided and _is_felt(columns.force_n) and _has_several_squeezes(columns)
    if float(steps.max()) > JUMP * usual > 0.0:
        yield (
            f"the time jumps by more than {JUMP:g} usual steps: was the clock set, or are there several grasps? "
            + _FOUND * several
            + 'split = "COLUMN" splits it by a column'
        )
    elif several:
        yield f"there are several squeezes, and the features are of the first: {_FOUND}one grasp each"


def _of_rate(t_s: Numbers, gap: Numbers) -> Iterator[str]:
    """Yield that a clock goes on at another rate: fingers that go on as before, by the samples, change their speed."""
    n = ZERO_SAMPLES
    if len(t_s) < 4 * n:
        return
    ratio = np.log((t_s[2 * n :] - t_s[n:-n]) / (t_s[n:-n] - t_s[: -2 * n]))
    earlier, later = gap[n:-n] - gap[: -2 * n], gap[2 * n :] - gap[n:-n]
    noise = NOISE * float(np.median(np.abs(np.diff(gap, 2))))
    k = int(np.abs(ratio).argmax())
    if abs(ratio[k]) > FASTER and abs(later[k] - earlier[k]) + noise < SAME * abs(earlier[k]):
        yield (
            f"from {t_s[k + n]:.4g} s on, samples are {math.exp(ratio[k]):.2g} times as far apart, and the fingers "
            "move as much from one to the next: did the clock go wrong? Then leave time out and write rate_hz"
        )


def _of_holes(columns: GraspColumns) -> Iterator[str]:
    """Yield that there are no samples for a while under a load, or while the force changes by much."""
    steps, force, t = np.diff(columns.t_s), columns.force_n, columns.units.get("t") or "s"
    low, high = usual_range(force)
    felt = force > low + HOLE_FORCE * (high - low)
    changes = np.abs(np.diff(force)) > HOLE_FORCE * np.ptp(force)
    missed = np.flatnonzero(
        (changes | (felt[1:] & felt[:-1]))
        & (steps > HOLE * np.median(steps))
        & ((steps > HOLE_S) | (t != "s"))
    )
    for k in missed[:1].tolist():
        begin, end = columns.t_s[k : k + 2].tolist()
        yield (
            f"there are no samples from {begin:.4g} to {end:.4g} {t}, and the force changes from {force[k]:.3g} to "
            f"{force[k + 1]:.3g} {columns.units.get('force') or 'N'}: a contact or a rest in this time is seen too late"
        )


def _is_felt(force: Numbers) -> bool:
    """Return whether a force leaves its noise: what noise looks like is neither a pull nor a contact."""
    noise = float(np.median(np.abs(np.diff(force, 2)))) if len(force) > 2 else 0.0
    return float(np.ptp(force)) > NOISE * noise


def _is_steady(force: Numbers) -> bool:
    """Return whether the first samples have one force, so that a zero can be taken from them."""
    return float(np.ptp(force[:ZERO_SAMPLES])) <= PART * float(np.ptp(force))


def _has_several_squeezes(columns: GraspColumns) -> bool:
    try:
        return len(squeezes(columns)) > 1
    except DataDamaged:
        return False
