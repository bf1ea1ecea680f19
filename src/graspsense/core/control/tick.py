"""One tick of a grasp as one pure function: open, tare, the controller's step, hold, release, and the guard.

The runner calls it in the interpreter. A simulator that runs many grasps at once compiles the same function, with the
same controller, into its loop. `bind(tick, step=controller.step, events_told=events_of(controller.step))` supplies the
controller.

While only position and speed of the fingers change, a simulator may use `free_from`, `free_tick` and `after_free`
instead, which give the same commands and states for less (see `graspsense.core.control.free_motion`).
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf, nan
from typing import Any, NamedTuple

from graspsense.core.control.contact import RestState, at_rest, update_rest
from graspsense.core.control.free_motion import NOT_FREE, FreeLimits, FreeMotion
from graspsense.core.control.guard import GuardParams, GuardState, guard, limits_without_contact
from graspsense.core.values.signals import (
    EFFORT,
    HOLD,
    RUNNING,
    SQUEEZE,
    STEADY,
    Command,
    Frame,
    Phase,
    Reading,
)

OPENING = int(Phase.OPENING)
TARING = int(Phase.TARING)
APPROACH = int(Phase.APPROACH)
RELEASE = int(Phase.RELEASE)
"""The fingers open again, after the grasp has ended."""

OPEN_SPEED_M_S = 1e-3
"""Speed below which fingers that were told to open are open: 1 mm/s, as in the authors' code."""
OPEN_WINDOW_S = 0.1
"""Time for which they must be slower: 0.1 s, as in the authors' code."""


class Schedule(NamedTuple):
    """The phases around a grasp: the commands that open and relax, the images for the tare, the time to hold.

    `opens` is 1 for a gripper. For a recording, which begins at the approach, it is 2 if the release is in it, and 0
    if it is not. `releases` is 0 where a grasp that was held (that had a tick of the phase HOLD) ends in the first
    tick of its release, because nothing of the release is needed.
    """

    opens: int
    opening: Command
    relaxed: Command
    tare_images: int
    hold_s: float
    opening_timeout_s: float
    releases: int = 1


class TickParams(NamedTuple):
    """The parameters of one grasp: of the schedule, the guard, and the controller (`law`)."""

    schedule: Schedule
    guard: GuardParams
    law: Any


class TickState(NamedTuple):
    """The state of a grasp.

    `done` is 1 after the release. `events` holds the events that the controller tells in this tick: bit i stands for
    the i-th of `Controller.events`.
    """

    phase: int
    since_t_s: float
    still: RestState
    first_image: int
    law: Any
    guard: GuardState
    done: int
    events: int


def first_state(law: Any) -> TickState:
    """Return the state before the first tick, given that of the controller."""
    return TickState(
        phase=-1,
        since_t_s=0.0,
        still=RestState(0.0, 0.0),
        first_image=0,
        law=law,
        guard=GuardState(0, 0, 0),
        done=0,
        events=0,
    )


def stopped(schedule: Schedule, state: TickState, frame: Frame) -> TickState:
    """Return the state in which the next tick releases the object, whatever the controller would have done.

    A recording without a release is over.
    """
    still = RestState(frame.t_s, frame.gap_m)
    if schedule.opens == 0:
        return state._replace(done=1, since_t_s=frame.t_s, still=still)
    return state._replace(phase=RELEASE, since_t_s=frame.t_s, still=still)


def _unbound(params: Any, state: Any, reading: Reading) -> tuple[Command, Any]:
    raise TypeError("tick has no controller: bind(tick, step=controller.step)")


step: Callable[[Any, Any, Reading], tuple[Command, Any]] = _unbound


def _no_events(law: Any) -> int:
    return 0


def _events(law: Any) -> int:
    told: int = law.events
    return told


def events_of(step: Callable[..., Any]) -> Callable[[Any], int]:
    """Return the part `events_told` of a tick: what gives the events in the state of the controller with this step.

    A controller whose class names events has marked its step (`Controller.__init_subclass__`).
    """
    return _events if getattr(step, "tells_events", False) else _no_events


events_told: Callable[[Any], int] = _no_events


def tick(params: TickParams, state: TickState, reading: Reading) -> tuple[Command, TickState]:
    """Return the command for this tick and the next state."""
    schedule = params.schedule
    frame = reading.frame
    phase, since, still, first_image, law, watcher, done, events = state
    events = 0
    if phase == -1:
        phase, since, still = OPENING, frame.t_s, RestState(frame.t_s, frame.gap_m)
        if schedule.opens != 1:
            phase = APPROACH

    if phase >= APPROACH and phase != RELEASE:
        command, law = step(params.law, law, reading)
        phase, events = law.phase, events_told(law)
        if law.outcome == RUNNING:
            since = frame.t_s
        elif law.outcome != STEADY or frame.t_s - since >= schedule.hold_s:
            since, still = frame.t_s, RestState(frame.t_s, frame.gap_m)
            if schedule.opens != 0:
                phase = RELEASE
            if schedule.opens == 0 or (schedule.releases == 0 and state.phase == HOLD):
                done = 1
    elif phase == TARING:
        command = schedule.relaxed
        waited = frame.t_s - since
        if reading.pads.counter >= first_image + schedule.tare_images or waited >= schedule.opening_timeout_s:
            # The zero applies from the next frame on, so the approach begins there.
            phase, since = APPROACH, frame.t_s
    else:
        command = schedule.opening
        still = update_rest(still, frame.t_s, frame.gap_m, OPEN_SPEED_M_S, OPEN_WINDOW_S)
        waited = frame.t_s - since
        if at_rest(still, frame.t_s, OPEN_WINDOW_S) or waited >= schedule.opening_timeout_s:
            if phase == RELEASE:
                done = 1
            else:
                phase, since, first_image = TARING, frame.t_s, reading.pads.counter
    command, watcher = guard(params.guard, watcher, frame, command)
    if state.phase < APPROACH:
        # Before the approach nothing is touched: these forces may be relative to an old zero.
        watcher = GuardState(0, watcher.acted, watcher.stopped)
    return command, TickState(
        phase=phase,
        since_t_s=since,
        still=still,
        first_image=first_image,
        law=law,
        guard=watcher,
        done=done,
        events=events,
    )


# ------------------------------------------------------------------------------------------------- free motion

CALLED = 0
"""The controller is called in every tick."""
CLOSES = 1
"""The controller follows its law of free motion."""
MOVES = 2
"""The fingers open, before the tare or after the hold."""
WAITS = 3
"""The gripper waits for the images of the tare."""
TIME_TOLERANCE_S = 1e-9
"""Free motion ends this much before a time-out, which may be rounded differently; the tick itself then decides."""


class FreeTicks(NamedTuple):
    """What stays the same from tick to tick in free motion."""

    kind: int
    """`CALLED`, `CLOSES`, `MOVES` or `WAITS`."""
    effort_n: float
    """The effort that is commanded, unless the controller's law says it."""
    limits: FreeLimits
    effort_limit_n: float
    speed_limit_m_s: float
    """The limits of the guard, beyond which it acts."""


FreeState = tuple[Any, RestState]
"""What changes from tick to tick in free motion: the memory of the controller's law, and since when the gap rests."""


def _never_free(params: Any, law: Any, frame: Frame) -> tuple[Any, FreeLimits]:
    return 0.0, NOT_FREE


def _no_command(
    params: Any, memory: Any, gap_m: float, velocity_m_s: float, dt_s: float
) -> tuple[float, Any]:
    return nan, memory


def _unchanged(params: Any, law: Any, memory: Any, effort_n: float, t_s: float) -> Any:
    return law


free_begin: Callable[[Any, Any, Frame], tuple[Any, FreeLimits]] = _never_free
free_command: Callable[[Any, Any, float, float, float], tuple[float, Any]] = _no_command
free_end: Callable[[Any, Any, Any, float, float], Any] = _unchanged


def free_parts(step: Callable[..., Any]) -> dict[str, Any]:
    """Return the parts of `free_from`, `free_tick` and `after_free` for a controller with this step."""
    # A subclass that replaces `step` has to declare its own law, so that none is used for another step.
    law: FreeMotion | None = getattr(step, "free_motion", None)
    if law is None:
        return {}
    return {"free_begin": law.begin, "free_command": law.command, "free_end": law.end}


def free_from(params: TickParams, state: TickState, frame: Frame) -> tuple[FreeTicks, FreeState]:
    """Return how free motion goes on after the tick of this frame, which has not changed the phase.

    Its kind is `CALLED` if the motion is not free, or if nothing is known about the controller.
    """
    schedule, phase, since = params.schedule, state.phase, state.since_t_s
    memory, limits = free_begin(params.law, state.law, frame)
    kind, command = CALLED, schedule.relaxed
    if phase == APPROACH:
        kind = CLOSES
    elif phase != SQUEEZE and phase != HOLD:
        limits = FreeLimits(-inf, since + schedule.opening_timeout_s - TIME_TOLERANCE_S)
        kind = WAITS
        if phase != TARING:
            kind, command = MOVES, schedule.opening
        if command.kind != EFFORT:
            kind = CALLED
    effort_limit, speed_limit = limits_without_contact(params.guard, state.guard)
    if kind == CLOSES:
        if limits.until_s < frame.t_s:
            kind = CALLED
    else:
        effort_limit = min(effort_limit, command.effort_limit_n)
        speed_limit = min(speed_limit, command.speed_limit_m_s)
    if state.done == 1 or state.guard.stopped == 1:
        kind = CALLED
    free = FreeTicks(
        kind=kind,
        effort_n=command.value,
        limits=limits,
        effort_limit_n=effort_limit,
        speed_limit_m_s=speed_limit,
    )
    return free, (memory, state.still)


def free_tick(
    params: TickParams,
    free: FreeTicks,
    state: FreeState,
    t_s: float,
    dt_s: float,
    gap_m: float,
    velocity_m_s: float,
) -> tuple[float, FreeState]:
    """Return the effort that `tick` commands in free motion, and the next state; NaN if `tick` itself is to be called.

    The forces of this tick's frame are those with which `free_from` was called.
    """
    kind, effort, (least_gap, until), effort_limit, speed_limit = free
    memory, still = state
    if not (gap_m > least_gap and t_s <= until and -speed_limit <= velocity_m_s <= speed_limit):
        return nan, state
    if kind == CLOSES:
        effort, memory = free_command(params.law, memory, gap_m, velocity_m_s, dt_s)
    elif kind == MOVES:
        still = update_rest(still, t_s, gap_m, OPEN_SPEED_M_S, OPEN_WINDOW_S)
        if at_rest(still, t_s, OPEN_WINDOW_S):
            return nan, state
    if not -effort_limit <= effort <= effort_limit:
        return nan, state
    return effort, (memory, still)


def after_free(
    params: TickParams, state: TickState, now: FreeState, effort_n: float, t_s: float
) -> TickState:
    """Return the state after the last tick of free motion, given that before, the effort of that tick and its time."""
    phase, since, _, first_image, law, watcher, done, _ = state
    memory, still = now
    if phase == APPROACH:
        law, since = free_end(params.law, law, memory, effort_n, t_s), t_s
    return TickState(
        phase=phase,
        since_t_s=since,
        still=still,
        first_image=first_image,
        law=law,
        guard=watcher,
        done=done,
        events=0,
    )
