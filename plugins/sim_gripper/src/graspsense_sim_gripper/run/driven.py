"""Squeezes in which the fingers follow a recorded gap or a recorded force, instead of a drive under a controller.

They give the forces of an object along a path that somebody measured, so a scene can be compared with a recording.
The contact is that of a grasp (`plant.contact`): pads in series with the object, and the object on its table.
Between two recorded times the gap, or the force, changes linearly. Contacts and events of terms are located within a
step.

The sensor of the recording is not simulated here. A sensor that samples with a delay shows the force of an earlier
time: ask for the forces at the times of its samples, less its delay.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
from attrs import field, frozen
from numpy.typing import ArrayLike, NDArray

from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.plant.contact import has_event, next_contacts, pad_forces, with_touch
from graspsense_sim_gripper.plant.object_model import ObjectModel
from graspsense_sim_gripper.plant.roots import MAX_ITERATIONS, bracketed_secant
from graspsense_sim_gripper.plant.state import Contact
from graspsense_sim_gripper.run.binding import bind_reachable
from graspsense_sim_gripper.run.build import build, instantiate
from graspsense_sim_gripper.run.compiled.compose import any_moves, hardens, pad_parts, phase_of_all, sum_of
from graspsense_sim_gripper.run.compiled.jit import compile_part
from graspsense_sim_gripper.run.compiled.padding import padded
from graspsense_sim_gripper.scene.terms.registry import laws_of, moving_of, phases_of
from graspsense_sim_gripper.solve.control import MIN_STEP_S
from graspsense_sim_gripper.solve.events import until_event

STEP_S: Final = 1e-3
"""The longest step between two recorded times, if the settings give no `step_s`."""
WORTH_COMPILING: Final = 200_000
"""Number of steps of all squeezes from which compiling saves more time than it takes."""
COLUMNS: Final = ("gap_m", "force_left_n", "force_right_n", "compression_m")
"""The rows of the table of a squeeze."""
FORCE_ATOL_N: Final = 1e-9
FORCE_RTOL: Final = 1e-9
"""Absolute and relative tolerance with which a force is followed."""
FIRST_TRY_M: Final = 1e-6
"""Change of the gap with which the search for a force begins."""
REST_SHARE: Final = 1e-12
"""Fraction of a step below which what is left of it is rounding."""


def _array(value: ArrayLike) -> NDArray[np.float64]:
    return np.ascontiguousarray(value, dtype=float)


def _array_or_none(value: ArrayLike | None) -> NDArray[np.float64] | None:
    return None if value is None else _array(value)


@frozen(kw_only=True, eq=False)
class RecordedPath:
    """A recorded motion: the gap, or the mean force on the pads, at increasing times. All arrays have shape (n,).

    Raises ValueError if the arrays do not fit together, or have a number that is not finite.
    """

    t_s: NDArray[np.float64] = field(converter=_array)
    gap_m: NDArray[np.float64] | None = field(default=None, converter=_array_or_none)
    force_n: NDArray[np.float64] | None = field(default=None, converter=_array_or_none)
    """A path by force begins where both fingers touch the object; it ends in a contact or with forces of 0."""

    def __attrs_post_init__(self) -> None:
        if (self.gap_m is None) == (self.force_n is None):
            raise ValueError("a path follows either gap_m or force_n: give one of them")
        if self.t_s.ndim != 1 or self.t_s.shape != self.values.shape or len(self.t_s) < 2:
            raise ValueError(
                f"times of shape {self.t_s.shape} and values of shape {self.values.shape}: give two arrays of one "
                "length, at least 2"
            )
        if not np.all(np.isfinite(self.t_s)) or not np.all(np.isfinite(self.values)):
            raise ValueError("a path has a number that is not finite: leave such samples out")
        if not np.all(np.diff(self.t_s) > 0.0):
            raise ValueError("the times of a path must increase: leave out samples that repeat a time")

    @property
    def values(self) -> NDArray[np.float64]:
        """The gap (m) or the force (N), whichever is followed."""
        values = self.force_n if self.gap_m is None else self.gap_m
        assert values is not None
        return values

    @property
    def seconds(self) -> float:
        """Duration of the path."""
        return float(self.t_s[-1] - self.t_s[0])


@frozen(kw_only=True, eq=False)
class DrivenSqueeze:
    """The result of a squeeze along a path: arrays of shape (n,), at the times of the path."""

    t_s: NDArray[np.float64]
    gap_m: NDArray[np.float64]
    force_left_n: NDArray[np.float64]
    force_right_n: NDArray[np.float64]
    compression_m: NDArray[np.float64]
    """Of the object alone; if it is held fast, as its left half would be compressed."""
    peak_n: float
    """The largest force on a pad, also between the times of the path."""
    broken: bool
    resolved: bool
    """False if a balance of forces or a recorded force was not found; after a break, a force may be out of reach."""

    @property
    def force_n(self) -> NDArray[np.float64]:
        """The mean force on the two pads."""
        return 0.5 * (self.force_left_n + self.force_right_n)


class Driven(NamedTuple):
    """The state of a squeeze along a path."""

    contact: Contact
    gap_m: float
    peak_n: float
    missed: int
    """Recorded forces that were not reached so far."""


def follow(
    model: ObjectModel, state: Driven, path: tuple[Any, Any, int], table: Any, longest_s: float
) -> Driven:
    """Follow the path and write the rows of `COLUMNS` to `table`; return the state at its end.

    `path` holds the times (s), the values, and whether these are forces (1) or gaps (0).
    """
    times, values, by_force = path
    for i in range(len(times)):
        if i > 0:
            span = times[i] - times[i - 1]
            pieces = max(math.ceil(span / longest_s * (1.0 - REST_SHARE)), 1)
            rise = (values[i] - values[i - 1]) / pieces
            for k in range(pieces):
                value = values[i - 1] + rise * (k + 1)
                if by_force == 1:
                    state = to_force(model, state, max(value, 0.0), span / pieces)
                else:
                    state = to_gap(model, state, value, span / pieces)
        contact = state.contact
        table[0][i] = state.gap_m
        table[1][i] = contact.left_n
        table[2][i] = contact.right_n
        table[3][i] = contact.left.compression_m
    return state


def to_gap(model: ObjectModel, state: Driven, gap_m: float, h: float) -> Driven:
    """Return the squeeze after the gap has changed linearly to `gap_m` within `h`."""
    contact, gap, peak, missed = state
    speed, left_s = (gap - gap_m) / h, h
    while left_s > REST_SHARE * h:
        reach, meeting = next_contacts(model, contact, gap)
        ahead, target = left_s, gap_m
        if gap > meeting > gap_m:
            ahead, target = min((gap - meeting) / speed, left_s), meeting
        if contact.touched == 1 or target <= reach:
            # A contact that begins here has lasted no time.
            lasted = ahead if contact.touched == 1 else 0.0
            after = pad_forces(model, contact, target, speed, lasted, speed == 0.0)
            if lasted > MIN_STEP_S and has_event(contact, after):
                ahead, after = until_event(model, contact, gap, speed, ahead, speed == 0.0)
                target = gap - speed * ahead
            contact = with_touch(after, target, reach)
            peak = max(peak, contact.left_n, contact.right_n)
        gap, left_s = target, left_s - ahead
    return Driven(contact, gap_m, peak, missed)


def to_force(model: ObjectModel, state: Driven, force_n: float, h: float) -> Driven:
    """Return the squeeze after the fingers have moved within `h` to where the mean force is `force_n`."""
    closed = last = -state.gap_m
    value = last_value = 0.0
    slope, lower, upper = 0.0, -math.inf, math.inf
    after = state
    for n in range(MAX_ITERATIONS):
        after = to_gap(model, state, -closed, h)
        value = 0.5 * (after.contact.left_n + after.contact.right_n) - force_n
        if not abs(value) > FORCE_ATOL_N + FORCE_RTOL * force_n:
            return after
        if n > 0 and closed != last:
            slope = (value - last_value) / (closed - last)
        if value > 0.0:
            upper = closed
        else:
            lower = closed
        if n == 0 or slope <= 0.0:
            following = closed - math.copysign(FIRST_TRY_M * 2.0 ** min(n, 30), value)
            if not lower < following < upper:
                following = 0.5 * (lower + upper)
        else:
            following = bracketed_secant(closed, value, last, slope, lower, upper)
        if following == closed:
            break
        last, last_value, closed = closed, value, following
    return Driven(after.contact, after.gap_m, after.peak_n, after.missed + 1)


@lru_cache(maxsize=64)
def _follower(kinds: tuple[str, ...], hardens: bool) -> Callable[..., Driven]:
    """Return `follow` for an object of these terms. `hardens`: whether the pads are nonlinear."""
    parts = {
        "object_force": sum_of(laws_of(kinds)),
        "object_phase": phase_of_all(phases_of(kinds)),
        "object_moves": any_moves(moving_of(kinds)),
    }
    return bind_reachable(follow, {**parts, **pad_parts(hardens)})


@lru_cache(maxsize=64)
def _compiled_follower(kinds: tuple[str, ...], hardens: bool) -> Callable[..., Driven]:
    return compile_part(_follower(kinds, hardens))


def follow_many(
    config: SimConfig, path: RecordedPath, scenes: Sequence[str], seeds: Sequence[int]
) -> list[DrivenSqueeze]:
    """Squeeze each scene with its seed along the path, with all its terms; the results are in the same order.

    Steps are at most `config.step_s` long, 1 ms if that is not set; their error is of second order. Raises ValueError
    if there are not as many seeds as scenes, UnknownName and ConfigError for a scene that cannot be read.
    """
    if len(scenes) != len(seeds):
        raise ValueError(f"{len(scenes)} scenes and {len(seeds)} seeds: give one seed a scene")
    longest_s = config.step_s or STEP_S
    compiled = config.compile == "always"
    if config.compile == "worth":
        compiled = len(scenes) * path.seconds / longest_s >= WORTH_COMPILING
    return [
        _squeeze(config, path, scene, seed, longest_s, compiled)
        for scene, seed in zip(scenes, seeds, strict=True)
    ]


def _squeeze(
    config: SimConfig, path: RecordedPath, scene: str, seed: int, longest_s: float, compiled: bool
) -> DrivenSqueeze:
    setup = instantiate(build(config, scene), None, seed)
    if compiled:
        setup = padded(setup)
    model, contact = setup.plant.object, setup.state.contact
    table: Any = np.zeros((len(COLUMNS), len(path.t_s)))
    recorded: tuple[Any, Any, int] = path.t_s, path.values, int(path.gap_m is None)
    first_m = float(path.values[0])
    if path.gap_m is None:
        contact, first_m = contact._replace(offset_m=0.0), model.width_m
    if not compiled:
        table, recorded = table.tolist(), (path.t_s.tolist(), path.values.tolist(), recorded[2])
    run = (_compiled_follower if compiled else _follower)(setup.kinds, hardens(model))
    end = run(model, Driven(contact, first_m, 0.0, 0), recorded, table, float(longest_s))
    columns = np.asarray(table)
    return DrivenSqueeze(
        t_s=path.t_s,
        gap_m=columns[0],
        force_left_n=columns[1],
        force_right_n=columns[2],
        compression_m=columns[3],
        peak_n=end.peak_n,
        broken=any(getattr(state, "broken", 0) == 1 for state in end.contact.left.states),
        resolved=end.missed + end.contact.unbalanced == 0,
    )
