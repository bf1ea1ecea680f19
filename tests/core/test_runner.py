"""The runner: order of things, every way out, and a gripper that is never left squeezing."""

import gc
import signal
import time
from functools import partial
from itertools import count, groupby
from math import inf, nan
from threading import Event
from types import SimpleNamespace

import pytest
from attrs import evolve
from cases import every_case
from grippers import CONTACT_S, REST_S, Scripted, bottle, law, squeezing

from graspsense.core.components.run_config import RunConfig
from graspsense.core.grasp import interrupts, runner
from graspsense.core.grasp.runner import MAY_BE_CLOSED, run_grasp
from graspsense.core.values.errors import ComponentFailed, NoDevice, RecordingEnded, TareRefused
from graspsense.core.values.signals import EFFORT, RUNNING, VELOCITY, Command, Outcome, Phase, Reading
from graspsense.plugins.controllers.hybrid import HybridConfig, HybridController
from graspsense.testing import laws

HYBRID = HybridController(HybridConfig())
RUN = RunConfig()


@pytest.fixture
def no_wall_clock(monkeypatch):
    """Nothing ends because it takes long on this machine: what counts is the gripper's own clock."""
    monkeypatch.setattr(runner, "time", SimpleNamespace(perf_counter=lambda: 0.0))


class Changed(Scripted):
    """A gripper whose readings are what `change(gripper, reading)` makes of them."""

    def __init__(self, change, **options):
        super().__init__(squeezing, bottle, **options)
        self.change = change

    def read(self, timeout_s):
        return self.change(self, super().read(timeout_s))


def with_frame(**changes):
    """Return a change of a reading; `changes` are functions of its frame."""

    def change(gripper, reading):
        frame = reading.frame
        return reading._replace(frame=frame._replace(**{key: now(frame) for key, now in changes.items()}))

    return change


def raises_signal(number, *ticks):
    """Return a change of a reading that sends this signal to this process in these ticks."""

    def change(gripper, reading):
        if gripper.k in ticks:
            signal.raise_signal(number)
        return reading

    return change


def phases_of(grasp):
    return [Phase(phase) for phase, _ in groupby(grasp.trace.phase.tolist())]


@pytest.fixture(scope="module")
def ordinary():
    """A grasp that nothing disturbs: the gripper, the grasp, and the events that were heard while it went on."""
    gripper, heard = Scripted(squeezing, bottle), []
    return gripper, run_grasp(gripper, HYBRID, RUN, on_event=heard.append), heard


def test_a_grasp_from_opening_to_release(ordinary):
    gripper, grasp, heard = ordinary
    assert tuple(heard) == grasp.events
    assert grasp.outcome is Outcome.STEADY
    assert phases_of(grasp) == [Phase.APPROACH, Phase.SQUEEZE, Phase.HOLD, Phase.RELEASE]
    assert [event.what for event in grasp.trace.events] == ["contact"]
    told = [event.what for event in grasp.events if event.source == "runner" and "guard" not in event.what]
    assert told == ["opening", "taring", "approach", "squeeze", "hold", "release"]
    assert (gripper.opened, gripper.closed) == (1, 1)
    # Three whole images, all of them taken after the taring began.
    assert [len(images) for images in gripper.tares] == [3]
    assert gripper.tares[0][0].t_s > 0.1
    # Opened first and last, then relaxed; the probing force in between.
    values = [command.value for command in gripper.commands]
    assert (values[0], 20.0 in values, let_go(gripper)) == (-20.0, True, True)
    # The fingers open from 54 to 80 mm at 50 mm/s. The release ends when the gap has stood still for 0.1 s, and then
    # there is one more command: fingers that are open are not opened again.
    assert values[::-1].index(20.0) - 1 == pytest.approx(520 + 101, abs=2)


class ActsLate(Scripted):
    """A gripper that opens 0.2 s after it is told to."""

    command_delay_s = 0.25

    def __init__(self):
        super().__init__(squeezing, lambda t: bottle(t - self.command_delay_s))
        self.told_s = inf

    def apply(self, command):
        super().apply(command)
        t = self.k * 0.001
        if command.value == -20.0 and t > REST_S + self.command_delay_s:
            self.told_s = min(self.told_s, t)

    def gap_m(self, t):
        return min(squeezing(t - self.command_delay_s) + 0.1 * max(t - self.told_s - 0.2, 0.0), 0.074)


def test_a_gripper_that_acts_late_is_not_taken_for_open_before_it_moves():
    grasp = run_grasp(ActsLate(), HYBRID, RUN)
    assert grasp.outcome is Outcome.STEADY
    assert phases_of(grasp)[-1] is Phase.RELEASE
    assert grasp.trace.gap_m[-1] == pytest.approx(0.074)


def test_contact_and_rest_are_where_the_script_puts_them_and_the_hold_lasts_as_long_as_asked():
    grasp = run_grasp(Scripted(squeezing, bottle), HYBRID, RunConfig(hold_s=0.5))
    squeeze, held = (grasp.trace.t_s[grasp.trace.phase == phase] for phase in (Phase.SQUEEZE, Phase.HOLD))
    assert squeeze[0] == pytest.approx(CONTACT_S, abs=0.0011)
    # At rest is known once the window of 50 ms is full.
    assert squeeze[-1] == pytest.approx(REST_S + 0.05, abs=0.002)
    assert held[-1] - held[0] == pytest.approx(0.5, abs=0.003)


def let_go(gripper):
    """Whether the last commands opened the fingers and then relaxed."""
    values = [c.value for c in gripper.commands]
    return values[-1] == 0.0 and -20.0 in values[-110:]


@pytest.mark.slow
@every_case("tick", [0, 1, 50, 200, 600, 1200, 1600, 1850])
def test_a_device_lost_in_any_phase_is_an_outcome_with_the_trace_to_the_last_frame(tick):
    gripper = Scripted(squeezing, bottle, lose_at=tick)
    grasp = run_grasp(gripper, HYBRID, RUN)
    # At rest since 1.55 s, the grasp is steady; the hold ends at 1.8 s, and then the fingers are opening.
    reason = "unplugged" + (" (after the grasp had ended: steady)" if tick >= 1600 else "")
    # Without a frame of the approach, the fingers have not closed.
    reason += f"; {MAY_BE_CLOSED}" if len(grasp.trace) else ""
    assert (grasp.outcome, grasp.reason, gripper.closed) == (Outcome.DEVICE_LOST, reason, 1)
    if tick == 1200:  # in the squeeze, it is told to open, which it may hear, and to relax
        assert [c.value for c in gripper.commands[-2:]] == [-20.0, 0.0]
    if tick <= 1600:
        assert len(grasp.trace) == 0 or grasp.trace.t_s[-1] == pytest.approx((tick - 1) * 0.001)


def test_a_slow_gripper_has_three_of_its_own_periods_for_a_frame():
    class Slow(Scripted):
        """Reports five times a second, and keeps whoever asks for less than a period waiting in vain."""

        def open(self, seed):
            return evolve(super().open(seed), rate_hz=5.0)

        def read(self, timeout_s):
            self.asked_s = timeout_s
            return super().read(timeout_s) if timeout_s >= 0.2 else None

    slow = Slow(squeezing, bottle, clock="device")
    assert run_grasp(slow, HYBRID, RUN).outcome != Outcome.DEVICE_LOST
    assert slow.asked_s == pytest.approx(0.6)


@every_case("silent_from", [0, 700])
def test_a_silent_device_is_lost_too(silent_from):
    gripper = Scripted(squeezing, bottle, clock="device", silent_from=silent_from)
    grasp = run_grasp(gripper, HYBRID, RUN)
    assert grasp.outcome == Outcome.DEVICE_LOST
    assert all(part in grasp.reason for part in ("for 100 ms", "1000 Hz", "run.frame_timeout_s"))
    # It may still hear what it is told, though nothing comes back.
    assert (gripper.commands[-1].value, gripper.closed) == (0.0, 1)


def fail(*values, error=ZeroDivisionError):
    raise error


@pytest.mark.slow
@every_case(
    ("error", "reason"),
    [
        (KeyboardInterrupt(), "interrupted"),
        (ZeroDivisionError("no"), "ZeroDivisionError: no"),
        (SystemExit(3), "SystemExit: 3"),
    ],
)
@every_case("after", [1, 900, 1100])
def test_whatever_stops_the_loop_the_fingers_are_opened(error, reason, after):
    gripper = Scripted(squeezing, bottle)
    grasp = run_grasp(gripper, law(partial(fail, error=error), after), RUN)
    assert (grasp.outcome, reason in grasp.reason) == (Outcome.ABORTED, True)
    assert (let_go(gripper), gripper.closed) == (True, 1)


def spin(*values):
    while True:
        pass


@pytest.mark.slow
@every_case("hangs", [lambda *values: Event().wait(), spin])
@every_case("after", [900, 1100])
def test_a_step_that_never_ends_is_ended_and_the_fingers_are_opened(monkeypatch, hangs, after):
    monkeypatch.setattr(interrupts, "STUCK_S", 0.5)
    gripper = Scripted(squeezing, bottle)
    grasp = run_grasp(gripper, law(hangs, after), RUN)
    assert (grasp.outcome, "did not end" in grasp.reason, grasp.interrupted) == (
        Outcome.ABORTED,
        True,
        False,
    )
    assert (let_go(gripper), gripper.closed, len(grasp.trace) > 500) == (True, 1, True)


@every_case(("tick", "outcome"), [(1200, Outcome.ABORTED), (1700, Outcome.ABORTED), (1850, Outcome.STEADY)])
def test_a_grasp_that_is_interrupted_while_the_fingers_open_keeps_its_outcome(tick, outcome):
    """The hold ends at 1.8 s."""
    gripper = Changed(raises_signal(signal.SIGINT, tick))
    grasp = run_grasp(gripper, HYBRID, RUN)
    assert (grasp.outcome, grasp.interrupted, "interrupted" in grasp.reason) == (outcome, True, True)
    assert let_go(gripper)


@pytest.mark.slow
def test_a_step_that_fails_or_returns_no_command_is_named_with_what_it_returns():
    def ends_in(command, state, phase, outcome):
        return command, state._replace(phase=phase, outcome=int(outcome))

    failures = [
        (fail, "ZeroDivisionError", 900),
        (lambda command, state: command, "ValueError", 900),
        (lambda command, state: (None, state), "TypeError", 900),
        (lambda command, state: (command, None), "AttributeError", 900),
    ]
    # A phase that there is not, and those of the runner, also at the beginning and in the hold.
    for phase in (99, int(Phase.OPENING), int(Phase.TARING), int(Phase.RELEASE), None):
        for outcome in (RUNNING, Outcome.STEADY):
            failures.append((partial(ends_in, phase=phase, outcome=outcome), f"the phase {phase}", 1))
    for act, error, tick in failures:
        grasp = run_grasp(Scripted(squeezing, bottle), law(act, tick), RUN)
        assert grasp.outcome is Outcome.ABORTED
        for part in ("law.<locals>.step of the controller", error, "(Command, state)"):
            assert part in grasp.reason


def test_a_command_that_is_no_number_ends_the_grasp_safely():
    gripper = Scripted(squeezing, bottle)
    grasp = run_grasp(gripper, law(lambda command, state: (command._replace(value=nan), state), 300), RUN)
    assert (grasp.outcome, "NaN" in grasp.reason, let_go(gripper)) == (Outcome.ABORTED, True, True)
    assert all(c.value == c.value for c in gripper.commands)
    assert any("commanded NaN" in event.what for event in grasp.events)


def test_a_refused_tare_aborts_before_anything_closes():
    gripper = Scripted(squeezing, bottle)
    gripper.tare = partial(fail, error=TareRefused("the left pad is loaded"))
    grasp = run_grasp(gripper, HYBRID, RUN)
    assert (grasp.outcome, grasp.reason) == (Outcome.ABORTED, "the left pad is loaded")
    assert all(c.value <= 0.0 for c in gripper.commands)


def test_pads_that_never_report_end_the_taring_in_time():
    gripper = Changed(lambda gripper, reading: reading._replace(pads=reading.pads._replace(counter=7)))
    gripper.tare = lambda images: images or fail(error=TareRefused("no cell image came"))
    grasp = run_grasp(gripper, HYBRID, RunConfig(opening_timeout_s=1.0))
    assert (grasp.outcome, grasp.reason) == (Outcome.ABORTED, "no cell image came")


class Recorded(Scripted):
    """A recording of so many ticks."""

    def __init__(self, path, felt, length):
        super().__init__(path, felt)
        self.length = length

    def open(self, seed):
        return evolve(super().open(seed), opening=None, tare_images=0)

    def read(self, timeout_s):
        if self.k >= self.length - 1:
            raise RecordingEnded
        return super().read(timeout_s)


@pytest.mark.slow
@every_case(
    ("length", "outcome"),
    [
        (0, Outcome.NOTHING_THERE),
        (500, Outcome.NOTHING_THERE),
        (1200, Outcome.NEVER_STEADY),
        (1600, Outcome.STEADY),  # at rest since 1.55 s, held until 1.8 s
        (3000, Outcome.STEADY),
    ],
)
def test_a_recording_ends_as_what_it_showed(length, outcome):
    assert run_grasp(Recorded(squeezing, bottle, length), HYBRID, RUN).outcome is outcome


@pytest.mark.slow
def test_late_frames_are_counted_on_a_device_clock_only():
    def late(late_s, clock):
        jerky = Changed(
            lambda gripper, reading: (
                with_frame(dt_s=lambda frame: late_s)(gripper, reading) if gripper.k % 100 == 50 else reading
            ),
            clock=clock,
            lose_at=700,
        )
        return run_grasp(jerky, HYBRID, RUN).counts["late"]

    assert late(0.006, "device") == 5  # of the 450 ticks from the approach on
    assert late(0.006, "virtual") == late(5.0 / 1000.0, "device") == 0


def test_a_fault_that_ends_the_grasp_opens_the_fingers_in_the_tick_that_shows_it():
    # Five times what the gripper says of its frames.
    sparse = Changed(with_frame(dt_s=lambda frame: 0.005), clock="device", lose_at=700)
    grasp = run_grasp(sparse, HYBRID, RUN)
    assert (grasp.outcome, "80 % of the frames" in grasp.reason) == (Outcome.ABORTED, True)
    values = [command.value for command in sparse.commands]
    closing = max(k for k, value in enumerate(values) if value > 0.0)
    assert values[closing + 1] == -20.0


def test_a_real_gripper_is_held_weak_until_first_contact():
    gripper = Scripted(squeezing, bottle, clock="device")
    grasp = run_grasp(gripper, HYBRID, RUN)
    assert not any("squeeze limited" in warning for warning in grasp.warnings)
    held = [c.value for c in gripper.commands[: int(CONTACT_S * 1000)]]
    assert max(held) <= RUN.first_effort_n
    assert max(c.value for c in gripper.commands) == 20.0


def test_every_tick_reaches_the_sinks_and_one_that_fails_decides_nothing():
    ticks = []
    full_disk = SimpleNamespace(take=partial(fail, error=OSError("No space left on device")))
    leaving = SimpleNamespace(take=partial(fail, error=SystemExit(3)))
    sink = SimpleNamespace(take=lambda reading, phase, command: ticks.append(reading))
    grasp = run_grasp(Scripted(squeezing, bottle), HYBRID, RUN, sinks=[full_disk, leaving, sink])
    assert grasp.outcome is Outcome.STEADY
    assert len(ticks) == len(grasp.trace) == grasp.counts["ticks"]
    said = [event.what.partition(" failed: ")[2] for event in grasp.events if "failed" in event.what]
    assert said == ["OSError: No space left on device", "SystemExit: 3"]


def test_however_often_somebody_interrupts_the_trace_is_kept_and_the_gripper_let_go():
    class Hammered(Scripted):
        """Ctrl-C at one tick of the squeeze, and then at every call that lets go."""

        begun = False

        def hammer(self):
            if self.begun or self.k == 1200:
                self.begun = True
                signal.raise_signal(signal.SIGINT)

        def read(self, timeout_s):
            reading = super().read(timeout_s)
            self.hammer()
            return reading

        def apply(self, command):
            super().apply(command)
            self.hammer()

        def close(self):
            self.hammer()
            super().close()

    gripper = Hammered(squeezing, bottle)
    grasp = run_grasp(gripper, HYBRID, RUN)
    assert (grasp.outcome, grasp.reason) == (Outcome.ABORTED, f"interrupted; {MAY_BE_CLOSED}")
    assert len(grasp.trace) > 900
    assert (gripper.commands[-1].value, gripper.closed) == (0.0, 1)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_other_ends_of_a_session_let_go_too_and_tell_who_listened_before(number):
    heard, gripper = [], Changed(raises_signal(number, 1200))
    handler = signal.signal(number, lambda number, frame: heard.append(number))
    try:
        grasp = run_grasp(gripper, HYBRID, RUN)
    finally:
        signal.signal(number, handler)
    assert (grasp.outcome, heard, let_go(gripper)) == (Outcome.ABORTED, [number], True)


@every_case(("stops_s", "outcome"), [(1.2, Outcome.ABORTED), (1.82, Outcome.STEADY)])
def test_a_device_whose_clock_stands_still_does_not_squeeze_nor_open_for_ever(stops_s, outcome):
    stopped = with_frame(
        t_s=lambda frame: min(frame.t_s, stops_s),
        dt_s=lambda frame: frame.dt_s * (frame.t_s <= stops_s),
        gap_m=lambda frame: squeezing(min(frame.t_s, stops_s)),
    )
    gripper = Changed(stopped, clock="device")
    grasp = run_grasp(gripper, HYBRID, RunConfig(grasp_timeout_s=20.0, opening_timeout_s=0.2))
    assert (grasp.outcome, gripper.commands[-1].value) == (outcome, 0.0)
    assert "clock stands still" in " ".join(grasp.warnings)
    assert len(grasp.trace) < 3000


@every_case(
    ("opened", "error", "says"),
    [
        (partial(fail, error=NoDevice("looked for a gripper")), NoDevice, None),
        (partial(fail, error=FileNotFoundError()), OSError, "was running"),
        (lambda seed: None, ComponentFailed, "returned None: return graspsense.plugin_api.DeviceInfo"),
    ],
)
def test_a_gripper_that_cannot_be_opened_is_an_error_that_names_it_and_no_outcome(opened, error, says):
    gripper = Scripted(squeezing, bottle)
    gripper.open = opened
    with pytest.raises(error) as raised:
        run_grasp(gripper, HYBRID, RUN)
    *_, text = str(raised.value), *getattr(raised.value, "__notes__", [])
    assert says is None or text == f"`open` of the gripper grippers.Scripted {says}"
    assert gripper.closed == 1


def test_no_garbage_is_collected_within_a_grasp_and_again_after_it():
    collects: set[bool] = set()
    watching = Changed(lambda gripper, reading: collects.add(gc.isenabled()) or reading, lose_at=300)
    assert gc.isenabled()
    run_grasp(watching, HYBRID, RUN)
    assert (collects, gc.isenabled()) == ({False}, True)


def test_who_asks_is_told_what_was_opened_before_anything_moves_and_may_refuse():
    gripper, told = Scripted(squeezing, bottle, lose_at=300), []
    run_grasp(gripper, HYBRID, RUN, on_open=lambda info: told.append((info.name, len(gripper.commands))))
    assert told == [("scripted", 0)]

    def refuse(info):
        raise NoDevice(f"not {info.name}")

    gripper = Scripted(squeezing, bottle)
    with pytest.raises(NoDevice, match="not scripted"):
        run_grasp(gripper, HYBRID, RUN, on_open=refuse)
    assert (gripper.commands, gripper.closed) == ([], 1)


def test_a_recording_is_heard_to_its_end_however_long():
    # Longer than any grasp may take; nothing in it ends the approach, as its clock stands still.
    class Long(Recorded):
        def read(self, timeout_s):
            frame, pads, _ = super().read(timeout_s)
            return Reading(frame._replace(t_s=0.0, gap_m=0.05), pads)

    run = RunConfig(grasp_timeout_s=0.5, opening_timeout_s=0.1)
    grasp = run_grasp(Long(squeezing, lambda t: (0.0, 0.0), 2001), HYBRID, run)
    assert (grasp.outcome, grasp.counts["ticks"]) == (Outcome.NOTHING_THERE, 2001)


@pytest.mark.usefixtures("no_wall_clock")
def test_an_endless_grasp_ends_after_the_grasp_and_three_openings_and_not_before():
    class Endless(HybridController):
        @staticmethod
        def step(params, state, reading):
            return Command(EFFORT, 5.0, inf, inf), state

    gripper = Scripted(lambda t: 0.05, lambda t: (9.0, 9.0))
    grasp = run_grasp(gripper, Endless(HybridConfig()), RunConfig(grasp_timeout_s=2.0, opening_timeout_s=0.5))
    assert grasp.outcome is Outcome.ABORTED
    assert grasp.reason.startswith("no end after 3.5 s of ticks")
    assert "run.grasp_timeout_s" in grasp.reason
    assert let_go(gripper)
    # Every tick of the loop commands, then the opening: 0.1 s of stillness at first, at most half a second at the end.
    assert 3500 + 100 <= len(gripper.commands) <= 3500 + 502


def test_the_simulated_time_is_from_the_first_frame_to_the_last_and_that_on_the_wall_what_it_took():
    # A clock that does not begin at 0.
    later = Changed(with_frame(t_s=lambda frame: frame.t_s + 40.0), lose_at=51)
    began = time.perf_counter()
    grasp = run_grasp(later, HYBRID, RUN)
    assert 0.0 < grasp.seconds_wall <= time.perf_counter() - began
    assert grasp.seconds_simulated == pytest.approx(0.050)
    assert run_grasp(Scripted(squeezing, bottle, lose_at=0), HYBRID, RUN).seconds_simulated == 0.0
    assert run_grasp(Scripted(squeezing, bottle, clock="device"), HYBRID, RUN).seconds_simulated is None


def test_one_interrupt_opens_the_fingers_and_a_second_only_relaxes_them():
    def openings(*ticks):
        gripper = Changed(raises_signal(signal.SIGINT, *ticks))
        run_grasp(gripper, HYBRID, RUN)
        return sum(command.value == -20.0 for command in gripper.commands[1200:])

    assert openings(1200) >= 100  # until they have stood open for 0.1 s
    assert openings(1200, 1201) == 1


@every_case(("stands_still", "openings"), [(False, 2000), (True, 200)])
def test_restless_fingers_are_relaxed_after_the_opening_time(monkeypatch, stands_still, openings):
    """By the clock of the gripper; where that stands still, by the one on the wall, of which a frame takes 10 ms."""

    def restless(gripper, reading):
        """Opens and opens after a failure at 1.2 s: the gap never stands still."""
        if gripper.k < 1201:
            return reading
        if gripper.k == 1201:
            raise ZeroDivisionError
        gripper.wall_s += 0.01 * stands_still
        t_s = reading.frame.t_s
        gap_m = 0.05 + 0.01 * (gripper.k % 2) + 0.1 * (t_s - 1.2)
        return reading._replace(frame=reading.frame._replace(gap_m=gap_m, t_s=1.2 if stands_still else t_s))

    gripper = Changed(restless)
    gripper.wall_s = 0.0
    monkeypatch.setattr(runner, "time", SimpleNamespace(perf_counter=lambda: gripper.wall_s))
    grasp = run_grasp(gripper, HYBRID, RunConfig(opening_timeout_s=2.0))
    opening = [c for c in gripper.commands[1200:] if c.value == -20.0]
    assert len(opening) == pytest.approx(openings, abs=3)
    assert gripper.commands[-1].value == 0.0
    assert (grasp.outcome, "in core/test_runner.py:" in grasp.reason) == (Outcome.ABORTED, True)


def test_a_gripper_that_returns_no_reading_is_named():
    reason = run_grasp(Changed(lambda gripper, reading: reading.frame), HYBRID, RUN).reason
    assert "read returned Frame" in reason


def pushing(effort_limit_n):
    """A law that closes by a velocity, with this limit of the effort, until the gap rests."""

    def step(params, state, reading):
        return Command(VELOCITY, -0.01, effort_limit_n, inf), laws.step(params, state, reading)[1]

    law = type("Pushing", (laws.GentleController,), {"step": staticmethod(step)})
    law.asked_force_n = lambda self: effort_limit_n
    return law(VELOCITY)


@every_case("force_n", [15.0, 60.0])
def test_a_squeeze_under_the_limits_of_a_first_use_is_told(force_n):
    """Without pads these are equal grasps, and nobody is to call them equally good."""
    gripper = Scripted(squeezing, lambda t: (nan, nan), clock="device")
    grasp = run_grasp(gripper, pushing(force_n), RUN)
    closing = [command for command in gripper.commands if command.value == -0.01]
    assert {command.effort_limit_n for command in closing} == {RUN.first_effort_n}
    # It is said once and counted each time; the opening of 20 N is lowered to 12 N as well.
    assert grasp.counts["guarded"] == len(grasp.trace)
    said = [event.what for event in grasp.events if event.what.startswith("guard")]
    assert said == ["guard: a command was limited"]
    (told,) = [warning for warning in grasp.warnings if "run.first_effort_n" in warning]
    assert "no pad" in told


def test_an_effort_limit_above_the_ceiling_counts_and_is_told():
    understating = pushing(90.0)
    type(understating).asked_force_n = lambda self: 20.0
    grasp = run_grasp(Scripted(squeezing, bottle, clock="device"), understating, RUN)
    (told,) = [warning for warning in grasp.warnings if "squeeze limited" in warning]
    assert "run.effort_ceiling_n" in told
    assert "25.0 N" in told
    assert grasp.counts["guarded"] >= (grasp.trace.phase == Phase.SQUEEZE).sum()


@pytest.mark.slow
def test_fingers_that_a_release_has_not_opened_are_told_again():
    """They do not hear the first 700 commands that open them."""
    gripper, told = Scripted(squeezing, bottle), count()
    heard = gripper.apply
    gripper.apply = lambda command: (
        None if gripper.closes and command.value < 0.0 and next(told) < 700 else heard(command)
    )
    grasp = run_grasp(gripper, HYBRID, RUN)
    assert gripper.opens_from_s < gripper.k * 0.001
    assert (grasp.outcome, grasp.reason) == (Outcome.STEADY, "")
