"""Compressing an object along prescribed paths, to find how stiff and how damped its contact is.

There are two paths: closing as fast as the gripping force can accelerate the fingers, and closing over the longest
duration of a squeeze.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Final

from attrs import frozen

from graspsense_sim_gripper.plant.contact import ObjectModel
from graspsense_sim_gripper.run.accuracy.levels import MAX_BALANCE_RTOL
from graspsense_sim_gripper.run.compiled.compose import contact_solver, hardens, uncompressed
from graspsense_sim_gripper.scene.terms.term import WorkingPoint

HOLD_S: Final = 1.0
"""Duration of the hold at a working point."""
SQUEEZE_S: Final = 3.0
"""The longest duration of a squeeze: controllers give up after it."""
POINTS: Final = 24
"""Number of equal steps of a closing path."""
SEARCH_POINTS: Final = 12
"""The same where only the end of the path counts."""
EARLY_POINTS: Final = 3
"""Number of further points within the first of these steps, to resolve the beginning of the contact."""
MIN_SPEED_M_S: Final = 1e-4
"""Slower contacts are probed at this speed."""
MAX_DEPTH: Final = 0.9
"""No object is compressed by more than this share of its width."""
MAX_WALKS: Final = 40
DEPTH_RTOL: Final = 0.02
FURTHER: Final = 1.01
MOST_FURTHER: Final = 4.0
"""The depth for a force is searched by walks, at most this many. Each goes a little further than where the last one
reached the force, or by the missing share of the force, but by no more than the last factor, where it did not. The
search ends when the depth changes by less than the tolerance."""
MIN_FORCE_N: Final = 1.0
"""A path that reaches less than this is lengthened as if it reached it."""


@frozen(kw_only=True)
class ProbePath:
    """A motion of the fingers after the contact, as points of equal number in each tuple."""

    closures: tuple[float, ...]
    """By how much the gap is smaller than the width of the object (m)."""
    times: tuple[float, ...]
    """Since the contact (s)."""
    speeds: tuple[float, ...]
    """Closing speed (m/s)."""


class Grip:
    """An object and its probe paths, which do not depend on the accuracy.

    `point` is the working point that the paths reach. `force_n` is the gripping force, `speed_m_s` the speed of the gap
    at the first contact, and `mass_kg` the mass that moves with the gap.
    """

    def __init__(
        self, model: ObjectModel, kinds: tuple[str, ...], force_n: float, speed_m_s: float, mass_kg: float
    ) -> None:
        # Only orders of magnitude follow from the forces, so their balance need not be that of a reference.
        self.model, self.kinds = model._replace(balance_rtol=MAX_BALANCE_RTOL), kinds
        self.mass_kg = mass_kg
        self.fast, self.slow, self.point = _paths(
            self.model, kinds, force_n, max(speed_m_s, MIN_SPEED_M_S), mass_kg
        )


def forces_along(model: ObjectModel, kinds: Sequence[str], path: ProbePath) -> Iterator[float]:
    """Yield the force (N) at each point of the path."""
    press = contact_solver(tuple(kinds), hardens(model))
    contact, before = uncompressed(kinds), 0.0
    for closure, t, speed in zip(path.closures, path.times, path.speeds, strict=True):
        contact, _ = press(model, contact, closure, speed, t - before)
        yield contact.force_n
        before = t


@lru_cache(maxsize=16)
def stiffness(grip: Grip, dt_s: float) -> tuple[float, float]:
    """Return two stiffnesses (N/m): the largest over a tick of `dt_s` on the slow path, and that at the first touch.

    The first is the force after a further step within a tick less the force after a tick at rest, over that step.
    """
    model, path = grip.model, grip.slow
    press = contact_solver(grip.kinds, hardens(model))
    contact = uncompressed(grip.kinds)
    largest, before, further_m = 0.0, 0.0, path.closures[-1] / POINTS
    for k, (closure, t, speed) in enumerate(zip(path.closures, path.times, path.speeds, strict=True)):
        (contact, _), before = press(model, contact, closure, speed, t - before), t
        if k % 4 < 3:
            continue
        rests, further = (press(model, contact, closure + m, 0.0, dt_s)[0].force_n for m in (0.0, further_m))
        largest = max(largest, (further - rests) / further_m)
    # At the first touch the surface alone responds: the parts behind it have not moved yet.
    touch = path.closures[0]
    at_once = next(forces_along(model, grip.kinds, ProbePath(closures=(touch,), times=(0.0,), speeds=(0.0,))))
    return largest, at_once / touch


@lru_cache(maxsize=64)
def damping(grip: Grip, model: ObjectModel, dt_s: float) -> float:
    """Return the damping (N s/m) of the pads and the object in this model, over a tick at the end of the fast path.

    It is the difference of the force at the closing speed and the force at a speed of 0, over the closing speed.
    """
    if not grip.kinds:
        return 0.0
    fast = grip.fast
    depth, speed = fast.closures[-1], fast.speeds[0]
    back = min(speed * dt_s, 0.5 * depth)
    moving = _path(depth - back, (depth - back) / speed, SEARCH_POINTS)
    press, contact, before = contact_solver(grip.kinds, hardens(model)), uncompressed(grip.kinds), 0.0
    for closure, t in zip(moving.closures, moving.times, strict=True):
        contact, _ = press(model, contact, closure, speed, t - before)
        before = t
    forces = [press(model, contact, depth, rate, back / speed)[0].force_n for rate in (speed, 0.0)]
    return abs(forces[0] - forces[1]) / speed


def _paths(
    model: ObjectModel, kinds: Sequence[str], force_n: float, speed_m_s: float, mass_kg: float
) -> tuple[ProbePath, ProbePath, WorkingPoint]:
    """Return the fast and the slow path up to the expected force, and the working point that they reach."""
    depth = _depth(model, kinds, force_n, speed_m_s)
    # A spring k that stops a mass m at a speed v bears the force v sqrt(k m).
    impact = speed_m_s * math.sqrt(force_n / depth * mass_kg)
    if impact > force_n:
        force_n = impact
        depth = _depth(model, kinds, force_n, speed_m_s)
    # An object that creeps yields further when it is pressed slowly.
    slow_depth = _depth(model, kinds, force_n, 0.0)
    # A step of force F on a mass m with a spring k reaches the speed F / sqrt(k m).
    fast = max(force_n / math.sqrt(force_n / depth * mass_kg), speed_m_s)
    point = WorkingPoint(slow_depth, speed_m_s, slow_depth / speed_m_s + HOLD_S, force_n)
    return _path(depth, depth / fast), _path(slow_depth, SQUEEZE_S), point


def _depth(model: ObjectModel, kinds: Sequence[str], force_n: float, speed_m_s: float) -> float:
    """Return the closure (m) at which the force exceeds `force_n`, to about 2 %.

    The fingers close at this speed; at speed 0, over the time of a squeeze.
    """
    most = depth = MAX_DEPTH * max(model.width_m, 1e-4)
    for _ in range(MAX_WALKS):
        duration = depth / speed_m_s if speed_m_s > 0.0 else SQUEEZE_S
        path = _path(depth, duration, SEARCH_POINTS)
        reached, largest_n = _reached(path.closures, forces_along(model, kinds, path), force_n)
        if reached is None:
            if depth == most:
                break
            depth = min(depth * min(max(force_n / max(largest_n, MIN_FORCE_N), FURTHER), MOST_FURTHER), most)
            continue
        before, depth = depth, min(reached * FURTHER, depth)
        if before - depth < DEPTH_RTOL * before:
            break
    return depth


def _reached(
    closures: Sequence[float], forces: Iterator[float], force_n: float
) -> tuple[float | None, float]:
    """Return the closure (m) at which the force exceeds `force_n`, and the largest force (N) until then.

    The closure is interpolated between the points; None if the force is never exceeded.
    """
    before_m = before_n = largest_n = 0.0
    for closure, force in zip(closures, forces, strict=False):
        if force > force_n:
            share = (force_n - before_n) / (force - before_n)
            return before_m + share * (closure - before_m) if share > 0.0 else closure, force
        before_m, before_n = closure, force
        largest_n = max(largest_n, force)
    return None, largest_n


def _path(depth_m: float, duration_s: float, n: int = POINTS) -> ProbePath:
    """Return a path that closes at constant speed in `n` steps, the first of which is divided further."""
    speed = depth_m / duration_s
    early = (4.0**-k / n for k in range(EARLY_POINTS, 0, -1))
    shares = [*early, *((k + 1) / n for k in range(n))]
    return ProbePath(
        closures=tuple(depth_m * share for share in shares),
        times=tuple(duration_s * share for share in shares),
        speeds=(speed,) * len(shares),
    )
