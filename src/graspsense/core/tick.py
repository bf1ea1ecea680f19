"""One tick of a grasp as one pure function: open, tare, the controller's step, hold, release, and the guard.

The runner calls it in the interpreter. A simulator that runs many grasps at once compiles the same function, with the
same controller, into its loop. `bind(tick, step=controller.step, events_told=events_of(controller.step))` supplies the
controller.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from graspsense.core.contact import RestState, at_rest, update_rest
from graspsense.core.guard import GuardParams, GuardState, guard
from graspsense.core.signals import RUNNING, STEADY, Command, Frame, Phase, Reading

OPENING = int(Phase.OPENING)
TARING = int(Phase.TARING)
APPROACH = int(Phase.APPROACH)
RELEASE = int(Phase.RELEASE)

OPEN_SPEED_M_S = 1e-3
OPEN_WINDOW_S = 0.1
"""The fingers count as opened or released when slower than 1 mm/s for 0.1 s, the values of the authors' code."""


class Schedule(NamedTuple):
    """The phases around a grasp: the commands that open and relax, the images for the tare, the time to hold.

    `opens` is 1 for a gripper. For a recording, which begins at the approach, it is 2 if the release is in it, and 0
    if it is not.
    """

    opens: int
    opening: Command
    relaxed: Command
    tare_images: int
    hold_s: float
    opening_timeout_s: float


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
    return TickState(-1, 0.0, RestState(0.0, 0.0), 0, law, GuardState(0, 0, 0), 0, 0)


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
            else:
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
    return command, TickState(phase, since, still, first_image, law, watcher, done, events)
