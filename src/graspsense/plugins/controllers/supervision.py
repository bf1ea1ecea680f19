"""Supervision of a closing gripper: contact, rest, and failures. All control laws share it.

The states and time-outs are those of the paper's own controller (personalrobots-pkg, September 2009,
`experimental_controllers/src/pr2_gripper_controller.cpp`): 10 s to make contact, 3 s to come to rest, and the
result codes of `GraspClosedLoop.srv`.
"""

from __future__ import annotations

from math import inf
from typing import Any, Final, NamedTuple, TypeVar

from attrs import frozen

from graspsense.gripper_api import CRUSHED, SIDE_IMPACT, SLIPPED, TOO_WIDE, either_touches
from graspsense.plugin_api import (
    APPROACH,
    CONTACT_FORCE_N,
    EFFORT,
    HOLD,
    NEVER_STEADY,
    NOTHING_THERE,
    ONE_FINGER,
    REST_SPEED_M_S,
    REST_WINDOW_S,
    RUNNING,
    SQUEEZE,
    STEADY,
    Channel,
    Controller,
    Frame,
    RestState,
    at_rest,
    both_touch,
    setting,
    update_rest,
)
from graspsense.simulator_api import NOT_FREE, FreeLimits

LAW_CHANNELS: Final = (
    Channel("gap", "m"),
    Channel("velocity", "m/s"),
    Channel("force_left", "N"),
    Channel("force_right", "N"),
)
"""The channels that every control law of this package reads."""


@frozen(kw_only=True, slots=False)
class SupervisionConfig:
    """Thresholds and time-outs of every control law of this package."""

    contact_force_n: float = setting(
        default=CONTACT_FORCE_N,
        unit="N",
        above=0.0,
        plausible=(0.01, 20.0),
        meaning="Force on both pads, above their tared zero, from which on they touch the object.",
    )
    rest_speed_m_s: float = setting(
        default=REST_SPEED_M_S,
        unit="m/s",
        above=0.0,
        plausible=(1e-7, 0.05),
        meaning="At rest, the gap changes by less than this times the window, throughout it.",
    )
    rest_window_s: float = setting(
        default=REST_WINDOW_S,
        unit="s",
        above=0.0,
        plausible=(0.001, 5.0),
        meaning="Time for which the fingers must stay below the rest speed.",
    )
    edge_force_n: float = setting(
        default=0.25,
        unit="N",
        above=0.0,
        plausible=(0.01, 50.0),
        meaning="Force on a single edge cell above which closing ends as a side impact (100 counts of the most "
        "sensitive cell).",
    )
    move_timeout_s: float = setting(
        default=10.0,
        unit="s",
        above=0.0,
        plausible=(0.01, 600.0),
        meaning="Longest approach; extended if the closing speed requires it.",
    )
    steady_timeout_s: float = setting(
        default=3.0,
        unit="s",
        above=0.0,
        plausible=(0.01, 600.0),
        meaning="Longest squeeze, after which the grasp ends as never steady.",
    )
    closed_gap_m: float = setting(
        default=0.003,
        unit="m",
        plausible=(-0.05, 0.1),
        meaning="Gap at which the fingers count as closed: there is no object, or after contact none is left. Negative "
        "where the zero of the gap is not that of closed fingers.",
    )
    too_wide_m: float = setting(
        default=0.001,
        unit="m",
        plausible=(-0.05, 0.1),
        meaning="Travel within which a contact means that the object is wider than the opening. Negative if the gap of "
        "a recording can grow before the contact.",
    )
    crush_share: float = setting(
        default=0.2,
        above=0.0,
        plausible=(0.001, 0.999),
        meaning="The object is crushed if the force falls below this share of its peak as the gap closes by "
        "crush_travel_m.",
    )
    crush_travel_m: float = setting(
        default=0.002,
        unit="m",
        above=0.0,
        plausible=(1e-6, 0.1),
        meaning="Travel of the gap that belongs to crush_share.",
    )
    slip_time_s: float = setting(
        default=0.2,
        unit="s",
        above=0.0,
        plausible=(0.001, 10.0),
        meaning="Both pads below half the contact force for this long, closed further than at the peak: slipped "
        "out. A finger that bounces off a rigid object loses contact too, but opens.",
    )


class GraspProgress(NamedTuple):
    """The progress of the grasp. The start is unknown until the first tick (`begun` is 0)."""

    phase: int
    outcome: int
    begun: int
    start_gap_m: float
    deadline_s: float
    """Time at which the approach, later the squeeze, has taken too long."""
    still: RestState
    peak_force_n: float
    peak_gap_m: float
    felt_t_s: float
    """Time of the last force on a pad after contact."""


def law_numbers(
    slowest_m_s: float = 0.0, target_force_n: float = 0.0, force_tolerance_n: float = inf
) -> dict[str, float]:
    """Return what a law adds to the numbers of its config, for `supervise`.

    `slowest_m_s` is the closing speed that the time-out must allow for (0: none). A law that controls the force is
    steady only when the mean force is within `force_tolerance_n` of `target_force_n`; for others that is inf.
    """
    return {
        "slowest_m_s": slowest_m_s,
        "target_force_n": target_force_n,
        "force_tolerance_n": force_tolerance_n,
    }


EVENTS: Final = ("contact", "slip")
"""The events that every control law of this package tells: both pads touch; the object slipped out."""


ConfigT = TypeVar("ConfigT", bound=SupervisionConfig)


class SupervisedController(Controller[ConfigT]):
    """A control law of this package that commands an effort, unless it is told to send something else."""

    requires = LAW_CHANNELS
    commands = ("effort",)

    def contact_force_n(self) -> float:
        """Return the contact force (N) of the supervision."""
        return float(self.config.contact_force_n)


def events_of(earlier: GraspProgress, later: GraspProgress) -> int:
    """Return the bits of the `EVENTS` between two ticks."""
    if later.phase != APPROACH and earlier.phase == APPROACH:
        return 1
    if later.outcome == SLIPPED and earlier.outcome != SLIPPED:
        return 2
    return 0


def not_begun() -> GraspProgress:
    """Return the progress before the first tick."""
    return GraspProgress(
        phase=APPROACH,
        outcome=RUNNING,
        begun=0,
        start_gap_m=0.0,
        deadline_s=0.0,
        still=RestState(0.0, 0.0),
        peak_force_n=0.0,
        peak_gap_m=0.0,
        felt_t_s=0.0,
    )


class LawState(NamedTuple):
    """State of a law that keeps one effort (N) from tick to tick."""

    phase: int
    outcome: int
    progress: GraspProgress
    effort_n: float
    events: int = 0
    """The bits of `EVENTS` in this tick."""


def law_state(progress: GraspProgress, effort_n: float, events: int) -> LawState:
    """Return the state with this progress."""
    return LawState(
        phase=progress.phase,
        outcome=progress.outcome,
        progress=progress,
        effort_n=effort_n,
        events=events,
    )


def free_begin(params: Any, state: LawState, frame: Frame) -> tuple[float, FreeLimits]:
    """Begin free motion: its memory is the effort that the law keeps."""
    return state.effort_n, free_limits(params, state.progress)


def free_end(params: Any, state: LawState, memory_n: float, effort_n: float, t_s: float) -> LawState:
    """Return the state after free motion."""
    return law_state(state.progress, memory_n, 0)


def supervise(params: Any, now: GraspProgress, frame: Frame, still: RestState) -> GraspProgress:
    """Return the progress after this frame; the same object if nothing has changed.

    `params` has the numbers of `SupervisionConfig`, and those of `law_numbers`. `still` is the rest so far: that of
    the progress, unless the law begins it anew.
    """
    if now.outcome != RUNNING:
        return now
    if now.phase == APPROACH:
        return _approaching(params, now, frame)
    return _squeezing(params, now, frame, still)


def free_limits(params: Any, now: GraspProgress) -> FreeLimits:
    """Return until when `supervise` returns the same progress, if no force changes (see `FreeMotion`).

    Only a law that sends an effort has free motion.
    """
    if params.sends == EFFORT and now.phase == APPROACH and now.outcome == RUNNING and now.begun == 1:
        return FreeLimits(params.closed_gap_m, now.deadline_s)
    return NOT_FREE


def _approaching(params: Any, now: GraspProgress, frame: Frame) -> GraspProgress:
    t, _, gap, _, _, left, right, edge_left, edge_right, _ = frame
    contact, edge = params.contact_force_n, params.edge_force_n
    begun, start_gap, deadline = now.begun, now.start_gap_m, now.deadline_s
    if begun == 0:
        start_gap = gap
        allowed = params.move_timeout_s
        if params.slowest_m_s > 0.0:
            allowed = max(allowed, 1.5 * gap / params.slowest_m_s)
        deadline = t + allowed
    phase, outcome, force = APPROACH, RUNNING, 0.0
    if edge_left > edge or edge_right > edge:
        outcome = SIDE_IMPACT
    elif both_touch(left, right, contact):
        # A gap that is no number tells nothing of the width.
        if not start_gap - gap < params.too_wide_m or begun == 0:
            phase, force, deadline = SQUEEZE, 0.5 * (left + right), t + params.steady_timeout_s
        else:
            outcome = TOO_WIDE
    elif gap <= params.closed_gap_m:
        outcome = NOTHING_THERE
    elif t > deadline:
        outcome = ONE_FINGER if either_touches(left, right, contact) else NOTHING_THERE
    if phase == APPROACH and outcome == RUNNING and begun == 1:
        return now
    return GraspProgress(
        phase=phase,
        outcome=outcome,
        begun=1,
        start_gap_m=start_gap,
        deadline_s=deadline,
        still=RestState(t, gap),
        peak_force_n=force,
        peak_gap_m=gap,
        felt_t_s=t,
    )


def _squeezing(params: Any, now: GraspProgress, frame: Frame, still: RestState) -> GraspProgress:
    t, gap, left, right = frame.t_s, frame.gap_m, frame.force_left_n, frame.force_right_n
    force = 0.5 * (left + right)
    still = update_rest(still, t, gap, params.rest_speed_m_s, params.rest_window_s)
    peak_force, peak_gap, felt_t = now.peak_force_n, now.peak_gap_m, now.felt_t_s
    if force > peak_force:
        peak_force, peak_gap = force, gap
    if either_touches(left, right, 0.5 * params.contact_force_n):
        felt_t = t

    phase, outcome = SQUEEZE, RUNNING
    if gap <= params.closed_gap_m or (
        force < params.crush_share * peak_force and gap < peak_gap - params.crush_travel_m
    ):
        outcome = CRUSHED
    elif t - felt_t > params.slip_time_s and gap < peak_gap:
        outcome = SLIPPED
    elif (
        at_rest(still, t, params.rest_window_s)
        and abs(force - params.target_force_n) <= params.force_tolerance_n
        and (felt_t == t or not gap > peak_gap)  # else the fingers rest open, in a recording that goes on
    ):
        phase, outcome = HOLD, STEADY
    elif t > now.deadline_s:
        outcome = NEVER_STEADY
    return GraspProgress(
        phase=phase,
        outcome=outcome,
        begun=1,
        start_gap_m=now.start_gap_m,
        deadline_s=now.deadline_s,
        still=still,
        peak_force_n=peak_force,
        peak_gap_m=peak_gap,
        felt_t_s=felt_t,
    )
