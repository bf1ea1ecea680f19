"""The controllers: one step, which closes, loads, holds and lets go, by the laws that a controller has.

The states are those of the paper: close, load, lift and hold, replace, open.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import inf
from typing import Any, ClassVar, Final, NamedTuple, TypeVar

from attrs import asdict

from graspsense.gripper_api import SLIPPED
from graspsense.plugin_api import (
    APPROACH,
    EFFORT,
    HOLD,
    NEVER_STEADY,
    NOTHING_THERE,
    ONE_FINGER,
    POSITION,
    RUNNING,
    SQUEEZE,
    STEADY,
    VELOCITY,
    Channel,
    Command,
    Controller,
    Frame,
    Reading,
)
from graspsense_romano.config import (
    PLACE_BY,
    FindContactConfig,
    ForceServoConfig,
    GrabConfig,
    PlaceConfig,
    ReleaseConfig,
    SlipServoConfig,
)
from graspsense_romano.events import (
    EVENTS,
    NOTHING,
    EventThresholds,
    TouchConditions,
    begun,
    conditions,
    placed,
)
from graspsense_romano.laws import PositionServo, Servo, force_rate, grab_force, raised_force, servo_effort
from graspsense_romano.signals import FILTERS, NO_SIGNALS, Filters, Signals, updated

CHANNELS: Final[tuple[Channel, ...]] = (
    Channel("gap", "m"),
    Channel("velocity", "m/s"),
    Channel("force_left", "N"),
    Channel("force_right", "N"),
)
"""What every law reads. Edge forces and `acceleration` are used where the gripper has them."""
KINDS: Final = {"effort": EFFORT, "velocity": VELOCITY, "position": POSITION}
IGNORED_S: Final = 0.2
"""Time after the start in which no contact counts, as published: the motion itself disturbs the forces."""
CONTACT_S: Final = 0.05
"""Time for which the gap of the contact is kept, and its greatest force taken."""
CLOSE, TOUCH, LOAD, KEEP = range(4)
"""Stages: close until both pads touch, stay there, reach the force, hold."""
SLIP_BIT, PLACE_BIT, UNFELT_BIT, LIMIT_BIT = 8, 16, 128, 256


class HoldingPlan(NamedTuple):
    """What a controller does after the contact (0 or 1 each), with the settings of these names."""

    loads: int
    grabs: int
    slips: int
    places: int
    force_n: float
    hardness: float
    lightest_n: float
    force_limit_n: float
    close_speed_m_s: float
    closed_gap_m: float
    deformation_limit_m: float
    force_tolerance_n: float
    speed_tolerance_m_s: float
    settle_s: float
    find_timeout_s: float
    force_timeout_s: float
    place_after_s: float
    place_timeout_s: float


class Params(NamedTuple):
    """Parameters of the step; `kind` is the command kind that it sends."""

    kind: int
    plan: HoldingPlan
    filters: Filters
    thresholds: EventThresholds
    servo: Servo
    position: PositionServo


class Stage(NamedTuple):
    """What the controller does. Times are those of frames (s): since when, and since when the fingers settle."""

    number: int
    since_s: float
    settling_s: float


class HeldContact(NamedTuple):
    """The gap at the contact (before it, at the start), the greatest force of the contact, and the force asked for."""

    contact_m: float
    contact_n: float
    target_n: float


class Progress(NamedTuple):
    """How far a grasp is."""

    phase: int
    outcome: int
    stage: Stage
    contact: HeldContact


class State(NamedTuple):
    """State of the step; `wanted_m` is where the position servo is to be."""

    phase: int
    outcome: int
    events: int
    progress: Progress
    wanted_m: float
    signals: Signals
    conditions: TouchConditions


def state_of(
    progress: Progress, events: int, wanted_m: float, signals: Signals, now: TouchConditions
) -> State:
    """Return the state of a grasp that is so far."""
    return State(
        phase=progress.phase,
        outcome=progress.outcome,
        events=events,
        progress=progress,
        wanted_m=wanted_m,
        signals=signals,
        conditions=now,
    )


NOT_BEGUN: Final = -1


def step(params: Params, state: State, reading: Reading) -> tuple[Command, State]:
    """Close until both pads touch, then load, hold and let go as planned."""
    frame, earlier, wanted = reading.frame, state.progress, state.wanted_m
    if earlier.stage.number == NOT_BEGUN:
        earlier = Progress(
            APPROACH, RUNNING, Stage(CLOSE, frame.t_s, frame.t_s), HeldContact(frame.gap_m, 0.0, 0.0)
        )
        wanted = frame.gap_m
    signals = updated(params.filters, state.signals, reading)
    now = conditions(params.thresholds, signals)
    progress = earlier
    if earlier.outcome == RUNNING or earlier.outcome == STEADY:
        if earlier.stage.number == CLOSE:
            progress = closing(params.plan, earlier, now, frame)
        elif earlier.stage.number == TOUCH:
            progress = touching(params.plan, earlier, frame)
        elif earlier.stage.number == LOAD:
            progress = loading(params.plan, earlier, signals, frame)
        else:
            progress = keeping(params, earlier, signals, now, frame)
    events = begun(state.conditions, now)
    if earlier.stage.number != KEEP:
        events &= ~SLIP_BIT
    if progress.contact.target_n >= params.plan.force_limit_n > earlier.contact.target_n:
        events |= LIMIT_BIT
    if params.plan.places == 1:
        if (
            progress.stage.number == KEEP
            and earlier.stage.number == LOAD
            and signals.acceleration.present == 0
        ):
            events |= UNFELT_BIT
        if progress.outcome == STEADY and earlier.outcome == RUNNING:
            events |= PLACE_BIT
    command, wanted = commanded(params, progress, wanted, frame)
    return command, state_of(progress, events, wanted, signals, now)


def detect(params: Params, state: State, reading: Reading) -> tuple[Command, State]:
    """Tell the events of this reading, whatever the grasp does, and command nothing.

    A grasp ends after the longest time until a thing is put down; events are told beyond it.
    """
    signals = updated(params.filters, state.signals, reading)
    now, earlier = conditions(params.thresholds, signals), state.conditions
    stage, since_s, t_s = state.progress.stage.number, state.progress.stage.since_s, reading.frame.t_s
    if state.signals.left.begun == 0:
        since_s = t_s
    events = begun(earlier, now)
    present = signals.acceleration.present
    if placed(params.thresholds, now, present) and not placed(params.thresholds, earlier, present):
        events |= PLACE_BIT
    if stage == NOT_BEGUN and state.signals.left.begun == 1 and signals.fresh == 1:
        stage = KEEP
        if present == 0:
            events |= UNFELT_BIT
    outcome = NEVER_STEADY if t_s - since_s > params.plan.place_timeout_s else RUNNING
    progress = Progress(APPROACH, outcome, Stage(stage, since_s, since_s), HeldContact(0.0, 0.0, 0.0))
    return Command(EFFORT, 0.0, inf, inf), state_of(progress, events, 0.0, signals, now)


def ended(now: Progress, outcome: int) -> Progress:
    """Return this progress with an outcome."""
    return Progress(now.phase, outcome, now.stage, now.contact)


def closing(plan: HoldingPlan, now: Progress, seen: TouchConditions, frame: Frame) -> Progress:
    """Close until both pads touch, or it is clear that they will not."""
    elapsed = frame.t_s - now.stage.since_s
    if elapsed >= IGNORED_S and seen.left == 1 and seen.right == 1:
        force_n = 0.5 * (frame.force_left_n + frame.force_right_n)
        return Progress(
            SQUEEZE, RUNNING, Stage(TOUCH, frame.t_s, frame.t_s), HeldContact(frame.gap_m, force_n, 0.0)
        )
    if frame.gap_m <= plan.closed_gap_m:
        return ended(now, NOTHING_THERE)
    if elapsed > max(plan.find_timeout_s, 1.5 * now.contact.contact_m / plan.close_speed_m_s):
        return ended(now, ONE_FINGER if seen.left + seen.right == 1 else NOTHING_THERE)
    return now


def touching(plan: HoldingPlan, now: Progress, frame: Frame) -> Progress:
    """Take the greatest force while the gap of the contact is kept, and choose the force of the grip from it."""
    phase, outcome, (stage, since, settling), (contact_m, contact_n, target_n) = now
    contact_n = max(contact_n, 0.5 * (frame.force_left_n + frame.force_right_n))
    if frame.t_s - since >= CONTACT_S:
        if plan.loads == 0:
            phase, outcome = HOLD, STEADY
        else:
            stage, since, settling = LOAD, frame.t_s, frame.t_s
            target_n = min(max(plan.force_n, plan.lightest_n), plan.force_limit_n)
            if plan.grabs == 1:
                target_n = grab_force(
                    contact_n, plan.close_speed_m_s, plan.hardness, plan.lightest_n, plan.force_limit_n
                )
    return Progress(
        phase, outcome, Stage(stage, since, settling), HeldContact(contact_m, contact_n, target_n)
    )


def loading(plan: HoldingPlan, now: Progress, signals: Signals, frame: Frame) -> Progress:
    """Wait until the weaker finger has its force and the fingers are at rest."""
    phase, outcome, (stage, since, settling), (contact_m, contact_n, target_n) = now
    error_n = target_n - min(frame.force_left_n, frame.force_right_n)
    reached = abs(error_n) < plan.force_tolerance_n and abs(signals.speed_m_s) < plan.speed_tolerance_m_s
    if not reached:
        settling = frame.t_s
    if frame.gap_m <= plan.closed_gap_m:
        outcome = SLIPPED
    elif frame.t_s - settling > plan.settle_s:
        phase, stage, since = HOLD, KEEP, frame.t_s
        outcome = RUNNING if plan.places == 1 else STEADY
    elif frame.t_s - since > plan.force_timeout_s:
        outcome = NEVER_STEADY
    return Progress(
        phase, outcome, Stage(stage, since, settling), HeldContact(contact_m, contact_n, target_n)
    )


def keeping(params: Params, now: Progress, signals: Signals, seen: TouchConditions, frame: Frame) -> Progress:
    """Hold, with more force where the thing slips, until it is lost or put down."""
    phase, outcome, (stage, since, settling), (contact_m, contact_n, target_n) = now
    plan, held_s = params.plan, frame.t_s - since
    weaker_n = min(signals.left.force_n, signals.right.force_n)
    if weaker_n < plan.lightest_n - 0.25 or frame.gap_m <= plan.closed_gap_m:
        return ended(now, SLIPPED)
    if plan.slips == 1:
        target_n = raised_force(target_n, seen.slip, frame.dt_s, plan.force_limit_n)
    if plan.places == 1 and outcome == RUNNING and held_s >= plan.place_after_s:
        if placed(params.thresholds, seen, signals.acceleration.present):
            outcome = STEADY
        elif held_s > plan.place_timeout_s:
            outcome = NEVER_STEADY
    return Progress(
        phase, outcome, Stage(stage, since, settling), HeldContact(contact_m, contact_n, target_n)
    )


def commanded(params: Params, now: Progress, wanted_m: float, frame: Frame) -> tuple[Command, float]:
    """Return the command of this stage, and the gap (m) that the position servo is to reach."""
    plan, rate = params.plan, 0.0
    if now.stage.number == CLOSE:
        rate = -plan.close_speed_m_s
    elif now.stage.number >= LOAD:
        rate = force_rate(params.servo, now.contact.target_n, frame.force_left_n, frame.force_right_n)
        if rate < 0.0 and frame.gap_m <= now.contact.contact_m - plan.deformation_limit_m:
            rate = 0.0
    bound, limit = params.position.bound_m, params.position.effort_limit_n
    wanted_m += rate * frame.dt_s
    if now.stage.number == TOUCH:
        wanted_m = now.contact.contact_m
    wanted_m = min(max(wanted_m, frame.gap_m - bound), frame.gap_m + bound)
    command = Command(VELOCITY, rate, limit, inf)
    if params.kind == POSITION:
        command = Command(POSITION, max(wanted_m, 0.0), limit, plan.close_speed_m_s)
    elif params.kind == EFFORT:
        effort = servo_effort(params.position, frame.gap_m, frame.velocity_m_s, wanted_m, rate)
        command = Command(EFFORT, effort, inf, inf)
    return command, wanted_m


ConfigT = TypeVar("ConfigT", bound=FindContactConfig)


class _Romano(Controller[ConfigT]):
    """What the controllers of this package share; a subclass says what its law does after the contact."""

    requires: ClassVar[tuple[Channel, ...]] = CHANNELS
    commands = ("effort",)
    alternatives: ClassVar[tuple[str, ...]] = ("velocity", "position")
    becomes: ClassVar[Mapping[str, str]] = {
        "velocity": "the rate of the gap that its force servo gives",
        "position": "the gap that its force servo gives, with the greatest force that is allowed",
    }
    events = EVENTS
    step = staticmethod(step)
    does: ClassVar[tuple[int, int, int, int]]
    """Whether it loads, takes the force from the contact, adds force on slip, and lets go when put down."""

    def asked_force_n(self) -> float | None:
        """Return the greatest force (N) that is asked for."""
        return float(self.config.force_limit_n)

    def gentlest_force_n(self) -> float | None:
        """Return the least force (N) of a grip."""
        return float(self.config.lightest_n)

    def asked_speed_m_s(self) -> float | None:
        """Return the closing speed (m/s)."""
        return float(self.config.close_speed_m_s)

    def contact_force_n(self) -> float:
        """Return the force (N) from which on a pad touches."""
        return float(self.config.lightest_n - 0.25)

    def params(self) -> Params:
        """Return the parameters of the step. Settings that only other laws have stand in it without an effect."""
        config = PlaceConfig(**asdict(self.config))
        own = {key: float(value) for key, value in asdict(config).items() if not isinstance(value, str)}
        closing, opening = own["closing_gain_m_s_per_newton"], own["opening_gain_m_s_per_newton"]
        loads, grabs, slips, places = self.does
        return Params(
            kind=KINDS[config.sends],
            plan=HoldingPlan(loads, grabs, slips, places, **_of(HoldingPlan._fields, own)),
            filters=FILTERS,
            thresholds=EventThresholds(
                **_of(EventThresholds._fields, own), place_by=PLACE_BY.index(config.place_by)
            ),
            servo=Servo(opening, closing, FASTEST_M_S),
            position=PositionServo(
                **_of(PositionServo._fields, own),
                bound_m=BOUND_M,
                effort_limit_n=EFFORT_SHARE * config.force_limit_n + config.friction_n,
            ),
        )

    def init(self) -> State:
        """Return the state before the first tick."""
        progress = Progress(APPROACH, RUNNING, Stage(NOT_BEGUN, 0.0, 0.0), HeldContact(0.0, 0.0, 0.0))
        return state_of(progress, 0, 0.0, NO_SIGNALS, NOTHING)

    def reason(self, state: Any) -> str:
        """Return with which force a thing was lost, and whether the force limit cannot hold it."""
        asked_n, limit_n = state.progress.contact.target_n, float(self.config.force_limit_n)
        if state.outcome != SLIPPED:
            return ""
        if asked_n >= limit_n:
            return f"too heavy or too smooth for {limit_n:g} N (controller.force_limit_n)"
        return f"lost at {asked_n:.1f} N, before controller.force_limit_n ({limit_n:g} N) was reached"


def _of(names: Iterable[str], own: Mapping[str, float]) -> dict[str, float]:
    """Return the settings of these names, where there are any."""
    return {name: own[name] for name in names if name in own}


FASTEST_M_S: Final = 0.5
BOUND_M: Final = 0.03
EFFORT_SHARE: Final = 1.25
"""The position servo may exceed the force limit by a quarter, plus friction, as the effort ceiling does."""


class FindContact(_Romano[FindContactConfig]):
    """Closes until both pads touch, and stays there."""

    does = (0, 0, 0, 0)


class ForceServo(_Romano[ForceServoConfig]):
    """Closes, and brings the weaker finger to a force."""

    does = (1, 0, 0, 0)


class SlipServo(_Romano[SlipServoConfig]):
    """Closes, holds with a light force, and adds force whenever the thing slips."""

    does = (1, 0, 1, 0)


class Grab(_Romano[GrabConfig]):
    """Closes, chooses the force from the contact, and adds force whenever the thing slips."""

    does = (1, 1, 1, 0)


class Release(_Romano[ReleaseConfig]):
    """Holds with a force until the thing is put down, and then opens."""

    does = (1, 0, 0, 1)


class PickAndPlace(_Romano[PlaceConfig]):
    """Grabs, holds what an arm lifts, adds force on slip, and opens when the thing is put down."""

    does = (1, 1, 1, 1)


class EventDetector(_Romano[PlaceConfig]):
    """Tells the events in what it reads, and commands nothing: for recordings of others."""

    requires = (Channel("force_left", "N"), Channel("force_right", "N"))
    alternatives = ()
    step = staticmethod(detect)
    does = (0, 0, 0, 0)

    def asked_force_n(self) -> None:
        """Return None: it asks for no force."""

    gentlest_force_n = asked_speed_m_s = asked_force_n
