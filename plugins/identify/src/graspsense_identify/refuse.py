"""What the recordings do not determine, and what would determine it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from graspsense.simulator_api import SqueezeFit, Undetermined, repeatability
from graspsense_identify.fit import Fitted
from graspsense_identify.laws import MAXWELL, SNAP
from graspsense_identify.parts import LEAST_INSTANCES
from graspsense_identify.prepare import BREAK_SHARE, Squeeze
from graspsense_identify.share import Shares
from graspsense_identify.spread import Uncertainty

CONFIRMS: Final = 0.1
"""A held-out squeeze that is predicted to this share of its peak confirms the object, and so does one that is predicted
as closely as the squeezes are alike (`repeatability`)."""
LEAST_HOLD_S: Final = 0.2
"""A shorter hold shows no relaxation."""
SPEED_RATIO: Final = 2.0
"""Squeezes whose speeds differ by this factor show a memory without a hold."""
WIDE: Final = 4.0
"""A parameter whose interval spans this factor is not determined."""
HOLD_TIMES: Final = 5.0
"""A hold of this many relaxation times determines one."""

PADS_DIFFER: Final = 0.2
"""Share of the largest force by which the forces on both pads may differ."""
ONE_KIND: Final = math.log(1.5)
"""Standard deviation of the logarithm of the stiffness from which on objects hardly are of one kind."""
FALL_SHARE: Final = 0.25
"""A fall of the force by this share of the peak between two samples needs a term of its own."""

_REMEDIES: Final = {
    "k1_n_m": "squeeze deeper",
    "k3_n_m3": "squeeze deeper",
    "exponent": "squeeze deeper",
    "critical_m": "squeeze beyond the drop of the force",
    "drop_n": "squeeze beyond the drop of the force",
    "fall_m": "squeeze beyond the drop of the force, more slowly",
    "k2_n_m": "squeeze deeper beyond the drop of the force",
    "damping_n_s_m": "squeeze at two speeds that differ by a factor of two or more",
}


def shows_memory(squeezes: Sequence[Squeeze]) -> bool:
    """Return whether the squeezes can determine a term with a memory: by a hold, or by different speeds."""
    if any(squeeze.stretches.hold_s >= LEAST_HOLD_S for squeeze in squeezes):
        return True
    speeds = [squeeze.stretches.speed_m_s for squeeze in squeezes if squeeze.stretches.speed_m_s > 0.0]
    return bool(speeds) and max(speeds) >= SPEED_RATIO * min(speeds)


def undetermined(fitted: Fitted, intervals: Uncertainty, shares: Shares) -> Iterator[Undetermined]:
    """Yield what these squeezes leave open. `shares`: those of the force that cells measure."""
    squeezes = fitted.squeezes
    if not shows_memory(squeezes):
        load_s = max(squeeze.stretches.load_s for squeeze in squeezes)
        yield Undetermined(
            what="relaxation (maxwell, loss)",
            reason=f"a ramp only, of {load_s:.2g} s at one speed, shows no relaxation time",
            remedy="hold for 5 s, or squeeze at two speeds that differ by a factor of two or more",
        )
    apart = max(squeeze.pad_difference for squeeze in squeezes)
    if apart > PADS_DIFFER:
        yield Undetermined(
            what="the force on the object",
            reason=f"those on the two pads differ by up to {100 * apart:.0f} % of the largest one: a pad is dead or "
            "has another scale, or one finger touches an object that is fixed off the centre before the other",
            remedy="look at the pads, and centre the object, or let it stand free",
            in_scene=True,
        )
    yield from _parameters(fitted, intervals)
    yield from _falls(fitted)
    yield from _spreads(intervals, squeezes)
    if shares.has_cells and not len(shares.known):
        yield Undetermined(
            what="share",
            reason="the cells measure a share of the force, and the effort of the drive is not recorded",
            remedy="record the effort, or weigh the object's contact with a force gauge",
        )
    if not all(squeeze.stretches.has_approach for squeeze in squeezes):
        yield Undetermined(
            what="width_m",
            reason="a recording begins in contact: where the contact was follows from the law alone",
            remedy="record from before the contact",
            in_scene=True,
        )


def refusals(
    open_: Sequence[Undetermined], fits: Sequence[SqueezeFit], held_out: Sequence[float]
) -> tuple[str, ...]:
    """Return why a scene is not to be used: figures that are not determined, or no squeeze that confirms it.

    `held_out`: the errors of the squeezes predicted from others; none for a single one, which is judged by its fit.
    """
    reasons = [
        f"{part.what} is not determined: {part.reason}; {part.remedy}" for part in open_ if part.in_scene
    ]
    errors = held_out or [fit.residual for fit in fits]
    limit = max(CONFIRMS, repeatability(fits)) if held_out else CONFIRMS
    if not min(errors) <= limit:
        what = "held-out squeeze" if held_out else "squeeze"
        reasons.append(
            f"no {what} confirms the scene: the closest is predicted to {100.0 * min(errors):.1f} % of its peak, and "
            f"{100.0 * limit:.1f} % are needed"
        )
    return tuple(reasons)


def _falls(fitted: Fitted) -> Iterator[Undetermined]:
    """Yield the falls of the force that are too small for a break, if no term of the candidate describes them."""
    forces = []
    for squeeze in fitted.squeezes:
        drops = -np.diff(squeeze.force_n[squeeze.loading])
        if len(drops) and float(np.max(drops)) > FALL_SHARE * squeeze.peak_n:
            forces.append(float(squeeze.force_n[int(np.argmax(drops))]))
    if forces and SNAP not in fitted.candidate.slots:
        total = len(fitted.squeezes)
        yield Undetermined(
            what="a fall of the force",
            reason=f"the force falls by more than {100 * FALL_SHARE:.0f} % of the peak in {len(forces)} of {total} "
            f"squeezes (at {min(forces):.3g} to {max(forces):.3g} N) while the fingers close. It is neither a break (a "
            f"fall by {100 * BREAK_SHARE:.0f} % at once) nor described by a snap",
            remedy='cut the recordings there (cut = "rupture" in a manifest), or squeeze more slowly, so that the '
            "fall has several measurements",
        )


def _parameters(fitted: Fitted, uncertainty: Uncertainty) -> Iterator[Undetermined]:
    """Yield the parameters whose intervals are wide, or which are at the end of their range."""
    hold_s = max(squeeze.stretches.hold_s for squeeze in fitted.squeezes)
    depth_mm = 1e3 * max(squeeze.depth_m for squeeze in fitted.squeezes)
    for i, parameter in enumerate(fitted.candidate.free):
        at_bound = fitted.at_bound(i)
        if not at_bound and uncertainty.high[i] <= WIDE * uncertainty.low[i]:
            continue
        interval = f"its 90 % interval is {uncertainty.low[i]:.3g} to {uncertainty.high[i]:.3g}"
        remedy = _REMEDIES.get(parameter.name, "record more squeezes")
        if parameter.slot == MAXWELL:
            needed = max(HOLD_TIMES * fitted.by_label["maxwell.tau_s"], 2.0 * hold_s)
            remedy = f"hold for {needed:.2g} s (the longest hold is {hold_s:.2g} s)"
        elif "deeper" in remedy:
            remedy += f" (the deepest is {depth_mm:.2g} mm)"
        yield Undetermined(
            what=parameter.label,
            reason="the fit is at the end of the range" if at_bound else interval,
            remedy=remedy,
            in_scene=True,
        )


def _spreads(uncertainty: Uncertainty, squeezes: Sequence[Squeeze]) -> Iterator[Undetermined]:
    """Yield the spreads that so many objects and squeezes do not show."""
    if math.isnan(uncertainty.stiffness.objects):
        number = len({squeeze.instance for squeeze in squeezes if squeeze.instance})
        objects = {0: "objects without numbers", 1: "one object"}.get(number, f"{number} objects")
        yield Undetermined(
            what="spread between objects",
            reason=f"the recordings are of {objects}",
            remedy=f"record {LEAST_INSTANCES} objects or more, labelled cup#1, cup#2, cup#3",
        )
    depth_m = float(np.median([squeeze.depth_m for squeeze in squeezes]))
    if uncertainty.stiffness.whole > ONE_KIND or uncertainty.width_m.whole > depth_m:
        yield Undetermined(
            what="whether the recordings are of one kind of object, in one unit",
            reason=f"from squeeze to squeeze the stiffness differs by a factor of "
            f"{math.exp(uncertainty.stiffness.whole):.2g} (one standard deviation), and the width by "
            f"{1e3 * uncertainty.width_m.whole:.2g} mm",
            remedy="identify objects of different kinds apart, and compare the units of the recordings",
            in_scene=True,
        )
    if len(squeezes) == 1:
        yield Undetermined(
            what="spread between squeezes",
            reason="there is a single squeeze; its intervals hold for it alone",
            remedy="record the same object three times or more, and put it down anew each time",
        )
