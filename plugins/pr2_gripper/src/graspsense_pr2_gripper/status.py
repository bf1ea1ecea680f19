"""The bits of `Frame.status`, each with its meaning for a grasp and the time for which a grasp endures it.

Bits 0 to 15 are those of the board as `specs/pr2_hid.md` defines them. The driver sets bits above.
"""

from __future__ import annotations

from typing import Final

from graspsense.gripper_api import StatusBit
from graspsense_pr2_gripper.protocol import (
    CLAMPED,
    ENCODER_FAULT,
    LEFT_ABSENT,
    LET_GO,
    LIMITED,
    REFUSED,
    RIGHT_ABSENT,
    SAMPLES_MISSED,
)

BAD_CELL: Final = 1 << 16
"""A cell of the last image does not answer and is left out of the forces."""
BEYOND_TABLE: Final = 1 << 17
"""A pad force is above its load table."""
COMMAND_CLAMPED: Final = 1 << 18
"""The board applied its last command at a limit of its own."""
COMMANDS_LOST: Final = 1 << 19
"""The board did not apply the last command that reached it, or none has reached it for some time."""
OLD_IMAGE: Final = 1 << 20
"""The board says that its cell image is older than an image can be."""
LEFT_DEAD: Final = 1 << 21
"""More than `ENDURED_CELLS` cells on the face of the left pad do not answer."""
RIGHT_DEAD: Final = 1 << 22
"""The same of the right pad. Left and right are those of the frames, after `swap_fingers`."""
ENCODER_WRONG: Final = 1 << 23
"""The motor angle lies outside of the stroke, or moved faster than the fingers can."""
REPORTS_LOST: Final = 1 << 24
"""Reports before this one were lost, by their numbers."""

ENDURED_CELLS: Final = 5
"""Number of cells on the face of a pad that may be dead: with a third of them, a force is up to a third too small."""
BLIND_S: Final = 0.02
"""Gap and speed are what the limits of a motion rest on: at the 15 mm/s of an approach, 0.02 s are 0.3 mm."""
NUMB_S: Final = 0.1
"""Two cell images: one that failed is endured. At 10 mm/s, the fingers close by 1 mm in this time."""
WRONG_EFFORT_S: Final = 0.1
"""The time after which the watchdog lets go of an effort that nobody commands."""
OLD_IMAGE_S: Final = 0.2
"""Five images that should have come."""
GAPS_S: Final = 1.0
"""Sum of the times between reports of which some were lost in between. A tenth of lost reports stays below it in a
grasp, a quarter does not, and changes what is recognised."""

RESULT_BITS: Final = {CLAMPED: COMMAND_CLAMPED, REFUSED: COMMANDS_LOST}
"""The bit of the frame for a command result of a report; the other results have none."""

KNOWN_BITS: Final = LET_GO | LIMITED | ENCODER_FAULT | SAMPLES_MISSED | LEFT_ABSENT | RIGHT_ABSENT
"""The bits of the board that the protocol defines."""

_COMMON: Final = (
    StatusBit(
        mask=LET_GO,
        name="let go",
        meaning="the watchdog of the board switched the effort off, so nothing was squeezed meanwhile",
        limit_s=WRONG_EFFORT_S,
    ),
    StatusBit(
        mask=LIMITED,
        name="limited",
        meaning="the board applied less effort than commanded",
        limit_s=WRONG_EFFORT_S,
    ),
    StatusBit(
        mask=ENCODER_FAULT,
        name="encoder fault",
        meaning="gap and velocity are old values, so a motion cannot be seen",
        limit_s=BLIND_S,
    ),
    StatusBit(
        mask=SAMPLES_MISSED,
        name="samples missed",
        meaning="the acceleration of the palm has gaps; gap and forces are not concerned",
    ),
    StatusBit(
        mask=BAD_CELL,
        name="bad cell",
        meaning="a cell does not answer, so the force of its pad is too small by its share",
    ),
    StatusBit(
        mask=BEYOND_TABLE,
        name="beyond load table",
        meaning="a force is above its load table and extrapolated: extend it with graspsense calibrate load-cell",
    ),
    StatusBit(
        mask=COMMAND_CLAMPED,
        name="command clamped",
        meaning="the board applied the command at a limit of its own",
        limit_s=WRONG_EFFORT_S,
    ),
    StatusBit(
        mask=COMMANDS_LOST,
        name="commands lost",
        meaning="a command arrived damaged, or none for 0.02 s, and an old one still applied; without a good one for "
        "0.1 s the device counts as lost: check the cable and the USB hub",
    ),
    StatusBit(
        mask=OLD_IMAGE,
        name="old cell image",
        meaning="the forces are those of an earlier time, so a contact cannot be seen",
        limit_s=OLD_IMAGE_S,
    ),
    StatusBit(
        mask=ENCODER_WRONG,
        name="encoder implausible",
        meaning="the motor angle is outside of the stroke or jumped, so gap and velocity are wrong",
        limit_s=BLIND_S,
    ),
    StatusBit(
        mask=REPORTS_LOST,
        name="frames lost",
        meaning="reports did not arrive, so rates and times are less exact: check the cable and the USB hub",
        limit_s=GAPS_S,
    ),
)
_ABSENT_MEANING: Final = (
    "the board says that this fingertip does not answer, so a contact with it cannot be felt"
)
_DEAD_MEANING: Final = "more than a third of its cells do not answer, so its force is not measured"


def status_bits(swap_fingers: bool) -> tuple[StatusBit, ...]:
    """Return what each bit of the frames means; `swap_fingers` as in the settings.

    The bits of an absent fingertip are those of the board, and their names those of the grasp.
    """
    left, right = (RIGHT_ABSENT, LEFT_ABSENT) if swap_fingers else (LEFT_ABSENT, RIGHT_ABSENT)
    sides = [
        StatusBit(mask=mask, name=f"{side} {what}", meaning=meaning, limit_s=NUMB_S)
        for what, meaning, masks in (
            ("fingertip absent", _ABSENT_MEANING, (left, right)),
            ("pad dead", _DEAD_MEANING, (LEFT_DEAD, RIGHT_DEAD)),
        )
        for side, mask in zip(("left", "right"), masks, strict=True)
    ]
    reserved = [
        StatusBit(
            mask=1 << bit,
            name=f"unknown bit {bit}",
            meaning="the board reports a state that this driver does not know, which may be a fault",
            limit_s=NUMB_S,
        )
        for bit in range(16)
        if not 1 << bit & KNOWN_BITS
    ]
    return tuple(sorted((*_COMMON, *sides, *reserved), key=lambda bit: bit.mask))
