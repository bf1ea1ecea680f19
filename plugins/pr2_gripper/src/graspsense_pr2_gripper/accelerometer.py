"""The accelerometer in the palm of the PR2: its channel, and the words of a report as accelerations.

A sample is a word of 32 bits with x, y and z in 10 bits each, signed, of full scale 512. The axes are those of the palm
(pr2_common, pr2_description/urdf/gripper_v0/gripper.urdf.xacro): x from the wrist to the fingertips, y to the left
finger, z up. The sensor has a clock of its own, of about 3 kHz. Boards of the first two revisions have no accelerometer
(pr2_ethercat_drivers, ethercat_hardware/src/wg06.cpp).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import nan
from random import Random
from typing import Any, Final

from graspsense.plugin_api import Channel, FastChannel, Samples, signal_type
from graspsense_pr2_gripper.protocol import MAX_SAMPLES

RATE_HZ: Final = 3000.0
"""Nominal rate of the samples; the PR2's own driver accepts 2 to 4 kHz (wg06.cpp)."""
RANGE_G: Final = 8
"""Full scale in which pr2_gripper_sensor uses the sensor (acceleration_observer.cpp); the others are 2 and 4."""
FULL_SCALE: Final = 512
FREE_FALL_M_S2: Final = 9.81
"""Acceleration of free fall with which the PR2's own driver converts (wg06.cpp)."""
CHANNEL: Final = FastChannel(
    "acceleration", "m/s2", RATE_HZ, samples=MAX_SAMPLES, axes=("x", "y", "z"), clock="sensor"
)

SAMPLES_PER_REPORT: Final = 3
"""Number of samples in a report of an emulated board: 3 kHz at 1000 reports a second."""
REST_NOISE_M_S2: Final = 0.2
"""Standard deviation of each axis of an emulated sensor at rest: assumed, somewhat more than a step of 10 bits."""

_SIGNALS: Final = signal_type((CHANNEL,))
_NONE: Final = ((nan, nan, nan),) * MAX_SAMPLES
_FILL: Final = tuple(_NONE[n:] for n in range(MAX_SAMPLES + 1))


class Accelerometer:
    """Converts the words of a sensor of this full scale, in multiples of free fall; 0: there is no sensor."""

    def __init__(self, range_g: int) -> None:
        scale = range_g * FREE_FALL_M_S2 / FULL_SCALE
        self._m_s2 = tuple(((count ^ FULL_SCALE) - FULL_SCALE) * scale for count in range(2 * FULL_SCALE))

    def signals(self, t_s: float, words: Sequence[int], sampled: int) -> Any:
        """Return `Reading.signals` with these samples, the last of them of time `t_s` and with number `sampled`."""
        m_s2, new = self._m_s2, len(words)
        rows = [(m_s2[word & 0x3FF], m_s2[word >> 10 & 0x3FF], m_s2[word >> 20 & 0x3FF]) for word in words]
        return _SIGNALS(Samples(t_s, sampled, new, (*rows, *_FILL[new])))


class PalmAtRest:
    """The samples of an emulated sensor that nothing moves: free fall along z, and noise that follows from the seed."""

    def __init__(self, seed: int) -> None:
        self._gauss = Random(seed).gauss

    def samples(self) -> list[tuple[float, float, float]]:
        """Return the samples (m/s2) of the next report."""
        gauss, sd = self._gauss, REST_NOISE_M_S2
        return [
            (gauss(0.0, sd), gauss(0.0, sd), gauss(FREE_FALL_M_S2, sd)) for _ in range(SAMPLES_PER_REPORT)
        ]


def has_accelerometer(channels: Iterable[Channel]) -> bool:
    """Return whether a gripper with these channels measures an acceleration that fits into the reports of the board."""
    return any(
        isinstance(channel, FastChannel)
        and (channel.name, channel.unit, channel.axes) == (CHANNEL.name, CHANNEL.unit, CHANNEL.axes)
        and channel.samples <= MAX_SAMPLES
        for channel in channels
    )


def word_of(sample: Sequence[float], range_g: int) -> int:
    """Return the word of an acceleration along x, y and z (m/s2), limited to the full scale."""
    scale, word = FULL_SCALE / (range_g * FREE_FALL_M_S2), 0
    for axis, value in enumerate(sample):
        count = min(max(round(value * scale), -FULL_SCALE), FULL_SCALE - 1)
        word |= (count & 0x3FF) << 10 * axis
    return word
