"""Device time that stands still, jumps or runs at another rate is a lost device within a bounded time, with words."""

import random
import re
from contextlib import closing

import pytest
from cases import every_case
from hypothesis import given
from hypothesis import strategies as st

from graspsense.gripper_api import Outcome
from graspsense.plugin_api import EFFORT, Command, DeviceLost
from graspsense_pr2_gripper.device_time import (
    COUNTED_OFF_S,
    STILL_REPORTS,
    ClockFault,
    CountedTime,
    HostTime,
    PassingTime,
)
from graspsense_pr2_gripper.link import LockStepLink, ThreadedLink
from graspsense_pr2_gripper.protocol import InputReport, encode_input


def report(sequence, time_us):
    return encode_input(InputReport(sequence, time_us, 0, 0, 0, 0, 0, (), 0, 0, (0, 0, 0, 0), 0, 0))


@pytest.mark.parametrize(("rate", "at_s"), [(0.0, 1.4), pytest.param(0.5, 0.1, marks=pytest.mark.slow)])
def test_grasp_ends_soon_after_the_clock_of_the_board_goes_wrong(near, grasped, rate, at_s):
    """In lock-step: 50 ms where it stands still, 0.2 s where it loses half.

    The effort is switched off by a command, since a watchdog with this clock would never act.
    """
    ended = grasped(near({"clock_rate": rate, "clock_at_s": at_s}))
    assert ended.outcome == Outcome.DEVICE_LOST
    assert "clock" in ended.reason
    assert "doctor" in ended.reason
    numbers = [float(number) for number in re.findall(r"\d+\.?\d*", ended.reason.partition(" clock ")[2])]
    if rate == 0.0:
        assert numbers[:2] == [STILL_REPORTS, at_s]
    else:
        assert numbers[1] - numbers[0] == pytest.approx(COUNTED_OFF_S, abs=0.003)
    assert ended.report["let_go_after_s"] == 0.0


def test_frozen_clock_of_a_board_in_real_time_is_a_lost_device(near):
    """It ends by the number of reports, however fast this machine is."""
    with closing(near({"clock_rate": 0.0, "clock_at_s": 0.05}, pace="device")) as backend:
        backend.open(0)
        with pytest.raises(DeviceLost, match="clock"):
            all(iter(lambda: backend.read(60.0), None))
        backend.apply(Command(EFFORT, 0.0, float("inf"), float("inf")))


@every_case("kind", [LockStepLink, ThreadedLink])
@every_case("jump_us", [-300_000, -1])
def test_time_that_goes_back_is_not_handed_on_and_is_told_if_it_stays_behind(fed, kind, jump_us):
    """A single early report is left out; after a jump back of 0.3 s, fifty are."""
    times = [10_000_000 + 1000 * i for i in range(100)]
    jumping = [*times[:50], *(time_us + jump_us - 1000 for time_us in times[50:])]
    wire = fed(*(report(sequence, time_us) for sequence, time_us in enumerate(jumping)))
    if kind is LockStepLink:
        wire.longest_wait_s = 0.0
    told, seen = "", []
    with closing(kind(wire, 0.001)) as link:
        try:
            while not seen or seen[-1] < times[-1] - 1001:
                seen.append(link.next(60.0).report.time_us)
        except DeviceLost as lost:
            told = str(lost)
    assert seen == sorted(set(seen))
    assert bool(re.search(r"went back: 50 reports.*10\.049 s", told)) == (jump_us == -300_000), told


def right(check, *given):
    try:
        check.check(*given)
    except ClockFault:
        return False
    return True


def test_board_in_real_time_may_leave_out_reports_without_a_number_but_no_time():
    """A board that could not send for 30 s gave no numbers meanwhile; one whose clock runs at half the rate is told."""
    check = CountedTime(1000, numbers_all=False)
    assert right(check, 1, 1000)
    assert right(check, 2, 30_000_000)
    slow = CountedTime(1000, numbers_all=False)
    index = next(i for i in range(1000) if not right(slow, i, 500 * i))
    assert index == pytest.approx(COUNTED_OFF_S / 0.5e-3, abs=2)


def test_two_crystals_of_200_parts_in_a_million_never_differ_too_much():
    """The board's ticks come from one, its times from the other: in ten minutes they differ by 0.12 s."""
    check = CountedTime(1000, numbers_all=True)
    assert all(right(check, i, round(1000 * i * (1 + 200e-6))) for i in range(0, 600_000, 50))


def host_times(rate, seconds, jump_s=0.0):
    """Return the host time at which a device clock of this rate is found wrong."""
    check = HostTime()
    wrong = (
        i * 1e-3
        for i in range(round(seconds * 1000))
        if not right(check, i * 1e-3 * rate + (jump_s if i > 3500 else 0.0), 500.0 + i * 1e-3)
    )
    return next(wrong, float("inf"))


def test_fast_clock_is_found_in_a_few_seconds_and_a_jump_of_half_a_second_at_once():
    for rate, within_s in ((1.3, 4.01), (2.0, 2.6), (100.0, 2.01)):
        assert host_times(rate, 5.0) < within_s, rate
    assert host_times(1.0, 5.0, jump_s=0.51) == pytest.approx(3.501)
    assert host_times(1.0, 5.0, jump_s=0.49) == float("inf")


@given(st.integers(0, 2**32), st.floats(-200e-6, 200e-6))
def test_good_clock_with_late_reports_is_never_told(seed, off):
    """A crystal is good to 200 parts in a million; each half second, one report comes within 50 ms."""
    chance = random.Random(seed)
    check, passing, host_s = HostTime(), PassingTime(), 0.0
    for i in range(400):
        device_s = 0.02 * i * (1.0 + off)
        until_prompt_s = 0.02 * (-i % 25)
        late_s = min(chance.expovariate(5.0), until_prompt_s) if i % 25 else chance.uniform(0.0, 0.05)
        host_s = max(host_s, 0.02 * i + late_s)
        check.check(device_s, host_s)
        assert passing.passes(round(device_s * 1e6))


@given(st.lists(st.integers(1, 5000), min_size=1, max_size=50), st.integers(0, 2**32 - 1))
def test_reports_that_were_lost_count_as_time(steps, start):
    """The sequence goes on while nothing arrives, and wraps."""
    check, count = CountedTime(1000, numbers_all=True), 0
    check.check(start, 7_000_000)
    for step in steps:
        count += step
        check.check((start + count) & 0xFFFFFFFF, 7_000_000 + 1000 * count)
    with pytest.raises(ClockFault):
        check.check((start + count + 1) & 0xFFFFFFFF, 7_000_000 + 1000 * count + 200_000)
