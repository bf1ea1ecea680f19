"""Pressing an object along prescribed paths, to see what each of its terms contributes to the force.

There are three paths: closing at the speed of the first contact, closing as fast as the gripping force can accelerate
the fingers, and closing within the longest duration of a squeeze. After each the fingers rest for as long as a grasp
lasts.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

from attrs import evolve, frozen

from graspsense_sim_gripper.compiled.compose import contact_solver, uncompressed
from graspsense_sim_gripper.dynamics.contact import ObjectModel
from graspsense_sim_gripper.reduction.candidates import without_term
from graspsense_sim_gripper.terms.term import WorkingPoint

HOLD_S: Final = 1.0
SQUEEZE_S: Final = 3.0
"""No squeeze takes longer, since the controllers give up then."""
POINTS: Final = 24
"""Equal steps of a closing path."""
EARLY_POINTS: Final = 3
"""Further points within the first of them, since the contact needs a finer look."""
MAX_CHANGE: Final = 0.5
"""A relative change of the force that is too large for any accuracy."""
MIN_SPEED_M_S: Final = 1e-4
MAX_DEPTH: Final = 0.9
"""No object is compressed by more than this share of its width."""
MIN_FORCE_N: Final = 1.0
"""Changes of smaller forces count as if the force were this."""


@frozen(kw_only=True)
class ProbePath:
    """Closures with their times and speeds, from the contact on."""

    closures: tuple[float, ...]
    times: tuple[float, ...]
    speeds: tuple[float, ...]


class Grip:
    """An object as it is gripped: its full model, its paths and the force along them. No accuracy changes these."""

    def __init__(
        self, model: ObjectModel, kinds: tuple[str, ...], force_n: float, speed_m_s: float, mass_kg: float
    ) -> None:
        self.model, self.kinds = model, kinds
        self.mass_kg = mass_kg
        self.paths, self.point = _paths(model, kinds, force_n, max(speed_m_s, MIN_SPEED_M_S), mass_kg)
        self.forces = [list(forces_along(model, kinds, path)) for path in self.paths]
        self._alternatives: list[list[tuple[str, float]]] | None = None

    def alternatives(self) -> list[list[tuple[str, float]]]:
        """Return for each term what may stand for it, and the error of that alone."""
        if self._alternatives is None:
            self._alternatives = [
                [
                    (name, self.error_of(other))
                    for name, other in without_term(self.model, self.kinds, i, self.point)
                ]
                for i in range(len(self.kinds))
            ]
        return self._alternatives

    def error_of(self, model: ObjectModel, max_error: float = MAX_CHANGE) -> float:
        """Return the largest relative change of the force on the paths with this model.

        What is larger than `max_error` is returned as infinite.
        """
        worst = 0.0
        for path, expected in zip(self.paths, self.forces, strict=True):
            # The model's forces are computed no further than they are needed.
            for force, other in zip(forces_along(model, self.kinds, path), expected, strict=False):
                worst = max(worst, abs(force - other) / max(abs(other), MIN_FORCE_N))
                if not math.isfinite(force) or worst > max_error:
                    return math.inf
        return worst


def forces_along(model: ObjectModel, kinds: Sequence[str], path: ProbePath) -> Iterator[float]:
    """Yield the force at each point of the path."""
    press = contact_solver(tuple(kinds))
    contact, before = uncompressed(kinds), 0.0
    for closure, t, speed in zip(path.closures, path.times, path.speeds, strict=True):
        contact, _ = press(model, contact, closure, speed, t - before)
        yield contact.force_n
        before = t


def stiffness(grip: Grip, dt_s: float) -> tuple[float, float]:
    """Return the largest stiffness within a tick along the slow path, and that of the very first contact (N/m)."""
    model, path = grip.model, grip.paths[-1]
    press = contact_solver(grip.kinds)
    contact = uncompressed(grip.kinds)
    largest, before, further_m = 0.0, 0.0, path.closures[-1] / POINTS
    for k, (closure, t, speed) in enumerate(zip(path.closures, path.times, path.speeds, strict=True)):
        if speed == 0.0:
            break
        (contact, _), before = press(model, contact, closure, speed, t - before), t
        if k % 4 < 3:
            continue
        # The force after a tick further on, compared with that after a tick at rest.
        rests, further = (press(model, contact, closure + m, 0.0, dt_s)[0].force_n for m in (0.0, further_m))
        largest = max(largest, (further - rests) / further_m)
    # A surface that is struck responds before the parts behind it give way.
    touch = path.closures[0]
    at_once = next(forces_along(model, grip.kinds, ProbePath(closures=(touch,), times=(0.0,), speeds=(0.0,))))
    return largest, at_once / touch


def damping(grip: Grip, model: ObjectModel, dt_s: float) -> float:
    """Return the damping (N s/m) of the pads and the object in this model, over a tick at the end of the fast path."""
    if not grip.kinds:
        return 0.0
    # How much larger the force is while the fingers move than while they rest.
    fast = grip.paths[1]
    depth, speed = fast.closures[-1], fast.speeds[0]
    back = min(speed * dt_s, 0.5 * depth)
    moving = _path(depth - back, (depth - back) / speed, 0.0)
    last = evolve(
        moving,
        closures=(*moving.closures, depth),
        times=(*moving.times, moving.times[-1] + back / speed),
        speeds=(*moving.speeds, speed),
    )
    still = evolve(last, speeds=(*moving.speeds, 0.0))
    forces = [list(forces_along(model, grip.kinds, path))[-1] for path in (last, still)]
    return abs(forces[0] - forces[1]) / speed


def _paths(
    model: ObjectModel, kinds: Sequence[str], force_n: float, speed_m_s: float, mass_kg: float
) -> tuple[list[ProbePath], WorkingPoint]:
    """Return the paths up to the expected force, and the working point that they reach."""
    depth = _depth(model, kinds, force_n, speed_m_s)
    # The contact itself: a spring stops the moving mass.
    impact = speed_m_s * math.sqrt(force_n / depth * mass_kg)
    if impact > force_n:
        force_n = impact
        depth = _depth(model, kinds, force_n, speed_m_s)
    # What creeps ends where it does when it is pressed slowly.
    slow_depth = _depth(model, kinds, force_n, 0.0)
    # A step of effort on a spring crosses it in a quarter of a period.
    fast = max(force_n / math.sqrt(force_n / depth * mass_kg), speed_m_s)
    paths = [
        _path(depth, depth / speed_m_s, HOLD_S),
        _path(depth, depth / fast, HOLD_S),
        _path(slow_depth, SQUEEZE_S, HOLD_S),
    ]
    return paths, WorkingPoint(slow_depth, speed_m_s, slow_depth / speed_m_s + HOLD_S, force_n)


def _depth(model: ObjectModel, kinds: Sequence[str], force_n: float, speed_m_s: float) -> float:
    """Return how far the fingers close against this force, by bisection; at speed 0 within the time of a squeeze."""
    lower, upper = 0.0, MAX_DEPTH * max(model.width_m, 1e-4)
    for _ in range(40):
        middle = 0.5 * (lower + upper)
        duration = middle / speed_m_s if speed_m_s > 0.0 else SQUEEZE_S
        if any(force > force_n for force in forces_along(model, kinds, _path(middle, duration, 0.0))):
            upper = middle
        else:
            lower = middle
        if upper - lower < 0.02 * upper:
            break
    return upper


def _path(depth_m: float, duration_s: float, hold_s: float) -> ProbePath:
    """Return a closure at constant speed followed by rest, with points that become rarer while it rests."""
    speed = depth_m / duration_s
    early = (4.0**-k / POINTS for k in range(EARLY_POINTS, 0, -1))
    shares = [*early, *((k + 1) / POINTS for k in range(POINTS))]
    times = [duration_s * share for share in shares]
    closures = [depth_m * share for share in shares]
    speeds = [speed] * len(shares)
    wait = min(1e-3, hold_s)
    while 0.0 < wait <= hold_s * 1.0001:
        times.append(duration_s + wait)
        closures.append(depth_m)
        speeds.append(0.0)
        wait *= 10.0**0.5
    return ProbePath(closures=tuple(closures), times=tuple(times), speeds=tuple(speeds))
