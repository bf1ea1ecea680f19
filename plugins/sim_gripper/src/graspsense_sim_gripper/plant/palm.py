"""The accelerometer in the palm: three samples a tick, three axes, as a fast channel of the gripper.

The axes are those of the PR2's palm (pr2_common, pr2_description/urdf/gripper_v0/gripper.urdf.xacro): x from the wrist
to the fingertips, y to the left finger, z up. At rest z shows the acceleration of free fall.

The gripper is a mass that the arm holds by a spring and a damper. Two forces of the grasp act on it:

- Along y, the difference of the forces on the two pads. It is zero while both fingers press the object, and the
  friction of the table while one finger pushes it.
- Along x, the reaction to the swing of the fingers. A fingertip moves on an arc of radius r: its half gap changes by
  r sin(theta), and its position along x by r cos(theta). With the gap p, x'' = -(tan(theta) p'' +
  p'^2 / (2 r cos(theta)^3)) / 2, and the force is -2 m x''. Along y the two fingers move in opposition, without
  reaction.

Between two ticks, the acceleration of the gap is constant and the forces on the pads change linearly. The mass on its
spring is advanced exactly for the mean force of each third of a tick.

The noise is white and Gaussian: a floor, and the vibration of the gears in proportion to the speed of the motor. An
ideal sensor has none.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from graspsense.gripper_api import ScrewLinkage
from graspsense.plugin_api import FastChannel, Samples
from graspsense.testing_api import SampleTrace
from graspsense_sim_gripper.plant.state import PlantState

SAMPLES: Final = 3
"""New samples in each tick: 3 kHz at 1000 ticks a second, the rate of the PR2's accelerometer (pr2_ethercat_drivers,
ethercat_hardware/src/wg06.cpp)."""
MOST_SAMPLES: Final = 4
"""Samples that a tick can hold: as many as a packet of the PR2."""
AXES: Final = ("x", "y", "z")
NUMBERS: Final = SAMPLES * len(AXES)
FREE_FALL_M_S2: Final = 9.81
PALM_KG: Final = 0.58007 + 0.17126 + 0.17389 + 2.0 * 0.04419
"""Mass of palm, fingers and fingertips (gripper.urdf.xacro)."""
SWINGING_KG: Final = 0.17126 * 0.03598 / 0.09137 + 0.04419
"""Mass of one finger that swings with its tip: the fingertip, and the finger's own mass times the share of its length
at which its centre of mass lies (gripper.urdf.xacro)."""
ARM_HZ: Final = 15.0
ARM_DAMPING: Final = 0.2
"""Natural frequency and damping ratio of the gripper on its arm: assumptions."""
FLOOR_M_S2: Final = 0.2
"""Standard deviation of the noise at rest: an assumption, somewhat more than a step of 10 bits over 8 g."""
GEAR_M_S2_REV_S: Final = 0.01
"""Standard deviation of the vibration, for each revolution of the motor a second: an assumption. 15 mm/s then give
0.4 m/s2, and 0.2 m/s give 5 m/s2. pr2_gripper_sensor_msgs (EventDetectorCommand.msg) recommends thresholds of 2 m/s2
for gentle motion and of 5 m/s2 for fast motion."""


class Arm(NamedTuple):
    """The gripper on its arm."""

    mass_kg: float
    stiffness_n_m: float
    damping_n_s_m: float


class ThirdOfTick(NamedTuple):
    """The displacement x and the speed v after a third of a tick, as linear functions of both and of the mean force."""

    x_of_x: float
    x_of_v: float
    x_of_n: float
    v_of_x: float
    v_of_v: float
    v_of_n: float


class Noise(NamedTuple):
    """The noise of the sensor."""

    present: int
    """1: with noise; 0: an ideal sensor, for which row 0 of the noise is read and multiplied by zero."""
    floor_m_s2: float
    gear_m_s2_rev_s: float


class PalmParams(NamedTuple):
    """The palm: the swing of the fingers, the arm, and the noise."""

    finger_m: float
    half_gap0_m: float
    arm: Arm
    third: ThirdOfTick
    noise: Noise


class PalmState(NamedTuple):
    """Displacement and speed of the palm along x and y, and what acted on it at the last tick."""

    x_m: float
    x_m_s: float
    y_m: float
    y_m_s: float
    rate_m_s: float
    """Rate of the gap."""
    difference_n: float
    """Force on the left pad less that on the right one."""


AT_REST: Final = PalmState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class PalmSignals(NamedTuple):
    """`Reading.signals` of a simulated gripper with an accelerometer."""

    acceleration: Samples


class PalmBuffers(NamedTuple):
    """The memory of the loop for the palm: arrays in compiled code, lists in the interpreter."""

    noise: Any
    """(k, 9) Standard normal numbers for each tick."""
    samples: Any
    """(9, n) The samples of each recorded tick: x, y and z of the first, then of the others."""


def channel(rate_hz: float) -> FastChannel:
    """Return the channel of the acceleration, of a gripper with so many ticks a second."""
    return FastChannel("acceleration", "m/s2", SAMPLES * rate_hz, samples=MOST_SAMPLES, axes=AXES)


def palm_params(link: ScrewLinkage, dt_s: float, *, ideal: bool) -> PalmParams:
    """Return the palm of a gripper with this linkage and this time between ticks (s)."""
    third_s, own = dt_s / SAMPLES, 2.0 * math.pi * ARM_HZ
    decay, bound = ARM_DAMPING * own, own * math.sqrt(1.0 - ARM_DAMPING * ARM_DAMPING)
    fall = math.exp(-decay * third_s)
    cosine, sine = fall * math.cos(bound * third_s), fall * math.sin(bound * third_s) / bound
    stiffness = PALM_KG * own * own
    x_of_x, v_of_x = cosine + decay * sine, -own * own * sine
    return PalmParams(
        finger_m=link.finger_m,
        half_gap0_m=link.half_gap0_m,
        arm=Arm(PALM_KG, stiffness, 2.0 * decay * PALM_KG),
        third=ThirdOfTick(
            x_of_x=x_of_x,
            x_of_v=sine,
            x_of_n=(1.0 - x_of_x) / stiffness,
            v_of_x=v_of_x,
            v_of_v=cosine - decay * sine,
            v_of_n=-v_of_x / stiffness,
        ),
        noise=Noise(0, 0.0, 0.0) if ideal else Noise(1, FLOOR_M_S2, GEAR_M_S2_REV_S),
    )


def palm_signals(
    params: PalmParams,
    state: PalmState,
    plant: PlantState,
    t_s: float,
    dt_s: float,
    tick: int,
    buffers: PalmBuffers,
) -> tuple[PalmSignals, PalmState]:
    """Return the samples since the last tick, the last of them at `t_s`, and the new state of the palm."""
    x, x_rate, y, y_rate, rate0, difference0 = state
    motion, contact = plant.motion, plant.contact
    rate, difference = motion.speed_rev_s * motion.jacobian_m_rev, contact.left_n - contact.right_n
    swing_n = swing_force(params, motion.gap_m, rate, (rate - rate0) / dt_s)
    change = (difference - difference0) / SAMPLES
    arm, third_of_tick = params.arm, params.third
    present, floor, gear_m_s2_rev_s = params.noise
    noise = buffers.noise[tick if present == 1 else 0]
    gear = gear_m_s2_rev_s * motion.speed_rev_s
    spread = math.sqrt(floor * floor + gear * gear)

    force1 = difference0 + change
    force2 = force1 + change
    x, x_rate = _advanced(third_of_tick, x, x_rate, swing_n)
    y, y_rate = _advanced(third_of_tick, y, y_rate, difference0 + 0.5 * change)
    first = (
        _acceleration(arm, x, x_rate, swing_n) + spread * noise[0],
        _acceleration(arm, y, y_rate, force1) + spread * noise[1],
        FREE_FALL_M_S2 + spread * noise[2],
    )
    x, x_rate = _advanced(third_of_tick, x, x_rate, swing_n)
    y, y_rate = _advanced(third_of_tick, y, y_rate, force1 + 0.5 * change)
    second = (
        _acceleration(arm, x, x_rate, swing_n) + spread * noise[3],
        _acceleration(arm, y, y_rate, force2) + spread * noise[4],
        FREE_FALL_M_S2 + spread * noise[5],
    )
    x, x_rate = _advanced(third_of_tick, x, x_rate, swing_n)
    y, y_rate = _advanced(third_of_tick, y, y_rate, force2 + 0.5 * change)
    third = (
        _acceleration(arm, x, x_rate, swing_n) + spread * noise[6],
        _acceleration(arm, y, y_rate, difference) + spread * noise[7],
        FREE_FALL_M_S2 + spread * noise[8],
    )
    rows = (first, second, third, (math.nan, math.nan, math.nan))
    samples = Samples(t_s, SAMPLES * (tick + 1), SAMPLES, rows)
    return PalmSignals(samples), PalmState(x, x_rate, y, y_rate, rate, difference)


def keep_samples(signals: PalmSignals, buffers: PalmBuffers, row: int) -> None:
    """Write the samples of a tick to a column of the buffer."""
    values, samples = signals.acceleration.values, buffers.samples
    for i in range(SAMPLES):
        x, y, z = values[i]
        samples[3 * i][row] = x
        samples[3 * i + 1][row] = y
        samples[3 * i + 2][row] = z


def sample_trace(t_s: NDArray[np.float64], samples: NDArray[np.float64]) -> SampleTrace:
    """Return the samples of these ticks, given as in `PalmBuffers.samples`, as the runner records them."""
    spacing = np.zeros(len(t_s))
    if len(t_s) > 1:
        spacing[1:] = (t_s[1:] - t_s[:-1]) / SAMPLES
        spacing[0] = spacing[1]
    times = t_s[:, None] - spacing[:, None] * np.arange(SAMPLES - 1, -1, -1)
    return SampleTrace(t_s=times.ravel(), values=samples.T.reshape(-1, len(AXES)).copy())


def swing_force(params: PalmParams, gap_m: float, rate_m_s: float, rate_m_s2: float) -> float:
    """Return the force of both fingers on the palm along x (N); 0 where the jaws do not swing."""
    radius = params.finger_m
    if radius == 0.0:
        return 0.0
    sine = (0.5 * gap_m - params.half_gap0_m) / radius
    square = 1.0 - sine * sine
    cosine = math.sqrt(square)
    return SWINGING_KG * (sine * rate_m_s2 + rate_m_s * rate_m_s / (2.0 * radius * square)) / cosine


def _advanced(third: ThirdOfTick, x: float, rate: float, force_n: float) -> tuple[float, float]:
    """Return displacement and speed after a third of a tick under a constant force."""
    after = third.x_of_x * x + third.x_of_v * rate + third.x_of_n * force_n
    return after, third.v_of_x * x + third.v_of_v * rate + third.v_of_n * force_n


def _acceleration(arm: Arm, x: float, rate: float, force_n: float) -> float:
    return (force_n - arm.stiffness_n_m * x - arm.damping_n_s_m * rate) / arm.mass_kg
