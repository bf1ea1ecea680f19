"""How stiff the contact of an object is over a tick: the object is compressed slowly, up to the force of a grasp."""

from __future__ import annotations

from math import isfinite
from typing import Final, NamedTuple

from graspsense.gripper_api import gap_and_rate, revolutions_at
from graspsense_sim_gripper.run.accuracy.levels import MAX_BALANCE_RTOL
from graspsense_sim_gripper.run.build import Problem
from graspsense_sim_gripper.run.compiled.compose import contact_solver, hardens, uncompressed

FORCE_N: Final = 20.0
SPEED_M_S: Final = 0.01
"""The gripping force and the closing speed that are assumed without other information: those of the paper (Chitta,
Piccoli and Sturm, ICRA 2010)."""
FIRST_M: Final = 1e-6
GROWTH: Final = 1.5
"""The first closure, and the ratio of each closure to the one before."""
POINT_S: Final = 0.1
"""Duration of each step from one closure to the next: what relaxes during a squeeze has relaxed."""
FURTHER: Final = 0.1
"""The share of a closure by which the fingers go further within a tick."""
MAX_DEPTH: Final = 0.9
"""No object is compressed by more than this share of its width."""


class Grip(NamedTuple):
    """What a grasp of the nominal object is expected to meet."""

    force_n: float
    mass_kg: float
    """The mass that moves with the gap: the inertia of the rotor through the linkage."""
    stiffness_n_m: float
    """The largest stiffness over a tick: the force after a further motion within a tick, less that after a tick at
    rest, over this motion."""
    touch_n_m: float
    """The stiffness at the first touch, where rigid pads meet the surface of the object alone."""


def grip_of(problem: Problem, force_n: float = FORCE_N) -> Grip:
    """Return what a grasp with this peak force (N) meets. Raises TypeError if there is no object."""
    setup = problem.nominal
    drive, model = setup.plant.drive, setup.plant.object
    # Only orders of magnitude follow from the forces, so their balance need not be that of a reference.
    model = model._replace(balance_rtol=MAX_BALANCE_RTOL)
    press, untouched = contact_solver(setup.kinds, hardens(model)), uncompressed(setup.kinds)
    contact, last_closure, closure, largest = untouched, 0.0, FIRST_M, 0.0
    while closure < MAX_DEPTH * model.width_m and contact.force_n < force_n:
        contact, _ = press(model, contact, closure, (closure - last_closure) / POINT_S, POINT_S)
        rests, further = (
            press(model, contact, closure * share, 0.0, setup.dt_s)[0].force_n
            for share in (1.0, 1.0 + FURTHER)
        )
        rise = (further - rests) / (FURTHER * closure)
        if isfinite(rise):  # a law without a finite force ends the grasp, with its own reason
            largest = max(largest, rise)
        last_closure, closure = closure, GROWTH * closure
    touch, _ = press(model, untouched, FIRST_M, 0.0, 0.0)
    _, jacobian = gap_and_rate(
        drive.link, revolutions_at(drive.link, min(max(model.width_m, 0.0), problem.config.open_gap_m))
    )
    return Grip(
        force_n=force_n,
        mass_kg=drive.inertia / (jacobian * jacobian),
        stiffness_n_m=largest,
        touch_n_m=touch.force_n / FIRST_M,
    )
