"""Every bit that a frame can have is declared with words and a limit, and what a report says is in the frame."""

import math
import re
from contextlib import closing
from pathlib import Path

from cases import every_case
from hypothesis import given
from hypothesis import strategies as st

from graspsense.gripper_api import revolutions_at
from graspsense.plugin_api import Pads
from graspsense_pr2_gripper.backend import Pr2Backend
from graspsense_pr2_gripper.config import Pr2Config
from graspsense_pr2_gripper.linkage import LINKAGES
from graspsense_pr2_gripper.measure import Measure
from graspsense_pr2_gripper.protocol import (
    CLAMPED,
    LEFT_ABSENT,
    REFUSED,
    RIGHT_ABSENT,
    InputReport,
)
from graspsense_pr2_gripper.status import (
    BAD_CELL,
    COMMAND_CLAMPED,
    COMMANDS_LOST,
    ENCODER_WRONG,
    LEFT_DEAD,
    OLD_IMAGE,
    RIGHT_DEAD,
    status_bits,
)
from graspsense_pr2_gripper.stream import RawImage

PAGE = Path(__file__).parents[3] / "docs" / "pr2.md"
TIP = (3000.0,) * 22


def report(**changes):
    healthy = InputReport(0, 0, 0, 0, 0, 0, 0, (), 1, 0, (3000, 3000, 3000, 3000), 1, 20_000)
    return healthy._replace(**changes)


def measure(identity, swap=False):
    made = Measure(identity, Pr2Config(swap_fingers=swap), None, None)
    made.tare([Pads(0.041 * i, i, TIP, TIP) for i in range(1, 7)])
    return made


def dead(left=0, right=0):
    """An image in which so many cells on the face of each pad read 0."""
    cells = [[3000.0] * (22 - count) + [0.0] * count for count in (left, right)]
    return RawImage(9, 0, (*cells[0], *cells[1]))


@every_case("swap", [False, True])
def test_every_bit_of_the_board_has_a_name_a_meaning_and_one_declaration(swap):
    bits = status_bits(swap)
    for bit in range(16):
        (declared,) = [status for status in bits if status.mask & 1 << bit]
        assert declared.mask == 1 << bit
        assert declared.name
        assert declared.meaning
    assert len({status.name for status in bits}) == len(bits)


def test_opened_gripper_declares_the_bits_and_the_friction_of_its_drive():
    """7 N is what pr2_gripper_sensor feeds forward; nothing was measured here."""
    with closing(Pr2Backend(Pr2Config(transport="emulated", swap_fingers=True))) as backend:
        info = backend.open(0)
    assert (info.status_bits, info.friction_n, info.harmless) == (status_bits(swap_fingers=True), 7.0, False)


@given(
    reported=st.builds(
        report,
        status=st.integers(0, 0xFFFF),
        command_result=st.integers(0, 3),
        image_age_us=st.integers(0, 0xFFFF),
        encoder_ticks=st.integers(-(2**31), 2**31 - 1),
        velocity_mtick_s=st.integers(-(2**31), 2**31 - 1),
        effort_un=st.integers(-(2**31), 2**31 - 1),
    ),
    image=st.builds(dead, st.integers(0, 22), st.integers(0, 22)),
    swap=st.booleans(),
)
def test_no_frame_has_a_bit_that_is_not_declared(reported, image, swap, device_identity):
    frame = measure(device_identity(), swap).reading(reported, image).frame
    declared = sum(bit.mask for bit in status_bits(swap))
    assert frame.status & ~declared == 0
    assert frame.status & 0xFFFF == reported.status
    assert frame.effort_n == reported.effort_un / 1e6, (
        "what the board says that it applies, clipped by nobody"
    )


@every_case(("result", "bit"), [(0, 0), (1, 0), (CLAMPED, COMMAND_CLAMPED), (REFUSED, COMMANDS_LOST)])
def test_result_of_a_command_is_in_the_frame(result, bit, device_identity):
    assert measure(device_identity()).reading(report(command_result=result), None).frame.status == bit


@every_case(
    ("rate_hz", "image", "age_us", "old"),
    [
        (1000, 1, 61_000, False),
        (1000, 1, 62_000, True),
        (1000, 1, 0xFFFF, True),
        (100, 1, 0xFFFF, False),
        # None came yet.
        (1000, 0, 0xFFFF, False),
    ],
)
def test_image_is_old_half_a_period_after_the_next_one_was_due(rate_hz, image, age_us, old, device_identity):
    """41 ms and a half of it; at 100 Hz the eleven slices of an image take 110 ms, which the field cannot say."""
    slow = device_identity(report_rate_hz=rate_hz)
    frame = measure(slow).reading(report(image=image, image_age_us=age_us), None).frame
    assert frame.status == (OLD_IMAGE if old else 0)


@every_case(
    ("cells", "swap", "status"),
    [
        ({"left": 5}, False, BAD_CELL),
        ({"left": 6}, False, LEFT_DEAD),
        ({"right": 15}, False, RIGHT_DEAD),
        ({"left": 6}, True, RIGHT_DEAD),
    ],
)
def test_pad_with_more_than_a_third_of_its_cells_dead_is_dead(cells, swap, status, device_identity):
    """It has no bad cell besides: that is the word for a pad whose force is still useful."""
    assert measure(device_identity(), swap).reading(report(), dead(**cells)).frame.status == status


def test_a_dead_pad_is_dead_without_a_tare_too(device_identity):
    without_tare = Measure(device_identity(), Pr2Config(), None, None)
    assert without_tare.reading(report(), dead(left=15)).frame.status == LEFT_DEAD


@every_case("transmission", LINKAGES)
def test_angle_outside_of_the_stroke_is_implausible_though_it_has_a_gap(transmission, device_identity):
    """The map to the gap repeats itself: 2147483647 ticks are 69 mm."""
    made = device_identity(transmission=transmission)
    gaps_m = (-0.009, 0.0, 0.09, -0.011, 0.101)
    ticks = [round(revolutions_at(LINKAGES[transmission], gap_m) * 1200) for gap_m in gaps_m]
    ticks += [-(2**31), 2**31 - 1]
    frames = [measure(made).reading(report(encoder_ticks=tick), None).frame for tick in ticks]
    assert [frame.status for frame in frames] == [0] * 3 + [ENCODER_WRONG] * 4
    assert all(math.isfinite(frame.gap_m) for frame in frames)


@every_case(("step_m", "time_us", "wrong"), [(-1e-3, 1000, True), (-1e-3, 3000, False), (-4e-4, 1, False)])
def test_gap_that_jumps_is_implausible_in_that_frame(step_m, time_us, wrong, device_identity):
    """A millimetre in a millisecond is 1 m/s; over two lost reports it is 0.33 m/s."""
    made = measure(device_identity())
    ticks = [round(revolutions_at(LINKAGES["pr2"], 0.05 + gap_m) * 1200) for gap_m in (0.0, step_m, step_m)]
    times = (0, time_us, time_us + 1000)
    statuses = [
        made.reading(report(encoder_ticks=tick, time_us=at_us), None).frame.status
        for tick, at_us in zip(ticks, times, strict=True)
    ]
    assert statuses == [0, ENCODER_WRONG if wrong else 0, 0]


@every_case("swap", [False, True])
@every_case("bit", [LEFT_ABSENT, RIGHT_ABSENT])
def test_words_name_the_pad_that_has_no_force(bit, swap, device_identity):
    (declared,) = [status for status in status_bits(swap) if status.mask == bit]
    frame = measure(device_identity(), swap).reading(report(status=bit), dead()).frame
    side = "left" if math.isnan(frame.force_left_n) else "right"
    assert declared.name == f"{side} fingertip absent"
    assert math.isnan(frame.force_left_n) != math.isnan(frame.force_right_n)


def test_page_has_the_table_of_the_code():
    rows = re.findall(r"^\| (\d+) \| ([^|]+) \| [^|]+ \| ([^|]+) \|", PAGE.read_text(), re.M)
    limits = {math.inf: "-"}
    expected = [
        (f"{status.mask.bit_length() - 1}", status.name, limits.get(status.limit_s, f"{status.limit_s:g} s"))
        for status in status_bits(False)
        if not 1 << 6 <= status.mask < 1 << 16  # one row stands for those
    ]
    assert sorted(rows) == sorted(expected)
    assert "| 6 to 15 | unknown bit | " in PAGE.read_text()


def test_what_a_grasp_cannot_do_without_has_a_limit_and_what_only_informs_has_none():
    endless = {bit.name for bit in status_bits(False) if bit.limit_s == math.inf}
    assert endless == {"samples missed", "bad cell", "beyond load table", "commands lost"}
    # The gaps between reports are summed over the whole grasp.
    short = [bit for bit in status_bits(False) if bit.name not in {*endless, "frames lost"}]
    assert all(0.0 < bit.limit_s <= 0.2 for bit in short)
