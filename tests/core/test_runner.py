"""The runner: order of things, every way out, and a gripper that is never left squeezing."""

import gc
import math
import signal
import time
from math import inf, nan
from pathlib import Path
from types import SimpleNamespace

import pytest
from attrs import evolve
from cases import every_case
from grippers import CONTACT_S, REST_S, Scripted, bottle, squeezing

from graspsense.core.components.run_config import RunConfig
from graspsense.core.grasp import runner
from graspsense.core.grasp.runner import run_grasp
from graspsense.core.values.errors import NoDevice, RecordingEnded, TareRefused
from graspsense.core.values.signals import EFFORT, VELOCITY, Command, Outcome, Phase, Reading
from graspsense.plugins.controllers.hybrid import HybridConfig, HybridController
from graspsense.testing import gentle

HYBRID = HybridController(HybridConfig())
RUN = RunConfig()


@pytest.fixture
def no_wall_clock(monkeypatch):
    """Nothing ends because it takes long on this machine: what counts is the gripper's own clock."""
    monkeypatch.setattr(runner, "time", SimpleNamespace(perf_counter=lambda: 0.0))


def phases_of(grasp):
    seen = []
    for phase in grasp.trace.phase.tolist():
        if not seen or seen[-1] != phase:
            seen.append(phase)
    return [Phase(p) for p in seen]


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
    told = [event for event in grasp.events if event.source == "runner"]
    assert [event.what for event in told if "guard" not in event.what] == [
        "opening",
        "taring",
        "approach",
        "squeeze",
        "hold",
        "release",
    ]
    assert (gripper.opened, gripper.closed) == (1, 1)
    # Three whole images, all of them taken after the taring began.
    assert [len(images) for images in gripper.tares] == [3]
    assert gripper.tares[0][0].t_s > 0.1
    # Opened first and last, then relaxed; the probing force in between.
    assert gripper.commands[0].value == -20.0
    assert let_go(gripper)
    assert 20.0 in {c.value for c in gripper.commands}


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


@every_case("tick", [0, 1, 50, 200, 600, 1200, 1600, 1850])
def test_a_device_lost_in_any_phase_is_an_outcome_with_the_trace_to_the_last_frame(tick):
    gripper = Scripted(squeezing, bottle, lose_at=tick)
    grasp = run_grasp(gripper, HYBRID, RUN)
    assert grasp.outcome is Outcome.DEVICE_LOST
    # At rest since 1.55 s, the grasp is steady; the hold ends at 1.8 s, and then the fingers are opening.
    assert grasp.reason == "unplugged" + (" (after the grasp had ended: steady)" if tick >= 1600 else "")
    assert gripper.closed == 1
    if tick == 1200:  # in the squeeze, it is only told to relax
        assert [c.value for c in gripper.commands[-2:]] == [20.0, 0.0]
    if tick <= 1600:
        assert len(grasp.trace) == 0 or grasp.trace.t_s[-1] == pytest.approx((tick - 1) * 0.001)


def test_a_slow_gripper_has_three_of_its_own_periods_for_a_frame():
    class Slow(Scripted):
        """Reports five times a second, and keeps whoever asks for less than a period waiting in vain."""

        def open(self, seed):
            return evolve(super().open(seed), rate_hz=5.0)

        def read(self, timeout_s):
            self.asked_s = timeout_s
            return super().read(timeout_s) if timeout_s >= 0.2 and self.silent_from is None else None

    slow, silent = (
        Slow(squeezing, bottle, clock="device"),
        Slow(squeezing, bottle, clock="device", silent_from=0),
    )

    assert run_grasp(slow, HYBRID, RUN).outcome != Outcome.DEVICE_LOST
    assert slow.asked_s == pytest.approx(0.6)
    reason = run_grasp(silent, HYBRID, RUN).reason
    assert "no frame from scripted for 600 ms, although it declares 5 Hz" in reason
    assert "run.frame_timeout_s sets how long to wait" in reason


@pytest.mark.parametrize("silent_from", [0, 700])
def test_a_silent_device_is_lost_too(silent_from):
    gripper = Scripted(squeezing, bottle, clock="device", silent_from=silent_from)
    grasp = run_grasp(gripper, HYBRID, RUN)
    assert grasp.outcome is Outcome.DEVICE_LOST
    assert "no frame from scripted for 100 ms" in grasp.reason
    # It may still hear what it is told, though nothing comes back.
    assert gripper.commands[-1].value == 0.0
    assert gripper.closed == 1


def controller_that(act, after):
    """The hybrid law, but from its `after`-th step on `act` decides."""
    calls = [0]

    def step(params, state, reading):
        calls[0] += 1
        if calls[0] >= after:
            act()
        return HybridController.step(params, state, reading)

    class Faulty(HybridController):
        pass

    Faulty.step = staticmethod(step)
    return Faulty(HybridConfig())


def interrupt():
    raise KeyboardInterrupt


def fail():
    raise ZeroDivisionError("float division by zero")


def leave():
    raise SystemExit(3)


@every_case(
    ("act", "reason"),
    [(interrupt, "interrupted"), (fail, "ZeroDivisionError: float div"), (leave, "SystemExit: 3")],
)
@every_case("after", [1, 900, 1100])
def test_whatever_stops_the_loop_the_fingers_are_opened(act, reason, after):
    gripper = Scripted(squeezing, bottle)
    grasp = run_grasp(gripper, controller_that(act, after), RUN)
    assert grasp.outcome is Outcome.ABORTED
    assert reason in grasp.reason
    assert let_go(gripper)
    assert gripper.closed == 1


@every_case(("tick", "outcome"), [(1200, Outcome.ABORTED), (1700, Outcome.ABORTED), (1850, Outcome.STEADY)])
def test_a_grasp_that_is_interrupted_while_the_fingers_open_keeps_its_outcome(tick, outcome):
    """The hold ends at 1.8 s."""

    class Interrupted(Scripted):
        def read(self, timeout_s):
            if self.k == tick:
                signal.raise_signal(signal.SIGINT)
            return super().read(timeout_s)

    gripper = Interrupted(squeezing, bottle)
    grasp = run_grasp(gripper, HYBRID, RUN)
    assert grasp.outcome is outcome
    assert grasp.interrupted
    assert "interrupted" in grasp.reason
    assert let_go(gripper)


def test_a_step_that_fails_or_returns_no_command_is_named_with_what_it_returns():
    class Halved(HybridController):
        @staticmethod
        def step(params, state, reading):
            return Command(EFFORT, 5.0, math.inf, math.inf)

    class Lost(HybridController):
        @staticmethod
        def step(params, state, reading):
            return Command(EFFORT, 5.0, math.inf, math.inf), state._replace(phase=99)

    lost = run_grasp(Scripted(squeezing, bottle), Lost(HybridConfig()), RUN)
    assert lost.outcome is Outcome.ABORTED
    assert "the controller gave the phase 99" in lost.reason
    for controller, error in (
        (controller_that(fail, 900), "ZeroDivisionError"),
        (Halved(HybridConfig()), "ValueError"),
    ):
        grasp = run_grasp(Scripted(squeezing, bottle), controller, RUN)
        assert grasp.outcome is Outcome.ABORTED
        for part in ("test_runner", "step of the controller", error, "(Command, state)"):
            assert part in grasp.reason


def test_a_command_that_is_no_number_ends_the_grasp_safely():
    class Broken(HybridController):
        @staticmethod
        def step(params, state, reading):
            command, state = HybridController.step(params, state, reading)
            return command._replace(value=nan if reading.frame.t_s > 0.5 else 5.0), state

    gripper = Scripted(squeezing, bottle)
    grasp = run_grasp(gripper, Broken(HybridConfig()), RUN)
    assert grasp.outcome is Outcome.ABORTED
    assert "NaN" in grasp.reason
    assert all(c.value == c.value for c in gripper.commands)
    assert let_go(gripper)
    assert any("commanded NaN" in event.what for event in grasp.events)


def test_a_refused_tare_aborts_before_anything_closes():
    class Loaded(Scripted):
        def tare(self, images):
            raise TareRefused("the left pad is loaded")

    gripper = Loaded(squeezing, bottle)
    grasp = run_grasp(gripper, HYBRID, RUN)
    assert (grasp.outcome, grasp.reason) == (Outcome.ABORTED, "the left pad is loaded")
    assert all(c.value <= 0.0 for c in gripper.commands)


def test_pads_that_never_report_end_the_taring_in_time():
    class Padless(Scripted):
        def read(self, timeout_s):
            frame, pads, _ = super().read(timeout_s)
            return Reading(frame, pads._replace(counter=7))

        def tare(self, images):
            if not images:
                raise TareRefused("no cell image came")

    grasp = run_grasp(Padless(squeezing, bottle), HYBRID, RunConfig(opening_timeout_s=1.0))
    assert grasp.outcome is Outcome.ABORTED
    assert "no cell image" in grasp.reason


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


def test_late_frames_are_counted_on_a_device_clock_only():
    class Jerky(Scripted):
        late_s = 0.006

        def read(self, timeout_s):
            frame, pads, _ = super().read(timeout_s)
            return Reading(frame._replace(dt_s=self.late_s) if self.k % 100 == 50 else frame, pads)

    class JustInTime(Jerky):
        late_s = 5.0 / 1000.0

    def late(gripper, clock):
        return run_grasp(gripper(squeezing, bottle, clock=clock, lose_at=700), HYBRID, RUN).counts["late"]

    assert late(Jerky, "device") == 5  # of the 450 ticks from the approach on
    assert late(Jerky, "virtual") == late(JustInTime, "device") == 0


def test_a_fault_that_ends_the_grasp_opens_the_fingers_in_the_tick_that_shows_it():
    class Sparse(Scripted):
        def read(self, timeout_s):
            frame, pads, _ = super().read(timeout_s)
            return Reading(frame._replace(dt_s=0.005), pads)  # five times what the gripper says of its frames

    sparse = Sparse(squeezing, bottle, clock="device", lose_at=700)
    grasp = run_grasp(sparse, HYBRID, RUN)
    assert (grasp.outcome, "80 % of the frames are missing" in grasp.reason) == (Outcome.ABORTED, True)
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
    class FullDisk:
        def take(self, reading, phase, command):
            raise OSError("No space left on device")

    class Leaving:
        def take(self, reading, phase, command):
            raise SystemExit(3)

    ticks = []
    sink = SimpleNamespace(take=lambda reading, phase, command: ticks.append(reading))
    grasp = run_grasp(Scripted(squeezing, bottle), HYBRID, RUN, sinks=[FullDisk(), Leaving(), sink])
    assert grasp.outcome is Outcome.STEADY
    assert len(ticks) == len(grasp.trace) == grasp.counts["ticks"]
    said = [event.what for event in grasp.events if "failed" in event.what]
    assert said == ["FullDisk failed: OSError: No space left on device", "Leaving failed: SystemExit: 3"]


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
    assert (grasp.outcome, grasp.reason) == (Outcome.ABORTED, "interrupted")
    assert len(grasp.trace) > 900
    assert gripper.commands[-1].value == 0.0
    assert gripper.closed == 1
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_other_ends_of_a_session_let_go_too_and_tell_who_listened_before(number):
    class Ended(Scripted):
        def read(self, timeout_s):
            if self.k == 1200 and not heard:
                signal.raise_signal(number)
            return super().read(timeout_s)

    heard = []
    handler = signal.signal(number, lambda number, frame: heard.append(number))
    try:
        gripper = Ended(squeezing, bottle)
        grasp = run_grasp(gripper, HYBRID, RUN)
    finally:
        signal.signal(number, handler)
    assert (grasp.outcome, heard) == (Outcome.ABORTED, [number])
    assert let_go(gripper)


def test_a_device_whose_clock_stands_still_does_not_squeeze_for_ever():
    class Frozen(Scripted):
        def read(self, timeout_s):
            frame, pads, _ = super().read(timeout_s)
            return Reading(
                frame._replace(t_s=min(frame.t_s, 1.2), gap_m=squeezing(min(frame.t_s, 1.2))), pads
            )

    gripper = Frozen(squeezing, bottle, clock="device")
    grasp = run_grasp(gripper, HYBRID, RunConfig(grasp_timeout_s=2.0, opening_timeout_s=0.2))
    assert grasp.outcome is Outcome.ABORTED
    assert gripper.commands[-1].value == 0.0


def absent(self, seed):
    raise NoDevice("looked for a gripper")


@every_case(
    ("opened", "says"),
    [
        (absent, "was running"),
        (lambda self, seed: Path("/dev/no-such-port").read_bytes(), "was running"),
        (lambda self, seed: None, "returned None: return graspsense.plugin_api.DeviceInfo"),
    ],
)
def test_a_gripper_that_cannot_be_opened_is_an_error_that_names_it_and_no_outcome(opened, says):
    gripper = type("Unready", (Scripted,), {"open": opened})(squeezing, bottle)
    with pytest.raises((NoDevice, OSError, TypeError)) as raised:
        run_grasp(gripper, HYBRID, RUN)
    *_, text = str(raised.value), *getattr(raised.value, "__notes__", [])
    assert opened is absent or text == f"`open` of the gripper {type(gripper).__module__}.Unready {says}"
    assert gripper.closed == 1


def test_no_garbage_is_collected_within_a_grasp_and_again_after_it():
    class Watching(Scripted):
        def apply(self, command):
            collects.add(gc.isenabled())
            super().apply(command)

    collects: set[bool] = set()
    assert gc.isenabled()
    run_grasp(Watching(squeezing, bottle, lose_at=300), HYBRID, RUN)
    assert collects == {False}
    assert gc.isenabled()
    gc.disable()
    try:
        run_grasp(Scripted(squeezing, bottle, lose_at=300), HYBRID, RUN)
        assert not gc.isenabled(), "it was off before, and is nobody's to turn on"
    finally:
        gc.enable()


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
    assert grasp.outcome is Outcome.NOTHING_THERE
    assert grasp.counts["ticks"] == 2001


@pytest.mark.usefixtures("no_wall_clock")
def test_an_endless_grasp_ends_after_the_grasp_and_three_openings_and_not_before():
    class Endless(HybridController):
        @staticmethod
        def step(params, state, reading):
            return Command(EFFORT, 5.0, math.inf, math.inf), state

    gripper = Scripted(lambda t: 0.05, lambda t: (9.0, 9.0))
    grasp = run_grasp(gripper, Endless(HybridConfig()), RunConfig(grasp_timeout_s=2.0, opening_timeout_s=0.5))
    assert grasp.outcome is Outcome.ABORTED
    assert grasp.reason.startswith("no end after 3.5 s of ticks")
    assert "run.grasp_timeout_s" in grasp.reason
    assert let_go(gripper)
    # Every tick of the loop commands, then the opening: 0.1 s of stillness at first, at most half a second at the end.
    assert 3500 + 100 <= len(gripper.commands) <= 3500 + 502


def test_what_holds_for_a_grasp_unless_told():
    run = RunConfig()
    assert (run.seed, run.hold_s, run.late_periods) == (0, 0.25, 5.0)
    # Seconds: to open, without a frame, and for the longest grasp.
    assert (run.opening_timeout_s, run.frame_timeout_s, run.grasp_timeout_s) == (5.0, 0.1, 300.0)
    # A real gripper closes for the first time above its breakaway (8 N), far below a squeeze, and slowly.
    assert (run.first_effort_n, run.first_speed_m_s) == (12.0, 0.015)
    assert RunConfig(grasp_timeout_s=1e-9).grasp_timeout_s == 1e-9
    for value in (0.0, -1.0, math.inf, math.nan):
        with pytest.raises(ValueError, match="grasp_timeout_s"):
            RunConfig(grasp_timeout_s=value)


def test_the_simulated_time_is_from_the_first_frame_to_the_last():
    class Late(Scripted):
        """A clock that does not begin at 0."""

        def read(self, timeout_s):
            frame, pads, _ = super().read(timeout_s)
            return Reading(frame._replace(t_s=frame.t_s + 40.0), pads)

    gripper = Late(squeezing, bottle, lose_at=51)
    assert run_grasp(gripper, HYBRID, RUN).seconds_simulated == pytest.approx(0.050)
    assert run_grasp(Scripted(squeezing, bottle, lose_at=0), HYBRID, RUN).seconds_simulated == 0.0
    assert run_grasp(Scripted(squeezing, bottle, clock="device"), HYBRID, RUN).seconds_simulated is None


def test_that_the_guard_limits_is_said_once_and_counted_each_time():
    class Strong(HybridController):
        @staticmethod
        def step(params, state, reading):
            command, state = HybridController.step(params, state, reading)
            return command._replace(value=500.0), state

    # Its own opening command is above the limit of a first use too: those ticks are not in the trace.
    grasp = run_grasp(Scripted(squeezing, bottle, clock="device"), Strong(HybridConfig()), RUN)
    said = [event.what for event in grasp.events if event.what.startswith("guard")]
    assert said == ["guard: a command was limited"]
    assert 1000 < grasp.counts["guarded"] < grasp.counts["ticks"]
    assert grasp.counts["guarded"] == sum(grasp.trace.command >= RUN.first_effort_n)


def test_one_interrupt_opens_the_fingers_and_a_second_only_relaxes_them():
    class Pressed(Scripted):
        """So many interrupts: one in the squeeze, the others while the fingers open."""

        pressed, times = 0, 1

        def read(self, timeout_s):
            if (self.pressed == 0 and self.k == 1200) or 0 < self.pressed < self.times:
                self.pressed += 1
                signal.raise_signal(signal.SIGINT)
            return super().read(timeout_s)

    def openings(times):
        gripper = Pressed(squeezing, bottle)
        gripper.times = times
        run_grasp(gripper, HYBRID, RUN)
        return sum(command.value == -20.0 for command in gripper.commands[1200:])

    assert openings(1) >= 100  # until they have stood open for 0.1 s
    assert openings(2) == 1


@pytest.mark.parametrize(("stands_still", "openings"), [(False, 2000), (True, 200)])
def test_fingers_that_do_not_come_to_rest_are_relaxed_after_the_opening_time(
    monkeypatch, stands_still, openings
):
    """By the clock of the gripper; where that stands still, by the one on the wall, of which a frame takes 10 ms."""

    class Restless(Scripted):
        """Opens and opens after a failure at 1.2 s: the gap never stands still."""

        wall_s = 0.0

        def read(self, timeout_s):
            if self.k == 1200:
                self.k += 1
                raise ZeroDivisionError
            frame, pads, _ = super().read(timeout_s)
            if self.k > 1200:
                self.wall_s += 0.01 * stands_still
                gap_m = 0.05 + 0.01 * (self.k % 2) + 0.1 * (frame.t_s - 1.2)
                frame = frame._replace(gap_m=gap_m, t_s=1.2 if stands_still else frame.t_s)
            return Reading(frame, pads)

    gripper = Restless(squeezing, bottle)
    monkeypatch.setattr(runner, "time", SimpleNamespace(perf_counter=lambda: gripper.wall_s))
    grasp = run_grasp(gripper, HYBRID, RunConfig(opening_timeout_s=2.0))
    opening = [c for c in gripper.commands[1200:] if c.value == -20.0]
    assert len(opening) == pytest.approx(openings, abs=3)
    assert gripper.commands[-1].value == 0.0
    assert grasp.outcome is Outcome.ABORTED
    assert "in core/test_runner.py:" in grasp.reason


def test_a_gripper_that_returns_no_reading_is_named():
    class Bare(Scripted):
        def read(self, timeout_s):
            return super().read(timeout_s).frame

    reason = run_grasp(Bare(squeezing, bottle), HYBRID, RUN).reason
    assert "scripted delivered what it does not declare: read returned Frame: return graspsense" in reason


def test_fingers_that_are_open_are_not_opened_again(ordinary):
    values = [c.value for c in ordinary[0].commands]
    # The fingers open from 54 to 80 mm at 50 mm/s. The release ends when the gap has stood still for 0.1 s, and then
    # there is one more command.
    assert values[::-1].index(20.0) - 1 == pytest.approx(520 + 101, abs=2)


def test_the_wall_clock_of_a_grasp_is_what_it_took():
    began = time.perf_counter()
    grasp = run_grasp(Scripted(squeezing, bottle, lose_at=300), HYBRID, RUN)
    assert 0.0 < grasp.seconds_wall <= time.perf_counter() - began


def pushing(effort_limit_n):
    """A law that closes by a velocity, with this limit of the effort, until the gap rests."""

    def step(params, state, reading):
        return Command(VELOCITY, -0.01, effort_limit_n, inf), gentle.step(params, state, reading)[1]

    law = type("Pushing", (gentle.GentleController,), {"step": staticmethod(step)})
    law.asked_force_n = lambda self: effort_limit_n
    return law(VELOCITY)


@pytest.mark.parametrize("force_n", [15.0, 30.0, 60.0])
def test_a_squeeze_under_the_limits_of_a_first_use_is_told(force_n):
    """Without pads these are three equal grasps, and nobody is to call them equally good."""
    gripper = Scripted(squeezing, lambda t: (nan, nan), clock="device")
    grasp = run_grasp(gripper, pushing(force_n), RUN)
    closing = [command for command in gripper.commands if command.value == -0.01]
    assert {command.effort_limit_n for command in closing} == {RUN.first_effort_n}
    assert grasp.counts["guarded"] == len(grasp.trace)  # the opening of 20 N is lowered to 12 N as well
    (told,) = [warning for warning in grasp.warnings if "run.first_effort_n" in warning]
    assert "no pad has felt a contact" in told


def test_an_effort_limit_above_the_ceiling_counts_and_is_told():
    understating = pushing(90.0)
    type(understating).asked_force_n = lambda self: 20.0
    grasp = run_grasp(Scripted(squeezing, bottle, clock="device"), understating, RUN)
    (told,) = [warning for warning in grasp.warnings if "squeeze limited" in warning]
    assert "run.effort_ceiling_n" in told
    assert "25.0 N" in told
    assert grasp.counts["guarded"] >= (grasp.trace.phase == Phase.SQUEEZE).sum()
