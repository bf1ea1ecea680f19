"""The emulated board: what it does with commands, and that it lets go when they stop."""

import pytest
from cases import every_case

from graspsense.gripper_api import gap_and_rate
from graspsense_pr2_gripper.linkage import LINKAGES
from graspsense_pr2_gripper.protocol import (
    ACCEPTED,
    CLAMPED,
    EFFORT_KIND,
    LET_GO,
    LIMITED,
    NO_COMMAND,
    OWN_LIMIT,
    REFUSED,
    OutputReport,
    decode_input,
    encode_output,
)


def effort(counter, newtons, **limits):
    limits = {"effort_limit_un": OWN_LIMIT, "speed_limit_um_s": OWN_LIMIT, **limits}
    return encode_output(OutputReport(counter, EFFORT_KIND, round(newtons * 1e6), **limits))


@pytest.fixture
def firmware(board):
    """A board that has sent a report."""
    firmware = board(object="none").firmware
    firmware.step()
    return firmware


def answer(firmware, command):
    """Return the report that follows this command."""
    firmware.output(command)
    return decode_input(firmware.step())


def test_a_report_a_millisecond_from_power_on(board):
    firmware = board().firmware
    reports = [decode_input(firmware.step()) for _ in range(50)]
    told = [(report.sequence, report.time_us, report.command_result, report.status) for report in reports]
    assert told == [(i, 1000 * i, NO_COMMAND, 0) for i in range(50)]


@every_case("transmission", LINKAGES)
def test_encoder_tells_the_bodys_gap_through_each_linkage(board, transmission):
    report = decode_input(board(transmission=transmission).firmware.step())
    gap, rate = gap_and_rate(LINKAGES[transmission], report.encoder_ticks / 1200)
    assert gap == pytest.approx(0.086, abs=rate / 1200), "the simulated gripper stands open at 86 mm"


@every_case(
    ("command", "effort_un", "result", "status"),
    [
        (effort(4711, 20.0), 20_000_000, ACCEPTED, 0),
        (effort(4711, -30.0, effort_limit_un=12_000_000), -12_000_000, CLAMPED, LIMITED),
        (effort(4711, 2000.0), 100_000_000, CLAMPED, LIMITED),
    ],
)
def test_command_is_applied_echoed_and_answered(firmware, command, effort_un, result, status):
    """It is clamped to its own limit and to the device's."""
    report = answer(firmware, command)
    assert (report.echo, report.effort_un, report.command_result) == (4711, effort_un, result)
    assert report.status == status


def test_damaged_command_leaves_the_one_before_in_force(firmware):
    firmware.output(effort(1, 20.0))
    damaged = bytearray(effort(2, 90.0))
    damaged[4] ^= 1
    report = answer(firmware, bytes(damaged))
    assert (report.echo, report.command_result, report.effort_un) == (1, REFUSED, 20_000_000)


def test_watchdog_lets_go_after_its_time_and_not_before(firmware):
    firmware.output(effort(1, 20.0))
    reports = [decode_input(firmware.step()) for _ in range(110)]
    assert [report.effort_un for report in reports] == [20_000_000] * 99 + [0] * 11
    assert reports[99].time_us == 100_000
    assert reports[99].status & LET_GO
    again = answer(firmware, effort(2, 20.0))
    assert (again.effort_un, again.status & LET_GO) == (20_000_000, 0)


def test_speed_limit_takes_the_effort_away_while_it_is_exceeded(firmware):
    speeds = []
    for counter in range(300):
        answer(firmware, effort(counter, 40.0, speed_limit_um_s=20_000))
        speeds.append(-firmware._velocity_um_s)
    # The velocity is filtered over 3 ms; 33 N on about 80 kg gain 0.4 mm/s in a tick.
    assert 18_000 < max(speeds) < 23_000
