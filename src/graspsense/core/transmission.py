"""The closed form of a screw-driven finger linkage: motor revolutions to gap and back.

The map is that of the PR2 gripper (`pr2_mechanism_model/src/pr2_gripper_transmission.cpp`): a motor turns a
screw, the screw sets one side of a triangle with fixed sides a and b, and the triangle turns a finger of length
r. It stands in the core because a driver (counts to metres) and a simulated gripper (reflected inertia, encoder)
need the one law, and neither may know the other.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final, NamedTuple


class ScrewLinkage(NamedTuple):
    """Constants of the map, in metres; build with `screw_linkage`."""

    pitch_m: float
    """Travel of the screw in one revolution of the motor."""
    length0_m: float
    cosine0: float
    """(a^2 + b^2 - h^2) / 2ab"""
    cosine_m2: float
    """1 / 2ab"""
    base_sine: float
    """Sine of theta0 - phi0, what the finger's angle adds to the triangle's."""
    base_cosine: float
    finger_m: float
    """0: there is no finger, and the screw moves the jaws themselves."""
    half_gap0_m: float


def screw_linkage(
    *,
    screw_mm: float,
    gear: float,
    theta0_deg: float,
    phi0_deg: float,
    t0_mm: float,
    length0_mm: float,
    h_mm: float,
    a_mm: float,
    b_mm: float,
    r_mm: float,
) -> ScrewLinkage:
    """Return the linkage with these published constants (millimetres and degrees, as they are published)."""
    theta0 = math.radians(theta0_deg)
    return ScrewLinkage(
        pitch_m=screw_mm / gear / 1e3,
        length0_m=length0_mm / 1e3,
        cosine0=(a_mm * a_mm + b_mm * b_mm - h_mm * h_mm) / (2.0 * a_mm * b_mm),
        cosine_m2=1e6 / (2.0 * a_mm * b_mm),
        base_sine=math.sin(theta0 - math.radians(phi0_deg)),
        base_cosine=math.cos(theta0 - math.radians(phi0_deg)),
        finger_m=r_mm / 1e3,
        half_gap0_m=(t0_mm - r_mm * math.sin(theta0)) / 1e3,
    )


def straight_linkage(pitch_m: float) -> ScrewLinkage:
    """Return a screw that moves both jaws straight: the gap is `pitch_m` for each revolution of the motor."""
    return ScrewLinkage(pitch_m, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


_ALPHA2 = {
    "theta0_deg": 2.97571,
    "phi0_deg": 29.98717,
    "t0_mm": -0.19543,
    "length0_mm": 34.70821,
    "h_mm": 5.200,
    "a_mm": 67.56801,
    "b_mm": 48.97193,
    "r_mm": 91.5,
}

PR2_LINKAGES: Final[Mapping[str, ScrewLinkage]] = {
    # pr2_common, pr2_description/robots/pr2.urdf.xacro: the gripper as it was delivered.
    "pr2": screw_linkage(
        screw_mm=4.0,
        gear=(729.0 / 25.0) * (22.0 / 16.0),
        theta0_deg=3.6029,
        phi0_deg=29.7089,
        t0_mm=-0.1914,
        length0_mm=37.5528,
        h_mm=0.0,
        a_mm=68.3698,
        b_mm=43.3849,
        r_mm=91.5,
    ),
    # Full-robot description of September 2009 (personalrobots-pkg), with the alpha2 linkage in code.
    "pr2_2009": screw_linkage(screw_mm=2.0, gear=29.16, **_ALPHA2),
    # The paper package's own launch file, sandbox/pr2_gripper_controller/launch/gripper.xml ("new gripper").
    "pr2_paper": screw_linkage(screw_mm=4.0, gear=29.16 * 22.0 / 16.0 * 0.9, **_ALPHA2),
}
"""The three published sets. Which of them the paper's data were taken with is not stated."""

PR2_ENCODER_TICKS: Final = 1200
"""Encoder pulses in one motor revolution (pr2_ethercat_drivers, actuators.conf)."""


def gap_and_rate(link: ScrewLinkage, revolutions: float) -> tuple[float, float]:
    """Return the gap (m) at this motor angle (revolutions), and how fast it changes with it (m/revolution).

    Published as gap = 2 (t0 + r (sin theta - sin theta0)) with theta = theta0 - phi0 + acos(u); the sum of angles
    is written out here, which leaves one square root.
    """
    pitch, length0, cosine0, cosine_m2, base_sine, base_cosine, finger, half_gap0 = link
    if finger == 0.0:
        return 2.0 * half_gap0 + pitch * revolutions, pitch
    length = length0 + revolutions * pitch
    u = cosine0 - length * length * cosine_m2
    if u > 1.0:
        u = 1.0
    elif u < -1.0:
        u = -1.0
    square = 1.0 - u * u
    sine = math.sqrt(square)
    gap = 2.0 * (half_gap0 + finger * (base_sine * u + base_cosine * sine))
    if square < 1e-24:
        square, sine = 1e-24, 1e-12
    # Nothing but a product and a difference waits for the root: a simulator's ticks are as long as this takes.
    return gap, 4.0 * pitch * cosine_m2 * finger * length * (base_cosine * u / square * sine - base_sine)


def revolutions_at(link: ScrewLinkage, gap_m: float) -> float:
    """Return the motor angle (revolutions) at which the gap is `gap_m`: the inverse of `gap_and_rate`."""
    if link.finger_m == 0.0:
        return (gap_m - 2.0 * link.half_gap0_m) / link.pitch_m
    sine = (0.5 * gap_m - link.half_gap0_m) / link.finger_m
    u = math.sqrt(1.0 - sine * sine) * link.base_cosine + sine * link.base_sine
    length = math.sqrt(max((link.cosine0 - u) / link.cosine_m2, 0.0))
    return (length - link.length0_m) / link.pitch_m
