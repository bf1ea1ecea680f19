"""Faults that the motion of fingers shows that a command has told a speed, and that their effort shows."""

from math import inf, nan
from random import Random

from cases import every_case

from graspsense.core.grasp.protection.effort import ReportedEffort
from graspsense.core.grasp.protection.reports import Repeats
from graspsense.core.grasp.protection.speed import KeptSpeed
from graspsense.core.values.signals import APPROACH, HOLD, POSITION, SQUEEZE, Command, Frame, Phase

RATE_HZ = 100.0
CLOSES, OPENS = Command(POSITION, 0.0, 20.0, 0.02), Command(POSITION, 0.08, 20.0, 0.05)


def frame(k, gap_m, effort_n=nan, velocity_m_s=0.0):
    return Frame(k / RATE_HZ, 1.0 / RATE_HZ, gap_m, velocity_m_s, effort_n)


def in_steps(way_m, step_m):
    return round(way_m / step_m) * step_m


@every_case(
    ("command", "phase", "way_m", "ends"),
    [
        (CLOSES, APPROACH, lambda t: 0.02 * t, set()),
        (CLOSES, APPROACH, lambda t: in_steps(0.02 * t, 0.0004), set()),
        (CLOSES, APPROACH, lambda t: 0.005 * t**2, set()),
        # The scale of the gap is half, or that of the time.
        (CLOSES, APPROACH, lambda t: 0.01 * t, {False}),
        (CLOSES, APPROACH, lambda t: in_steps(0.01 * t, 0.0002), {False}),
        (CLOSES, APPROACH, lambda t: 0.035 * t, {False}),
        (CLOSES, APPROACH, lambda t: 0.025 * t, {False}),
        (CLOSES, APPROACH, lambda t: 0.023 * t, set()),
        # Twice as fast ends it, beyond the limit of a first use.
        (CLOSES, APPROACH, lambda t: 0.042 * t, {False}),
        (CLOSES, APPROACH, lambda t: 0.05 * t, {True}),
        # Something slows them that they press; a jump is told elsewhere.
        (CLOSES, APPROACH, lambda t: 0.02 * min(t, 0.5) + 0.005 * max(t - 0.5, 0.0), set()),
        (CLOSES, APPROACH, lambda t: 0.02 * t + 0.01 * (t >= 0.5), set()),
        (CLOSES, APPROACH, lambda t: 0.0, set()),
        (OPENS, Phase.RELEASE, lambda t: -0.05 * min(t, 1.0), set()),
        (OPENS, Phase.RELEASE, lambda t: -0.02 * t, set()),
        (OPENS, Phase.RELEASE, lambda t: -0.08 * min(t, 0.5), {False}),
        (Command(POSITION, 0.0, 20.0, inf), APPROACH, lambda t: 0.01 * t, set()),
    ],
)
def test_fingers_that_do_not_move_at_the_speed_of_their_command_are_named(command, phase, way_m, ends):
    watch, told = KeptSpeed(RATE_HZ, limit_m_s=0.045), set()
    start_m = 0.06 if command is not OPENS else 0.02
    last_m = start_m
    for k in range(150):
        now = frame(k, start_m - way_m(k / RATE_HZ))
        if (fault := watch.see(now, phase)) is not None:
            told.add(fault.ends)
        watch.apply(now, command, jumped=abs(now.gap_m - last_m) > 0.005)
        last_m = now.gap_m
    assert told == ends


def approach(k):
    """A way at 20 mm/s that begins slowly and ends at an object."""
    return 0.02 * min(max(k - 10, 0), 90) / RATE_HZ


@every_case(
    ("way_m", "names"),
    [
        # Steps of a coarse encoder, and a gap that is measured for each third frame.
        (lambda k: in_steps(approach(k), 0.00037), set()),
        (lambda k: in_steps(approach(k), 0.001), {"gap in steps"}),
        (lambda k: approach(k - k % 3), set()),
        # Each fifth frame is that before it.
        (lambda k: approach(k - (k % 5 == 0)), {"frames repeated"}),
    ],
)
def test_frames_that_come_twice_show_in_what_the_gap_makes_up_for(way_m, names):
    watch = Repeats(RATE_HZ)
    faults = [watch.see(frame(k, 0.08 - way_m(k))) for k in range(120)]
    assert {fault.name for fault in faults if fault is not None} == names


def test_frames_that_come_early_and_late_do_not_come_twice():
    for seed in range(20):
        watch, chance, t_s = Repeats(RATE_HZ), Random(seed), 0.0
        for k in range(1, 120):
            last_s, t_s = t_s, max(k / RATE_HZ, t_s) + chance.expovariate(4.0 * RATE_HZ)
            gap_m = 0.08 - in_steps(approach(RATE_HZ * t_s), 0.00037)
            assert watch.see(Frame(t_s, t_s - last_s, gap_m, -0.02)) is None


def grasp_with(effort):
    """Return the names of what a grasp shows that has this effort (N), a function of the sound one and of the time (s).

    The motor holds at its limit, begins to open at the same one, and needs less while the fingers move.
    """
    watch, names, gap_m, k = ReportedEffort(), set(), 0.08, 0
    for phase, ticks, speed_m_s, effort_n in (
        (APPROACH, 100, -0.02, 4.0),
        (APPROACH, 10, 0.0, 8.0),
        (SQUEEZE, 50, 0.0, 10.0),
        (HOLD, 25, 0.0, 10.0),
        (Phase.RELEASE, 20, 0.05, -10.0),
        (Phase.RELEASE, 40, 0.05, -6.0),
    ):
        command = OPENS if phase == Phase.RELEASE else CLOSES
        for _ in range(ticks):
            k += 1
            gap_m += speed_m_s / RATE_HZ
            now = frame(k, gap_m, effort(effort_n, k / RATE_HZ), speed_m_s)
            names.add(watch.see(now, phase))
            watch.apply(now, command)
    names.add(watch.released(now))
    faults = names - {None}
    assert not any(fault.ends for fault in faults)
    return {fault.name for fault in faults}


@every_case(
    ("effort", "names"),
    [
        (lambda effort_n, t: effort_n, set()),
        # Many grippers have a current without a sign.
        (lambda effort_n, t: abs(effort_n), set()),
        (lambda effort_n, t: 0.5 * effort_n, set()),
        # Two newtons more or less to open than to close are no fault.
        (lambda effort_n, t: effort_n + 1.0, set()),
        (lambda effort_n, t: effort_n + 0.3 * (-1) ** round(t * RATE_HZ), set()),
        # They open with all that they may, and do not reach their speed.
        (lambda effort_n, t: effort_n if effort_n > 0.0 else -19.5, set()),
        # They push something through most of the approach with all that they may.
        (lambda effort_n, t: (11.0 if t < 0.2 else 19.5) if effort_n == 4.0 else effort_n, set()),
        (lambda effort_n, t: effort_n if effort_n > 0.0 else -15.0, {"effort not as before"}),
        (lambda effort_n, t: -effort_n, {"effort has the wrong sign"}),
        (lambda effort_n, t: 0.0, {"effort stuck"}),
        (lambda effort_n, t: 60.0, {"effort stuck"}),
        (lambda effort_n, t: effort_n + 3.0 * t, {"effort not as before"}),
        (lambda effort_n, t: abs(effort_n) + 3.0 * t, {"effort not as before"}),
        (lambda effort_n, t: effort_n * (1.0 + (t > 0.8)), {"effort not as before"}),
        (lambda effort_n, t: effort_n + 2.0 * (-1) ** round(t * RATE_HZ), {"effort noisy"}),
    ],
)
def test_an_effort_that_cannot_be_that_of_the_motor_is_named(effort, names):
    assert grasp_with(effort) == names
