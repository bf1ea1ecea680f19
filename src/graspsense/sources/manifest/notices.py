"""What looks wrong in the columns of a grasp, each with the option that mends it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

import numpy as np

from graspsense.core.values.errors import DataDamaged
from graspsense.sources.grasp_columns import GraspColumns
from graspsense.sources.manifest.steps import squeezes

if TYPE_CHECKING:
    from graspsense.sources.grasp_columns import Numbers

BEGINS_LOADED: Final = 0.25
"""Share of its range above which the force of the first sample is that of a contact, or of a wrong zero."""
JUMP: Final = 20.0
"""A time step of so many usual ones is a jump."""
MILLIMETRES: Final = 0.5
"""A gap beyond this (m) is in another unit."""
ZERO_SAMPLES: Final = 10
NOISE: Final = 6.0
"""A force whose range is at most so many usual second differences is noise alone."""
STEADY: Final = 0.1
"""Share of its range by which the force may change in the samples that a zero is taken from."""
_OFFSET: Final = ' If the fingers were free, the sensor has an offset: zero = "10 samples"'
_FOUND: Final = 'split = "force" finds them, '


def notices_of(columns: GraspColumns, *, zeroed: bool) -> Iterator[str]:
    """Yield a sentence for each thing that looks wrong; `zeroed`: the zero of the forces is from the first samples."""
    yield from columns.warnings
    if len(columns) < 2:
        return
    force, gap = columns.force_n, columns.gap_m
    low, high, start = float(force.min()), float(force.max()), float(force[0])
    peak, felt = int(force.argmax()), _is_felt(force)
    if felt and abs(low) > abs(high) and low < 0.0:
        yield "the force is negative where it is largest: is it a pull? Turn its sign: -FORCE"
    moved, span = float(gap[peak] - gap[0]), float(np.ptp(gap))
    if span == 0.0 and not columns.units.get("gap"):
        yield "the gap does not change during the recording: is it another column?"
    if span > 0.0 and moved > 0.2 * span:
        yield (
            "the gap rises while the force rises: is it a position that grows on closing? Write the gap as a "
            f'difference: gap = "{_opening(gap):g} - POSITION"'
        )
    if not columns.units.get("gap") and float(np.abs(gap).max()) > MILLIMETRES:
        yield 'the gap is too large for metres: if it is in millimetres, write gap = "COLUMN [mm]"'
    if not columns.units.get("force"):
        pads = np.concatenate((columns.left_n, columns.right_n))
        if high - low > 20.0 and bool((pads == np.round(pads)).all()):
            yield (
                "the forces are whole numbers, as counts of a sensor are: give a factor to newtons, or write "
                'force = "COLUMN [counts]", or [gf] for the grams of a scale'
            )
    if _falls_on_contact(columns):
        yield (
            "the force falls while the gap closes: does the sensor fall on contact? Turn its sign and write its zero: "
            'force = "-FORCE" and zero = "10 samples", or force = "999 - FORCE" where 999 is its value without contact'
        )
    elif felt and start - low > BEGINS_LOADED * (high - low):
        if zeroed:
            yield (
                "the recording begins in contact, so the zero of its first samples removes a part of the force: leave "
                "zero out, and subtract the known zero of the sensor"
            )
        else:
            yield (
                "the recording begins in contact: there is no approach, so features from before the contact are "
                "missing." + _OFFSET * _is_steady(force)
            )
    elif not zeroed and high > low and abs(start) > BEGINS_LOADED * (high - low) and _is_steady(force):
        yield 'the force does not begin at zero: if the fingers were free then, write zero = "10 samples"'
    steps = np.diff(columns.t_s)
    usual = float(np.median(steps))
    if float(steps.max()) > JUMP * usual > 0.0:
        yield (
            f"the time jumps by more than {JUMP:g} usual steps: does the file hold several grasps? "
            + _FOUND * _has_several_squeezes(columns)
            + 'split = "COLUMN" splits it by a column'
        )


def _falls_on_contact(columns: GraspColumns) -> bool:
    """Return whether a force in counts is steady at first and then falls by most of its range as the gap closes."""
    force, gap = columns.force_n, columns.gap_m
    fall, span = float(force[0] - force.min()), float(np.ptp(force))
    closed = float(gap[0] - gap[int(force.argmin())])
    falls = fall > (1.0 - STEADY) * span > 0.0 and closed > 0.5 * float(np.ptp(gap)) > 0.0
    return bool(columns.units.get("force")) and falls and _is_steady(force)


def _is_felt(force: Numbers) -> bool:
    """Return whether a force leaves its noise: what noise looks like is neither a pull nor a contact."""
    noise = float(np.median(np.abs(np.diff(force, 2)))) if len(force) > 2 else 0.0
    return float(np.ptp(force)) > NOISE * noise


def _is_steady(force: Numbers) -> bool:
    """Return whether the first samples have one force, so that a zero can be taken from them."""
    return float(np.ptp(force[:ZERO_SAMPLES])) <= STEADY * float(np.ptp(force))


def _has_several_squeezes(columns: GraspColumns) -> bool:
    try:
        return len(squeezes(columns)) > 1
    except DataDamaged:
        return False


def _opening(position: Numbers) -> float:
    """Return an opening (m) from which a position can be subtracted, in steps of 0.1 m."""
    return max(1, math.ceil(float(position.max()) * 10.0)) / 10.0
