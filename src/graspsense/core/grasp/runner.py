"""The runner: it opens the gripper, runs one grasp tick by tick, and leaves the gripper safe.

A grasp opens the fingers, tares, closes under the controller, holds, and opens again. In each tick the runner reads a
frame, computes the command and limits it, applies it, and passes the tick to the sinks. On every way out (end of the
grasp, error, Ctrl-C) the gripper is commanded to open and then to relax, also if it no longer answers: it may hear. It
is then closed.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from math import ceil, inf
from typing import TYPE_CHECKING, Any, Final

from attrs import frozen

from graspsense.core.components.delivered import Delivered
from graspsense.core.components.roles import Controller, SensorBackend
from graspsense.core.components.run_config import RunConfig
from graspsense.core.control.binding import bind, maker
from graspsense.core.control.contact import RestState, at_rest, update_rest
from graspsense.core.control.garbage_collection import no_collection
from graspsense.core.control.guard import GuardParams, GuardState, StepFailed, guard, with_plain_commands
from graspsense.core.control.tick import (
    OPEN_SPEED_M_S,
    OPEN_WINDOW_S,
    RELEASE,
    TARING,
    Schedule,
    TickParams,
    TickState,
    events_of,
    first_state,
    stopped,
    tick,
)
from graspsense.core.grasp.interrupts import STUCK_S, Interrupts
from graspsense.core.grasp.opened_gripper import (
    described,
    frame_timeout_s,
    no_frame,
    opened_gripper,
    overdue,
    seconds_at_most,
)
from graspsense.core.grasp.sinks import DeviceSink, EventSink, PictureSink, Sink, Watcher
from graspsense.core.values.device import DeviceInfo
from graspsense.core.values.errors import FAILURES, DeviceLost, RecordingEnded, TareRefused, named, place_of
from graspsense.core.values.faults import LIMITED, Fault, faults_among
from graspsense.core.values.features import Prediction
from graspsense.core.values.signals import (
    APPROACH,
    HOLD,
    NO_GAP,
    RUNNING,
    SQUEEZE,
    Command,
    EventSource,
    Frame,
    GraspEvent,
    Outcome,
    Pads,
    Phase,
    Reading,
    event_name,
)
from graspsense.core.values.trace import SI_UNITS, Trace, TraceRecorder

if TYPE_CHECKING:
    from graspsense.core.grasp.protection.protection import Protection


@frozen(kw_only=True, eq=False)
class Grasp:
    """The result of the runner: the trace and the outcome. `warnings` are the faults that were seen, in words."""

    trace: Trace
    outcome: Outcome
    reason: str
    device: DeviceInfo
    report: Mapping[str, Any]
    counts: Mapping[str, int]
    events: tuple[GraspEvent, ...]
    seconds_simulated: float | None
    seconds_wall: float
    warnings: tuple[str, ...] = ()
    interrupted: bool = False
    """Whether the user asked for an end; a signal during the release leaves the outcome as it was."""


def tick_params(info: DeviceInfo, controller: Controller[Any], run: RunConfig) -> TickParams:
    """Return the parameters of one grasp of this gripper under this controller."""
    real = info.clock == "device"
    return TickParams(
        schedule=Schedule(
            opens=1 if info.opening is not None else 2 * info.has_release,
            opening=info.opening if info.opening is not None else info.relaxed,
            relaxed=info.relaxed,
            tare_images=info.tare_images,
            hold_s=run.hold_s,
            opening_timeout_s=run.opening_timeout_s,
        ),
        guard=GuardParams(
            effort_limit_n=info.effort_limit_n,
            speed_limit_m_s=info.speed_limit_m_s,
            first_effort_n=run.first_effort_n if real else inf,
            first_speed_m_s=run.first_speed_m_s if real else inf,
            contact_force_n=controller.contact_force_n(),
        ),
        law=controller.params(),
    )


def ended_by_itself(stopped: int, outcome: int) -> tuple[Outcome, str]:
    """Return the outcome of a grasp that its controller or the guard ended, and the reason if it needs one.

    `stopped`: that of the guard (`GuardState`); `outcome`: that of the controller.
    """
    if stopped:
        return Outcome.ABORTED, NO_COMMAND
    try:
        return Outcome(outcome), ""
    except ValueError:
        return (
            Outcome.ABORTED,
            f"the controller ended the grasp with the outcome {outcome!r}, which there is not",
        )


def run_grasp(
    backend: SensorBackend[Any],
    controller: Controller[Any],
    run: RunConfig,
    *,
    sinks: Iterable[Sink] = (),
    on_event: Callable[[GraspEvent], None] | None = None,
    on_open: Callable[[DeviceInfo], None] | None = None,
    watcher: Watcher | None = None,
) -> Grasp:
    """Run one grasp and return it, whatever its outcome.

    `on_open` is called with the description of the opened gripper before any command; an exception from it ends the
    run. `watcher` sees each tick and can end the squeeze, which the release follows as usual. Raises NoDevice if the
    gripper cannot be opened. Every later failure is an outcome.
    """
    began = time.perf_counter()
    with Interrupts() as interrupts:
        try:
            sinks = tuple(sinks)
            _announce(backend, controller, run, sinks)
            info = opened_gripper(backend, run.seed)
            info = described(info, backend, controller, run)
            if on_open is not None:
                on_open(info)
            grasp = _Grasp(backend, controller, run, info, sinks, on_event, interrupts)
            if watcher is not None:
                grasp.watch_with(watcher)
            with no_collection():
                outcome, reason = grasp.drive()
        except BaseException:
            backend.close()
            raise
        # The trace must survive a backend that fails on closing. Ctrl-C is only counted by now.
        try:
            backend.close()
        except BaseException as error:
            reason = f"the gripper could not be closed: {named(error)} ({reason or outcome.words})"
            outcome = Outcome.ABORTED
        # After closing, so that the report covers it.
        report = _report_of(backend)
    frames = grasp.recorder.frames
    losses = {} if grasp.protection is None else grasp.protection.losses.lost
    losses = {f"lost_{name}": count for name, count in losses.items()}
    commands = backend.recorded_commands()
    if commands is not None:
        grasp.recorder.commands[:] = commands[: len(frames)]
    return Grasp(
        trace=grasp.recorder.trace(),
        outcome=outcome,
        reason=grasp.why(reason),
        device=info,
        report={**report, **losses},
        counts={"ticks": len(frames), "late": grasp.late, "guarded": grasp.guarded, **losses},
        events=tuple(grasp.events),
        seconds_simulated=grasp.seconds() if info.clock == "virtual" else None,
        seconds_wall=time.perf_counter() - began,
        warnings=grasp.warnings(),
        interrupted=grasp.interrupted or interrupts.count > 0,
    )


def _report_of(backend: SensorBackend[Any]) -> dict[str, Any]:
    """Return the report of a gripper, or why it has none."""
    try:
        return dict(backend.report())
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        return {"report_failed": named(error)}


def run_uninterrupted(
    backend: SensorBackend[Any],
    controller: Controller[Any],
    run: RunConfig,
    *,
    on_event: Callable[[GraspEvent], None] | None = None,
    on_open: Callable[[DeviceInfo], None] | None = None,
) -> Grasp:
    """Run one grasp as `run_grasp` does, for a caller that has no use for an interrupted one.

    Raises KeyboardInterrupt, after the gripper was released, if the user asked for an end.
    """
    grasp = run_grasp(backend, controller, run, on_event=on_event, on_open=on_open)
    if grasp.interrupted:
        raise KeyboardInterrupt
    return grasp


def _announce(
    backend: SensorBackend[Any], controller: Controller[Any], run: RunConfig, sinks: Iterable[Sink]
) -> None:
    """Tell a gripper, before it is opened, of the next grasp and of who wants to see it."""
    backend.expect(controller, run)
    for sink in sinks:
        if isinstance(sink, PictureSink):
            backend.see(sink)


NO_COMMAND: Final = (
    "the controller commanded NaN, a limit below 0, a kind that there is not, or a position without end, so the guard "
    "stopped the grasp"
)
MOSTLY: Final = 0.1
"""Share of the commands of a squeeze from which on it is not the one that the controller commanded."""
UNHEARD_S: Final = 1.0
"""Time for which a gripper that does not answer is told to open."""
OPENED: Final = "opened to"
"""How the event begins that tells that the fingers are known to be open."""
MAY_BE_CLOSED: Final = "the fingers may still be closed: look at them, and open them by hand"
STUCK: Final = (
    f"a tick did not end in {STUCK_S:g} s: the controller, or what watches or records the grasp, hangs, or this "
    "program was stopped; look at its loops and at what it waits for"
)


class _GraspFailed(Exception):
    """A grasp that took longer than the limit, or a reading that is not what the gripper declares."""


class _Grasp:
    """The state of a running grasp, which the loop and the ways out of it share."""

    def __init__(
        self,
        backend: SensorBackend[Any],
        controller: Controller[Any],
        run: RunConfig,
        info: DeviceInfo,
        sinks: Iterable[Sink],
        on_event: Callable[[GraspEvent], None] | None,
        interrupts: Interrupts,
    ) -> None:
        self.backend, self.run, self.info, self.on_event = backend, run, info, on_event
        self.watcher: Watcher | None = None
        self.stop_reason = ""
        self.sinks, self.interrupts, self.interrupted = list(sinks), interrupts, False
        self.controller, self.step = controller, type(controller).step
        self.event_names = type(controller).events
        self.params = tick_params(info, controller, run)
        self.protection = None if info.harmless else self._protection()
        self.delivered = Delivered(info.channels)
        self.state: TickState = first_state(controller.init())
        self.recorder = TraceRecorder({**SI_UNITS, **info.units})
        self.events: list[GraspEvent] = []
        self.late = self.guarded = self.squeezed = self.squeezed_guarded = self.release_ticks = 0
        self.failed_sinks: list[str] = []
        self.may_be_closed = False
        self.first_t_s: float | None = None
        self.last: Frame | None = None

    def _protection(self) -> Protection:
        # Imported here: a pure model, as most grasps are of, needs none.
        from graspsense.core.grasp.protection.protection import Protection

        return Protection(
            self.info, self.controller, self.run, self._fault_seen, self.backend.command_delay_s
        )

    def watch_with(self, watcher: Watcher) -> None:
        """Let this watcher see the ticks from the contact on."""
        self.watcher = watcher
        watcher.begin(self.recorder, self.info, self._predicted)

    def _show_device(self) -> None:
        """Tell the sinks of the gripper."""
        for sink in self.sinks:
            if isinstance(sink, DeviceSink):
                try:
                    sink.opened(self.info)
                except FAILURES as error:
                    self._drop(sink, error, 0.0, Phase.OPENING)

    def drive(self) -> tuple[Outcome, str]:
        """Run the loop and return the outcome. The gripper was then commanded to open or relax."""
        self._show_device()
        # A program in a debugger stands still too, so only where there is something to hurt.
        if not self.info.simulated and not self.info.harmless:
            self.interrupts.watch()
        try:
            self._loop()
            ending: tuple[Outcome, str] | None = None
        except DeviceLost as error:
            ending = Outcome.DEVICE_LOST, str(error)
        except RecordingEnded:
            ending = self._recording_ended()
        except (TareRefused, _GraspFailed, StepFailed) as error:
            ending = Outcome.ABORTED, str(error)
        except KeyboardInterrupt:
            self.interrupted = not self.interrupts.stuck
            ending = Outcome.ABORTED, "interrupted" if self.interrupted else STUCK
        except BaseException as error:
            # A controller or a driver can raise anything, also the CancelledError of an asynchronous one: the gripper
            # must still be released and the trace kept.
            ending = Outcome.ABORTED, f"{named(error)}{place_of(error)}"
        finally:
            self.interrupts.deferred = True
            self.interrupts.tick_ended()
            fault = self._fault()
            self._let_go(opens=fault is None or not fault.relaxes)
        if ending is None and fault is not None and self.protection is not None:
            ending = fault.outcome, self.protection.cause_of(fault).told
        if ending is None:
            ending = ended_by_itself(self.state.guard.stopped, self.state.law.outcome)
            if ending[0] is Outcome.SIDE_IMPACT and self.protection is not None:
                ending = ending[0], self.protection.side_impact
        failed = ending[0] in (Outcome.DEVICE_LOST, Outcome.ABORTED)
        if self.stop_reason and not failed:
            return Outcome.RECOGNISED, self.stop_reason
        if self.state.law.outcome != RUNNING and failed:
            own_ending, unknown = ended_by_itself(0, self.state.law.outcome)
            if not unknown and self.interrupted and self.state.phase == RELEASE:
                # The grasp had its outcome, and the fingers were opened nevertheless.
                return own_ending, f"{ending[1]} while the fingers opened"
            if not unknown:
                ending = ending[0], f"{ending[1]} (after the grasp had ended: {own_ending.words})"
        return ending

    def seconds(self) -> float:
        """Return the time (s) from the first frame to the last, by the clock of the gripper."""
        return 0.0 if self.last is None or self.first_t_s is None else self.last.t_s - self.first_t_s

    def why(self, reason: str) -> str:
        """Return this reason, or what the controller says of the end, with what a person must know besides.

        That is whether the fingers may still be closed, which frames were lost, and which sinks failed.
        """
        try:
            reason = reason or str(self.controller.reason(self.state.law))
        except FAILURES as error:
            reason = f"reason failed: {named(error)}"
        lost = "" if self.protection is None else self.protection.lost
        closed = MAY_BE_CLOSED if self.may_be_closed else ""
        return "; ".join(filter(None, (reason, closed, lost, *self.failed_sinks)))

    def _loop(self) -> None:
        apply, run = self.backend.apply, self.run
        step = with_plain_commands(self.step)
        advance = bind(tick, step=step, events_told=events_of(self.step), TickState=maker(TickState))
        params, record = self.params, self.recorder.add
        on_device_clock = self.info.clock == "device"
        late_s = run.late_periods / self.info.rate_hz if on_device_clock else inf
        timeout_s = frame_timeout_s(run, self.info)
        state, phase, watcher = self.state, self.state.phase, self.state.guard
        images: list[Pads] = []
        newest = n_ticks = 0
        most_ticks = self._most_ticks(seconds_at_most(run))
        while n_ticks < most_ticks:
            n_ticks += 1
            reading = self._read(timeout_s)
            frame, pads, _ = reading
            self.last = frame
            if self.first_t_s is None:
                self.first_t_s = frame.t_s
            acted = self._acted(state)
            command, state = advance(params, state, reading)
            self.state = state = self._not_yet_at_rest(state)
            stepped, same_phase = phase != TARING, state.phase == phase
            if not stepped and pads.counter > newest:
                newest = pads.counter
                images.append(pads)
            if not same_phase:
                if phase == TARING and not self._tared(images, frame):
                    return
                phase, newest = state.phase, pads.counter
                self._event(frame.t_s, Phase(phase), Phase(phase).name.lower())
            if state.guard is not watcher:
                watcher = self._guard_event(frame, watcher, state.guard)
            protected_phase = phase if stepped else TARING
            if self.protection is not None:
                command = self.protection.limit(reading, protected_phase, command)
            # The frame that ended the taring still has forces relative to the old zero.
            recorded = phase >= APPROACH and stepped
            if recorded:
                self.late += frame.dt_s > late_s
                self._count(phase, self._acted(state) > acted)
            try:
                apply(command)
            finally:
                # Also if the gripper is lost at this moment: the frame was measured.
                if recorded:
                    record(reading, phase, command)
                if self.protection is not None:
                    self.protection.watch(reading, protected_phase, command)
                    if state.done:
                        self.protection.released(frame)
                if state.events:
                    self._told(frame, phase, state.events)
                if recorded and self.sinks:
                    self._show(reading, phase, command)
            if recorded and self.watcher is not None and phase < RELEASE and not state.done:
                state = self._watched(self.watcher, frame, state)
            if state.done or watcher.stopped or self._fault() is not None:
                return
        raise _GraspFailed(overdue(run))

    def _read(self, timeout_s: float) -> Reading:
        """Return the next reading, with which a tick begins. It came, and is what the gripper declares."""
        self.interrupts.tick_ended()
        reading = self.backend.read(timeout_s)
        self.interrupts.tick_begins()
        if reading is None:
            raise DeviceLost(no_frame(self.run, self.info))
        if problem := self.delivered.problem(reading):
            raise _GraspFailed(f"{self.info.name} delivered what it does not declare: {problem}")
        return reading

    def _not_yet_at_rest(self, state: TickState) -> TickState:
        """Return a state in which fingers that open rest at the earliest when the gripper has acted on the command.

        Those that stand still until then, or still close, would otherwise count as open, and be stopped there.
        """
        if state.phase not in (Phase.OPENING, RELEASE):
            return state
        self.release_ticks += state.phase == RELEASE
        # By a clock that stands still it would have no end. Frames can come faster than declared.
        if self.release_ticks > self._most_ticks(3.0 * self.run.opening_timeout_s):
            return state._replace(done=1)
        delay_s = self.backend.command_delay_s
        if state.phase == RELEASE and self.protection is not None:
            # A gap that is told late, or that is wrong, stands still for longer.
            delay_s = self.protection.opening.unknown_s(state.still.gap_m)
        still, earliest_s = state.still, state.since_t_s + delay_s
        if still.since_t_s >= earliest_s:
            return state
        return state._replace(still=RestState(earliest_s, still.gap_m))

    def _most_ticks(self, seconds: float) -> float:
        """Return the number of ticks that a grasp or its release may take; a recording ends by itself.

        Ticks are counted, since the clock of a device may stand still, and the squeeze must end nevertheless.
        """
        return inf if self.info.opening is None else ceil(seconds * self.info.rate_hz)

    def _show(self, reading: Reading, phase: int, command: Command) -> None:
        """Pass a tick to the sinks."""
        for sink in self.sinks:
            try:
                sink.take(reading, phase, command)
            except FAILURES as error:
                self._drop(sink, error, reading.frame.t_s, Phase(phase))

    def _drop(self, sink: Sink, error: BaseException, t_s: float, phase: Phase) -> None:
        """Drop a sink that failed: the grasp goes on, and the reason of its outcome names the sink."""
        self.sinks = [other for other in self.sinks if other is not sink]
        self.failed_sinks.append(f"{type(sink).__name__} failed: {named(error)}")
        self._event(t_s, phase, self.failed_sinks[-1])

    def _tared(self, images: list[Pads], frame: Frame) -> bool:
        """Set the zero of the pads; return whether the fingers may close."""
        self.backend.tare(images)
        return self.protection is None or self.protection.before_closing(frame) is None

    def _acted(self, state: TickState) -> int:
        """Return the number of commands that guard and protection have limited so far."""
        return state.guard.acted + (0 if self.protection is None else self.protection.acted)

    def _fault(self) -> Fault | None:
        """Return the fault that ended the grasp, if one did."""
        return None if self.protection is None else self.protection.ending

    def _fault_seen(self, fault: Fault) -> None:
        """Log a fault of the gripper at its first sight."""
        t_s = 0.0 if self.last is None else self.last.t_s
        phase = Phase(max(self.state.phase, Phase.OPENING))
        self._event(t_s, phase, f"{'fault' if fault.ends else 'warning'}: {fault.told}")

    def _guard_event(self, frame: Frame, earlier: GuardState, now: GuardState) -> GuardState:
        """Log an action of the guard at its first time, and return its state."""
        if now.stopped and not earlier.stopped:
            self._event(frame.t_s, Phase(self.state.phase), f"guard: {NO_COMMAND}")
        elif now.acted and not earlier.acted:
            self._event(frame.t_s, Phase(self.state.phase), "guard: a command was limited")
        return now

    def _count(self, phase: int, limited: bool) -> None:
        """Count a command, and whether guard or protection limited it."""
        self.guarded += limited
        if phase in (SQUEEZE, HOLD):
            self.squeezed += 1
            self.squeezed_guarded += limited

    def warnings(self) -> tuple[str, ...]:
        """Return the faults that were seen, and that the squeeze was not the one that the controller commanded."""
        seen, unclear = (
            ((), 0) if self.protection is None else (self.protection.warnings, self.protection.unclear)
        )
        # A fault of the pads is told, and not that it made a contact unclear.
        limited = self.squeezed_guarded - (unclear if faults_among(seen) else 0)
        if limited <= MOSTLY * self.squeezed:
            return seen
        why = f"the limits of the gripper are {self.info.effort_limit_n:g} N and {self.info.speed_limit_m_s:g} m/s"
        guard_params = self.params.guard
        if not self.state.guard.contact_seen and guard_params.first_effort_n < inf:
            why = (
                f"no pad has felt a contact, so run.first_effort_n ({guard_params.first_effort_n:g} N) and "
                f"run.first_speed_m_s ({guard_params.first_speed_m_s:g} m/s) held throughout"
            )
        elif unclear > 0.5 * limited:
            why = "one pad felt nothing, or a contact had no witness, so the effort of the approach held"
        elif self.protection is not None and self.protection.acted:
            why = f"the ceiling is {self.protection.ceiling_n:.1f} N; run.effort_ceiling_n allows more"
        told = f"{LIMITED}: {limited} of its {self.squeezed} commands were lowered; {why}"
        # With its share, instead of the first sight of it.
        return (*faults_among(seen), told)

    def _told(self, frame: Frame, phase: int, events: int) -> None:
        """Log the events that the controller told in this tick, one for each bit that is set."""
        for i in range(events.bit_length()):
            if events >> i & 1:
                event = self._event(frame.t_s, Phase(phase), event_name(self.event_names, i), "controller")
                self.recorder.events.append(event)

    def _event(
        self,
        t_s: float,
        phase: Phase,
        what: str,
        source: EventSource = "runner",
        prediction: Prediction | None = None,
    ) -> GraspEvent:
        event = GraspEvent(t_s, phase, what, source, prediction)
        self.events.append(event)
        if self.on_event is not None:
            self.on_event(event)
        for sink in self.sinks:
            if isinstance(sink, EventSink):
                try:
                    sink.event(event)
                except FAILURES as error:
                    self._drop(sink, error, t_s, phase)
        return event

    def _watched(self, watcher: Watcher, frame: Frame, state: TickState) -> TickState:
        """Return the state after this tick: that of a release if the watcher has a reason to stop the squeeze."""
        self.stop_reason = watcher.watch(frame, state.phase)
        if self.stop_reason:
            self.state = state = stopped(self.params.schedule, state, frame)
        return state

    def _predicted(self, t_s: float, phase: int, what: str, prediction: Prediction | None) -> None:
        """Log a prediction that was made while the grasp goes on."""
        self._event(t_s, Phase(phase), what, "model", prediction)

    def _let_go(self, *, opens: bool) -> None:
        """Open the fingers, then relax, and tell how they were left. A failure of one step must not prevent the next.

        With `opens` false, because the motor would close them, it only relaxes, as it does with open fingers. Fingers
        that a release has not opened are told once more: the gripper may not have heard it.
        """
        left = "let go, not opened"
        opens = opens and self.state.phase >= APPROACH and not (self.state.done and self._is_open())
        try:
            if opens and self.info.opening is not None and self.last is not None:
                left = self._opened(self.info.opening, self.last)
        except BaseException:
            pass
        with suppress(BaseException):
            self.backend.apply(self.info.relaxed)
        if self.info.opening is None or self.last is None:
            return
        if self.protection is not None and self.recorder.frames:
            self.may_be_closed = not (self._is_open() and (self.state.done or left.startswith(OPENED)))
        if not self.state.done:
            self._event(self.last.t_s, Phase(self.state.phase), left)

    def _is_open(self) -> bool:
        """Return whether the last frame shows open fingers, where that matters."""
        return (
            self.last is None or self.protection is None or self.protection.opening.is_open(self.last.gap_m)
        )

    def _opened(self, opening: Command, last: Frame) -> str:
        """Open the fingers, and return in words whether they came to rest."""
        info, run = self.info, self.run
        still, began_s = RestState(last.t_s + self.backend.command_delay_s, last.gap_m), last.t_s
        heard = time.perf_counter()
        give_up, answers = heard + run.opening_timeout_s, False
        fresh = GuardState(1, 0, 0)
        if self.protection is not None:
            opening = self.protection.opens_with(opening)
        # After a second Ctrl-C, only relax.
        while time.perf_counter() < min(give_up, heard + UNHEARD_S) and self.interrupts.count < 2:
            command, fresh = guard(self.params.guard, fresh, last, opening)
            reading = None
            with suppress(*FAILURES):
                self.backend.apply(command)
                reading = self.backend.read(frame_timeout_s(run, info))
            if answers := reading is not None:
                heard = time.perf_counter()
            else:
                time.sleep(1.0 / info.rate_hz)
                continue
            if self.protection is not None and self.protection.opens_wrongly(reading, command):
                break
            self.last = last = reading.frame
            still = update_rest(still, last.t_s, last.gap_m, OPEN_SPEED_M_S, OPEN_WINDOW_S)
            unknown_s = 0.0 if self.protection is None else self.protection.opening.unknown_s(last.gap_m)
            rests = at_rest(still, last.t_s, OPEN_WINDOW_S) and last.t_s - began_s >= unknown_s
            # A motor that has not heard the command may hear it later.
            if rests and self._is_open():
                return f"{OPENED} {last.gap_m * 1e3:.1f} mm"
            if last.t_s - began_s > run.opening_timeout_s:
                break
        why = "" if answers else ": the gripper does not answer"
        return f"let go at {last.gap_m * 1e3:.1f} mm, not known to be open{why}"

    def _recording_ended(self) -> tuple[Outcome, str]:
        if self.state.law.outcome != RUNNING:
            return ended_by_itself(self.state.guard.stopped, self.state.law.outcome)
        if self.state.law.phase == SQUEEZE and self.info.units.get("gap") == NO_GAP:
            return Outcome.FORCE_ONLY, "no gap was recorded, so whether the fingers came to rest is not known"
        if self.state.law.phase == SQUEEZE:
            return Outcome.NEVER_STEADY, "the recording ended before the fingers came to rest"
        return Outcome.NOTHING_THERE, "the recording ended before both pads were in contact"
