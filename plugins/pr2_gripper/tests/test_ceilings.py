"""A board that claims what no PR2 gripper has is not opened, and no board raises the ceilings of the host."""

import math
import re
import sys
from contextlib import closing
from pathlib import Path

import pytest
from cases import every_case
from hypothesis import given
from hypothesis import strategies as st

from graspsense.plugin_api import EFFORT, Command, NoDevice
from graspsense_pr2_gripper.backend import Pr2Backend
from graspsense_pr2_gripper.ceilings import RANGES
from graspsense_pr2_gripper.config import FaultConfig, Pr2Config
from graspsense_pr2_gripper.discovery import LIBRARY
from graspsense_pr2_gripper.protocol import EFFORT_KIND, decode_output


def emulated(**faults):
    return Pr2Backend(Pr2Config(transport="emulated", object="none", faults=FaultConfig(**faults)))


SPECIFICATION = Path(__file__).parents[3] / "specs" / "pr2_hid.md"
# Newtons instead of uN, mm/s instead of um/s and ms instead of us are among them.
IMPLAUSIBLE = {
    "watchdog_ms": (65535, 101, 1),
    "effort_limit_un": (2_147_000_000, 200_000_001, 100),
    "speed_limit_um_s": (0xFFFFFFFF, 200),
    "report_rate_hz": (65535, 1),
    "image_period_us": (41,),
    "pad_counts_per_n": (1, 65535),
    "side_counts_per_n": (1601,),
    "edge_counts_per_n": (149,),
    "encoder_ticks_rev": (1, 65535),
    "accelerometer_g": (255,),
}


@every_case(("number", "value"), [(number, value) for number in IMPLAUSIBLE for value in IMPLAUSIBLE[number]])
def test_number_that_no_pr2_gripper_has_is_refused_with_what_is_allowed(number, value):
    with pytest.raises(NoDevice, match=rf"(?s){number} is {value}.*allowed are.*firmware"):
        emulated(identity={number: value}).open(0)


@every_case("end", ["least", "most"])
@every_case("ceiling", RANGES)
def test_both_ends_of_a_range_are_allowed(ceiling, end):
    with closing(emulated(identity={ceiling.number: round(getattr(ceiling, end))})) as backend:
        info = backend.open(0)
        # It is a gripper that gives frames, with the host's ceilings at most.
        assert backend.read(1.0) is not None
        assert 0.0 < info.effort_limit_n <= 100.0


def test_real_board_is_refused_too_and_closed(machine, board):
    machine.plug("/dev/hidraw3", board(watchdog_ms=65535))
    with pytest.raises(NoDevice, match="watchdog_ms"):
        Pr2Backend(Pr2Config()).open(0)
    assert machine.open_handles == []


@every_case("answer", [None, [], b"", bytes(10), b"\3GSPR", 0, "GSPR", [999] * 64, bytes(64)])
def test_feature_report_that_is_none_is_no_gripper(machine, board, monkeypatch, answer):
    machine.plug("/dev/hidraw3", board())
    device = type(sys.modules[LIBRARY].device())
    monkeypatch.setattr(device, "get_feature_report", lambda *given: answer)
    with pytest.raises(NoDevice, match="1209:0001"):
        Pr2Backend(Pr2Config()).open(0)
    assert machine.open_handles == []


@every_case("pace", ["lock-step", "device"])
@every_case("count", [0, 1, 63])
def test_emulated_feature_report_that_is_cut_short_is_no_gripper(pace, count):
    backend = Pr2Backend(Pr2Config(transport="emulated", pace=pace, faults=FaultConfig(feature_bytes=count)))
    with pytest.raises(NoDevice, match=f"64 bytes, this one {count}"):
        backend.open(0)


NUMBERS = st.floats(allow_nan=True, allow_infinity=True) | st.floats(-300.0, 300.0)


@pytest.fixture(scope="module")
def strong():
    """An open gripper whose board allows 200 N and 0.5 m/s, and the list of what reaches the board."""
    with closing(emulated(identity={"effort_limit_un": 200_000_000, "speed_limit_um_s": 500_000})) as backend:
        info = backend.open(0)
        assert (info.effort_limit_n, info.speed_limit_m_s) == (100.0, 0.2)
        sent = []
        backend._open().emulation.wire.output = lambda data: sent.append(decode_output(data))
        yield backend, sent


@given(value=NUMBERS, effort_limit=NUMBERS, speed_limit=NUMBERS)
def test_no_command_is_above_the_ceilings_whatever_the_board_allows(strong, value, effort_limit, speed_limit):
    backend, sent = strong
    backend.apply(Command(EFFORT, value, effort_limit, speed_limit))
    command = sent[-1]
    assert command.effort_limit_un <= 100_000_000
    assert command.speed_limit_um_s <= 200_000
    good = not math.isnan(value) and effort_limit >= 0.0 and speed_limit >= 0.0
    assert (command.kind == EFFORT_KIND) == good
    assert abs(command.effort_un) <= command.effort_limit_un, "the board has nothing to clamp"
    if good:
        most = min(effort_limit, 100.0)
        assert command.effort_un == pytest.approx(min(max(value, -most), most) * 1e6, abs=1.0)


def test_specification_has_the_ranges_of_the_code():
    rows = re.findall(r"^\| (\w+) \| (\d+) to (\d+) \| ([^|]+) \|", SPECIFICATION.read_text(), re.M)
    ranges = {(number, int(least), int(most), unit) for number, least, most, unit in rows}
    assert ranges == {
        (ceiling.number, round(ceiling.least), round(ceiling.most), ceiling.unit) for ceiling in RANGES
    }
