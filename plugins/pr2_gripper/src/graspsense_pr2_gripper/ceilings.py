"""What the host accepts from a board and commands to it, whatever the feature report of the board says."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

from graspsense.plugin_api import NoDevice
from graspsense_pr2_gripper.linkage import (
    EDGE_COUNTS_PER_N,
    ENCODER_TICKS,
    PAD_COUNTS_PER_N,
    SIDE_COUNTS_PER_N,
)
from graspsense_pr2_gripper.protocol import Identity

EFFORT_CEILING_N: Final = 100.0
"""Largest effort that the driver commands: the limit of the PR2 gripper at the time of the paper (pr2_defs,
gripper_defs.urdf.xacro, August 2009)."""
SPEED_CEILING_M_S: Final = 0.2
"""Largest speed limit that the driver commands: the limit of the same file."""

GAPS_M: Final = (-0.010, 0.100)
"""Gaps that an encoder can tell: the lower soft limit, and the stroke of 90 mm with a margin (pr2_common,
urdf/gripper_v0/gripper.urdf.xacro)."""
MOTOR_N: Final = 200.0
"""Grip of the motor at its largest continuous current, without losses: 169 N closed, 203 N at 60 mm (Maxon 222057,
61.3 mN m/A and 0.204 A in pr2_ethercat_drivers, actuators.conf, through the linkage pr2)."""
SENSOR_SPEED_M_S: Final = 0.5
"""Bound of the speed in the force servo of pr2_gripper_sensor."""
SPREAD: Final = 4
"""Factor by which a scale may differ from the published one: another fingertip, or another decoding of the encoder.
Beyond it, a number is in another unit."""
ACCELEROMETER_G: Final = (0, 2, 4, 8)
"""Full scales of the accelerometer (pr2_ethercat_drivers, wg06.cpp), 0 without one."""


class _Range(NamedTuple):
    """The plausible range of a number of the feature report, both ends included, and why it ends there."""

    number: str
    least: float
    most: float
    unit: str
    why: str


def _around(number: str, published: int, unit: str) -> _Range:
    return _Range(
        number=number,
        least=published / SPREAD,
        most=published * SPREAD,
        unit=unit,
        why=f"a PR2 has {published}; a factor of {SPREAD} is allowed",
    )


RANGES: Final = (
    _Range(
        number="watchdog_ms",
        least=5,
        most=100,
        unit="ms",
        why="an effort that nobody commands must end within 0.1 s; a host may miss a few reports",
    ),
    _Range(
        number="effort_limit_un",
        least=1e6,
        most=MOTOR_N * 1e6,
        unit="µN",
        why="the motor of a PR2 gripper cannot grip with more than 200 N",
    ),
    _Range(
        number="speed_limit_um_s",
        least=1e3,
        most=SENSOR_SPEED_M_S * 1e6,
        unit="µm/s",
        why="no program for the PR2 moves it faster",
    ),
    _Range(
        number="report_rate_hz",
        least=100,
        most=1000,
        unit="Hz",
        why="an interrupt endpoint at full speed has at most one report a millisecond",
    ),
    _Range(
        number="image_period_us",
        least=10_000,
        most=65_535,
        unit="µs",
        why="a PR2 takes a cell image each 41 ms",
    ),
    _around("pad_counts_per_n", PAD_COUNTS_PER_N, "counts/N"),
    _around("side_counts_per_n", SIDE_COUNTS_PER_N, "counts/N"),
    _around("edge_counts_per_n", EDGE_COUNTS_PER_N, "counts/N"),
    _around("encoder_ticks_rev", ENCODER_TICKS, "ticks"),
)
"""The numbers of the feature report that a grasp rests on."""


def refuse_implausible(identity: Identity) -> None:
    """Raise NoDevice if the board claims what no PR2 gripper has."""
    wrong: Sequence[str] = [*_out_of_range(identity)]
    if wrong:
        raise NoDevice(
            f"the board {identity.serial!r} says of itself what no PR2 gripper has, so it is not used:\n  "
            + "\n  ".join(wrong)
            + "\n  try: correct the feature report in its firmware (specs/pr2_hid.md, report 3);\n"
            "       or name another board in gripper.serial"
        )


def _out_of_range(identity: Identity) -> Iterator[str]:
    for number, least, most, unit, why in RANGES:
        value = getattr(identity, number)
        if not least <= value <= most:
            yield f"{number} is {value} {unit}, allowed are {least:.0f} to {most:.0f} {unit}: {why}"
    if identity.accelerometer_g not in ACCELEROMETER_G:
        allowed = ", ".join(map(str, ACCELEROMETER_G))
        yield f"accelerometer_g is {identity.accelerometer_g} g, allowed are {allowed} g"
