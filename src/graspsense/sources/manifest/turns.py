"""Whether force and gap turn together: under a load, the rate of a force changes when the fingers change their speed.

It does so at the same time and as sharply, since a force follows the deformation, or runs before it where an object is
viscous. A signal that was smoothed turns slowly, and so does one where the other turns if it is of another time.
How sharply a signal turns is its second difference over a short time, as a share of that over a time `FAR` times as
long if it grew with the time: 1 at a kink, and 1 / `FAR` where its course is smooth.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.sources.columns.channel_facts import period_s, resolution, usual_range
from graspsense.sources.columns.recording_notices import LOADED, PART
from graspsense.sources.formats.table import Numbers
from graspsense.sources.manifest.steps import NOISE

TURN_S: Final = 0.025
"""Short time over which a signal turns (s), at least two samples."""
FAR: Final = 4
LONGEST_S: Final = 0.2
"""A recording with too few samples to see a turn within this time (s) tells of none."""
SHARP: Final = 0.7
SMOOTH: Final = 0.32
"""How sharp a turn is that both signals have to make, and how sharp one that was smoothed."""
HOLES: Final = 0.25
"""Largest share of the time in which samples are missing."""
LARGEST: Final = 0.5
"""Share of the largest turn from which on turns are compared."""
DUE: Final = 0.2
"""Share of the range of a force by which it has to turn where its mean stiffness under a load says so."""
STEPS: Final = 3.0
"""A turn is larger than so many steps of a coarse signal."""


@frozen(eq=False)
class _Turns:
    """How a signal turns at each sample of a steady clock but those near both ends: up is positive."""

    range: float
    unknown: float
    """How far noise and rounding turn it."""
    near: Numbers
    far: Numbers

    @classmethod
    def measured(cls, signal: Numbers, steady: Numbers, n: int) -> _Turns:
        """Return the turns of a signal over `n` samples; `steady` are its values on the steady clock."""
        low, high = usual_range(signal)
        noise = NOISE * float(np.median(np.abs(np.diff(signal, 2))))
        near, far = (
            (np.roll(steady, m) + np.roll(steady, -m) - 2.0 * steady)[FAR * n : -FAR * n]
            for m in (n, FAR * n)
        )
        return cls(high - low, max(noise, STEPS * (resolution(signal) or 0.0)), near, far)

    @property
    def sharp(self) -> Numbers:
        """How sharply it turns, 0 where it does not."""
        sharp: Numbers = FAR * np.abs(self.near) / np.where(self.far == 0.0, np.inf, np.abs(self.far))
        return sharp

    def largest(self, loaded: NDArray[np.bool_], told: NDArray[np.bool_]) -> int | None:
        """Return the largest sharp turn under a load, of those that tell something, if none under a load is larger."""
        near = np.abs(self.near)
        least = max(self.unknown, LARGEST * float(near.max(initial=0.0, where=loaded)))
        known = loaded & told & (near > least) & (self.sharp > SHARP)
        return int(np.argmax(near * known)) if known.any() else None

    def around(self, k: int, reach: int) -> tuple[float, float]:
        """Return the largest turn within so many samples around one over the short time, and over the long one."""
        part = slice(max(k - reach, 0), k + reach + 1)
        return float(np.abs(self.near[part]).max()), float(np.abs(self.far[part]).max())


def apart(t_s: Numbers, gap: Numbers, force: Numbers) -> Iterator[str]:
    """Yield that one of gap and force turns where the other does not, by the times of a recording (s)."""
    if not (np.isfinite(t_s[[0, -1]]).all() and np.diff(t_s).min() > 0.0):
        return
    step_s = max(period_s(t_s, signal) for signal in (t_s, gap, force))
    n = max(2, round(TURN_S / step_s))
    rows = (t_s[-1] - t_s[0]) / step_s
    if FAR * n * step_s > LONGEST_S or not 2 * FAR * n < rows < (1.0 + HOLES) * len(t_s):
        return
    clock = np.arange(t_s[0], t_s[-1], step_s)
    widths, loads = np.interp(clock, t_s, gap), np.interp(clock, t_s, force)
    gaps, forces = _Turns.measured(gap, widths, n), _Turns.measured(force, loads, n)
    loaded, least = loads - usual_range(force)[0] > PART * forces.range, LARGEST * PART * forces.range
    # A gap need not turn at a contact, from where the force of a soft object and a slow drive grows ever faster.
    high = loads - usual_range(force)[0] > LOADED * forces.range
    pressed = (high & np.roll(high, n) & np.roll(high, -n))[FAR * n : -FAR * n]
    # A force that was smoothed over a longer time does not turn at all.
    due = gaps.far * forces.range / max(float(np.ptp(widths[loaded])), gaps.unknown)
    # Where the fingers begin to open, or meet more than before; their drive can speed up by itself.
    k = gaps.largest(
        (gaps.near > 0.0) & loaded[FAR * n : -FAR * n],
        (np.abs(forces.far) > least) | (due > DUE * forces.range),
    )
    near, far = (0.0, 0.0) if k is None else forces.around(k, n // 2 + 1)
    if k is not None and (far < least or FAR * near < SHARP * far * min(gaps.sharp[k], 1.0)):
        yield (
            f"the fingers change their speed at once at {clock[k + FAR * n]:.4g} s, under a load, and the rate of the "
            "force changes slowly: was the force smoothed, or is it of another time than the gap? A contact is then "
            "seen too early or too late"
        )
        return
    k = forces.largest(pressed, (np.abs(forces.near) > least) & (np.abs(gaps.far) > gaps.unknown))
    near, far = (0.0, 0.0) if k is None else gaps.around(k, n // 2 + 1)
    if k is not None and FAR * near < SMOOTH * far:
        yield (
            f"the rate of the force changes at once at {clock[k + FAR * n]:.4g} s, under a load, and the fingers "
            "change their speed slowly: was the gap smoothed, or is it of another time than the force? A rest is then "
            "seen too late"
        )
