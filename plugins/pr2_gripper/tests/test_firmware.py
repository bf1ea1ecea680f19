"""The emulated board: what it does with commands, and that it lets go when they stop."""

import pytest

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
    RELEASE_KIND,
    OutputReport,
    decode_input,
    encode_output,
)


def effort(counter, newtons, **limits):
    limits = {"effort_limit_un": OWN_LIMIT, "speed_limit_um_s": OWN_LIMIT, **limits}
    return encode_output(OutputReport(counter, EFFORT_KIND, round(newtons * 1e6), **limits))


def test_a_report_a_millisecond_from_power_on(board):
    wire = board()
    reports = [decode_input(wire.firmware.step()) for _ in range(50)]
    assert [report.sequence for report in reports] == list(range(50))
    assert [report.time_us for report in reports] == list(range(0, 50_000, 1000))
    assert {report.command_result for report in reports} == {NO_COMMAND}
    assert {report.status for report in reports} == {0}


@pytest.mark.parametrize("transmission", sorted(LINKAGES))
def test_encoder_tells_the_bodys_gap_through_each_linkage(board, transmission):
    report = decode_input(board(transmission=transmission).firmware.step())
    gap, rate = gap_and_rate(LINKAGES[transmission], report.encoder_ticks / 1200)
    assert gap == pytest.approx(0.086, abs=rate / 1200), "the simulated gripper stands open at 86 mm"


def test_command_is_applied_echoed_and_answered(board):
    firmware = board().firmware
    firmware.step()
    firmware.output(effort(4711, 20.0))
    report = decode_input(firmware.step())
    assert (report.echo, report.command_result) == (4711, ACCEPTED)
    assert report.effort_un == 20_000_000


def test_effort_is_clamped_to_the_commands_limit_and_to_the_devices(board):
    firmware = board().firmware
    firmware.step()
    firmware.output(effort(1, -30.0, effort_limit_un=12_000_000))
    report = decode_input(firmware.step())
    assert (report.effort_un, report.command_result, report.status) == (-12_000_000, CLAMPED, LIMITED)
    firmware.output(effort(2, 2000.0))
    assert firmware.effort_un == 100_000_000


def test_damaged_command_leaves_the_one_before_in_force(board):
    firmware = board().firmware
    firmware.step()
    firmware.output(effort(1, 20.0))
    damaged = bytearray(effort(2, 90.0))
    damaged[4] ^= 1
    firmware.output(bytes(damaged))
    report = decode_input(firmware.step())
    assert (report.echo, report.command_result, report.effort_un) == (1, REFUSED, 20_000_000)


def test_watchdog_lets_go_after_its_time_and_not_before(board):
    firmware = board(watchdog_ms=100).firmware
    firmware.step()
    firmware.output(effort(1, 20.0))
    efforts = [decode_input(firmware.step()) for _ in range(110)]
    held = [report for report in efforts if report.effort_un]
    assert len(held) == 99
    assert efforts[98].effort_un
    assert efforts[99].effort_un == 0
    assert efforts[99].time_us == 100_000
    assert efforts[99].status & LET_GO
    firmware.output(effort(2, 20.0))
    again = decode_input(firmware.step())
    assert again.effort_un == 20_000_000
    assert not again.status & LET_GO


def test_let_go_is_a_command_of_its_own(board):
    firmware = board().firmware
    firmware.step()
    firmware.output(effort(1, 20.0))
    firmware.output(encode_output(OutputReport(2, RELEASE_KIND, 0, 0, 0)))
    assert decode_input(firmware.step()).effort_un == 0


def test_speed_limit_takes_the_effort_away_while_it_is_exceeded(board):
    firmware = board(object="none").firmware
    firmware.step()
    speeds = []
    for counter in range(300):
        firmware.output(effort(counter, 40.0, speed_limit_um_s=20_000))
        firmware.step()
        speeds.append(-firmware._velocity_um_s)
    # The velocity is filtered over 3 ms; 33 N on about 80 kg gain 0.4 mm/s in a tick.
    assert 18_000 < max(speeds) < 23_000
