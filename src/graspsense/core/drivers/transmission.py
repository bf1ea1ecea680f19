"""The closed form of a screw-driven finger linkage: motor revolutions to gap and back.

A motor turns a screw, the screw sets the length of one side of a triangle whose other sides a and b are fixed, and the
triangle turns a finger of length r (`pr2_mechanism_model/src/pr2_gripper_transmission.cpp`). Both a driver (counts to
metres) and a simulated gripper (reflected inertia, encoder) use this map, and neither may import the other. The
constants of a gripper belong to its plugin.
"""

from __future__ import annotations

import math
from typing import NamedTuple


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
    """Sine of theta0 - phi0, the angle of the finger relative to the triangle."""
    base_cosine: float
    finger_m: float
    """0 for a linkage without fingers, whose screw moves the jaws."""
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
    """Return the linkage with these constants, in millimetres and degrees as they are usually published."""
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
    """Return a screw that moves both jaws along a line: the gap changes by `pitch_m` in each motor revolution."""
    return ScrewLinkage(
        pitch_m=pitch_m,
        length0_m=0.0,
        cosine0=0.0,
        cosine_m2=0.0,
        base_sine=0.0,
        base_cosine=0.0,
        finger_m=0.0,
        half_gap0_m=0.0,
    )


def gap_and_rate(link: ScrewLinkage, revolutions: float) -> tuple[float, float]:
    """Return the gap (m) at this motor angle (revolutions), and its derivative (m/revolution).

    The published form is gap = 2 (t0 + r (sin theta - sin theta0)) with theta = theta0 - phi0 + acos(u). Here the sine
    of the sum of angles is expanded, which leaves one square root.
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
    # Only a product and a difference depend on the root: the time of a simulated tick depends on this function.
    return gap, 4.0 * pitch * cosine_m2 * finger * length * (base_cosine * u / square * sine - base_sine)


def revolutions_at(link: ScrewLinkage, gap_m: float) -> float:
    """Return the motor angle (revolutions) at which the gap is `gap_m`: the inverse of `gap_and_rate`."""
    if link.finger_m == 0.0:
        return (gap_m - 2.0 * link.half_gap0_m) / link.pitch_m
    sine = (0.5 * gap_m - link.half_gap0_m) / link.finger_m
    u = math.sqrt(1.0 - sine * sine) * link.base_cosine + sine * link.base_sine
    length = math.sqrt(max((link.cosine0 - u) / link.cosine_m2, 0.0))
    return (length - link.length0_m) / link.pitch_m
