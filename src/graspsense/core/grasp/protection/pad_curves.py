"""The force of a pad over the gap: what it feels on closing, on opening, and when the fingers have let go.

No object gives back more force than it took at the same gap. A pad that feels more on opening is late, or has another
scale or zero than on closing. A pad that feels a force with open fingers has lost its zero in the grasp.
"""

from __future__ import annotations

from collections import deque
from math import inf, log, log1p, nan
from typing import Final

from graspsense.core.grasp.protection.cells import DOUBT, MOST_NOISY, NOISY_SHARE
from graspsense.core.grasp.protection.pad_forces import FREE_SHARE, PadBalance
from graspsense.core.values.faults import Fault
from graspsense.core.values.signals import APPROACH, CLOSING, Phase, Reading

LATE_S: Final = 0.02
LATE_PERIODS: Final = 1.25
"""How old the force of a sound pad can be: a period, and the time of the transmission."""
SLACK_M: Final = 0.0005
"""By how much gaps may differ that count as the same: a step of a coarse encoder."""
MORE_CONTACTS: Final = 0.5
MORE_SHARE: Final = 0.2
"""By how much a pad may feel more on opening: a share of the contact force, and the share of the force by which a
spring that gets softer as it is pressed is above a straight line."""
HARDLY_SHARE: Final = 0.65
"""Share of the fall of the force by which it may stay behind, where that is less."""
FEWEST_MORE: Final = 2
MORE_S: Final = 0.02
"""So many samples in a row, over so long a time, show that it does."""
OPENED_M: Final = 0.005
"""So much wider than at the contact, no object touches both fingers any more."""
FEWEST_OPEN: Final = 2
OPEN_S: Final = 0.03
"""So many samples at the end of the release, and so long a time after the object, show the zero of a pad."""
ZERO_CONTACTS: Final = 0.5
ZERO_SHARE: Final = 0.1
"""By how much the zero may have moved: a share of the contact force, or of the greatest force. The PR2's object
manipulator tares again after a hard squeeze, since a rest of the load remains (pr2_gripper_reactive_approach)."""
STILL_CHANCE: Final = log(1e-6)
"""The logarithm of the probability below which noise does not explain that forces stand still."""
SPIKE_CONTACTS: Final = 0.8
SPIKE_SHARE: Final = 0.15
"""By how much a sample may differ from the mean of its neighbours, over what the other pad shows: a share of the
contact force, or of the force."""
RETURNS: Final = 0.3
"""Share of a jump by which the next sample goes back if it is noise; beyond a step, the force stays."""
FEWEST_SPIKES: Final = 2
"""Samples of the approach, with a free pad around each, that are no knock at the object."""


class PadCurve:
    """The force of one pad over the gap, sample by sample."""

    def __init__(self, side: str, contact_n: float) -> None:
        self._side, self._contact_n = side, contact_n
        self._closing: list[tuple[float, float]] = []
        """Gap (m) and force (N) of each sample that felt more than all before it."""
        self._contact_gap_m = self._last_n = nan
        self._held = (nan, nan)
        """Gap (m) and force (N) of the last sample of the closing."""
        self._free_samples = self._changes = self._still = 0
        self._more = 0
        self._more_t_s = self._open_t_s = nan
        self._open_n: deque[float] = deque(maxlen=FEWEST_OPEN)

    @property
    def _greatest_n(self) -> float:
        return self._closing[-1][1] if self._closing else 0.0

    def press(self, force_n: float, earlier_gap_m: float) -> None:
        """Take a sample that can be of the closing, with the gap at the time of which it can be."""
        self._held = earlier_gap_m, force_n
        if force_n > self._greatest_n:
            self._closing.append((earlier_gap_m, force_n))

    def touch(self, earlier_gap_m: float) -> None:
        """Take a gap at which both pads feel a contact."""
        if not earlier_gap_m < self._contact_gap_m:
            self._contact_gap_m = earlier_gap_m

    def close(self, force_n: float, earlier_gap_m: float, phase: int) -> Fault | None:
        """Take a sample while the fingers close or hold, with the gap at the time of which it can be."""
        self.press(force_n, earlier_gap_m)
        changed, self._last_n = force_n != self._last_n, force_n
        self._still = 0 if changed else self._still + 1
        if phase == APPROACH:
            self._free_samples += 1
            self._changes += changed
        if phase == APPROACH or not force_n < -self._contact_n:
            return None
        return Fault(
            f"{self._side} pad below zero",
            f"it feels {force_n:.1f} N while the fingers press, and nothing pulls: check its sign and its zero",
        )

    @property
    def _noise(self) -> float:
        return min(self._changes / (self._free_samples + DOUBT), MOST_NOISY)

    @property
    def still_chance(self) -> float:
        """The logarithm of the probability that its noise lets the force stand still for so long."""
        return self._still * log1p(-self._noise) if self._noise >= NOISY_SHARE else 0.0

    def stands_still(self) -> Fault:
        """Return the fault of a force that does."""
        return Fault(
            f"{self._side} pad stands still",
            f"it gives {self._last_n:.2f} N in {self._still + 1} samples in a row, and changed in "
            f"{100.0 * self._noise:.0f} % of those in free air: it is at the end of its range, or stuck; check the "
            "fingertip",
        )

    def open(self, force_n: float, t_s: float, gap_m: float, earlier_gap_m: float) -> Fault | None:
        """Take a sample of the release."""
        if earlier_gap_m > self._contact_gap_m + OPENED_M:
            if not self._open_n:
                self._open_t_s = t_s
            self._open_n.append(force_n)
            return None
        most_n = self._most_n(earlier_gap_m - SLACK_M)
        held_n = self._held[1]
        allowed_n = min(MORE_SHARE * held_n, HARDLY_SHARE * (held_n - most_n))
        if not force_n - most_n > max(MORE_CONTACTS * self._contact_n, allowed_n):
            self._more = 0
            return None
        if not self._more:
            self._more_t_s = t_s
        self._more += 1
        if self._more < FEWEST_MORE or t_s - self._more_t_s < MORE_S:
            return None
        return Fault(
            f"{self._side} pad feels more on opening",
            f"{force_n:.1f} N at {gap_m * 1e3:.1f} mm, where {most_n:.1f} N follow from the closing, though no object "
            "gives back more than it took: its force comes late, so that gaps, times and rates of the contact are "
            "wrong, or its scale or zero changed in the squeeze; check its connection and its calibration",
        )

    def _most_n(self, gap_m: float) -> float:
        """Return the force (N) of an object on its way back: at most that of the closing, and of a spring."""
        closing_n = next(
            (felt_n for felt_gap_m, felt_n in reversed(self._closing) if felt_gap_m >= gap_m), 0.0
        )
        (held_gap_m, held_n), contact_gap_m = self._held, self._contact_gap_m
        share = (contact_gap_m - gap_m) / max(contact_gap_m - held_gap_m, SLACK_M)
        return min(closing_n, held_n * min(max(share, 0.0), 1.0)) if share == share else closing_n

    def released(self, t_s: float) -> Fault | None:
        """Return what the last samples of the release show: a force that is only late has gone by then."""
        if len(self._open_n) < FEWEST_OPEN or t_s - self._open_t_s < OPEN_S:
            return None
        mean_n = sum(self._open_n) / FEWEST_OPEN
        allowed_n = max(ZERO_CONTACTS * self._contact_n, ZERO_SHARE * self._greatest_n)
        if not abs(mean_n) > allowed_n:
            return None
        return Fault(
            f"{self._side} pad off its zero",
            f"it feels {mean_n:+.2f} N although the fingers have let go, and {allowed_n:.2f} N are allowed: its zero "
            "moved in the grasp, so that its forces are wrong by that, or the object leans on it; look at the object, "
            "and tare again",
        )


class Spikes:
    """Sees samples of one pad that the ones before and after do not explain, and the other pad has not felt.

    In the approach, one of them can be an object that is knocked away.
    """

    def __init__(self, contact_n: float) -> None:
        self._contact_n = contact_n
        self._forces: deque[tuple[float, float]] = deque(maxlen=3)
        self._free = True
        """Whether the last sample was of the approach."""
        self._free_spikes = [0, 0]

    def see(self, forces: tuple[float, float], phase: int) -> Fault | None:
        """Take a sample of both pads (left, right; N) while the fingers close or hold."""
        free, self._free = self._free, phase == APPROACH
        if forces[0] != forces[0] or forces[1] != forces[1] or free != self._free:
            self._forces.clear()
            return None
        self._forces.append(forces)
        if len(self._forces) < 3:
            return None
        earlier, middle, later = self._forces
        bends = [middle[i] - 0.5 * (earlier[i] + later[i]) for i in (0, 1)]
        i = 0 if abs(bends[0]) > abs(bends[1]) else 1
        if not abs(bends[0] - bends[1]) > max(SPIKE_CONTACTS * self._contact_n, SPIKE_SHARE * max(middle)):
            return None
        if self._free:
            self._free_spikes[i] += max(earlier[i], later[i]) < FREE_SHARE * self._contact_n
            if self._free_spikes[i] < FEWEST_SPIKES:
                return None
        side, other = ("left", "right") if i == 0 else ("right", "left")
        jump_n, back_n = middle[i] - earlier[i], middle[i] - later[i]
        returns = jump_n * back_n > 0.0 and min(jump_n / back_n, back_n / jump_n) > RETURNS
        return Fault(
            f"{side} pad noisy" if returns else f"{side} pad jumps",
            f"it went from {earlier[i]:.1f} over {middle[i]:.1f} to {later[i]:.1f} N, which the {other} one did not "
            "feel: it has noise, or a loose contact; check its cable",
        )


class PadCurves:
    """Both pads of a gripper with forces at this rate (Hz; 0: not known)."""

    def __init__(self, contact_n: float, pads_hz: float) -> None:
        self._contact_n = contact_n
        self._period_s = 1.0 / pads_hz if pads_hz > 0.0 else 0.0
        self._late_s = LATE_S + LATE_PERIODS * (self._period_s or LATE_S)
        self._pads = (PadCurve("left", contact_n), PadCurve("right", contact_n))
        self._gaps: deque[tuple[float, float]] = deque()
        self._counter, self._t_s = 0, nan
        self._least_gap_m = inf
        self._spikes, self._balance = Spikes(contact_n), PadBalance(contact_n, pads_hz)

    def see(self, reading: Reading, phase: int) -> list[Fault]:
        """Take the reading of a tick; return the faults that it shows."""
        frame = reading.frame
        gaps = self._gaps
        gaps.append((frame.t_s, frame.gap_m))
        while len(gaps) > 1 and gaps[1][0] <= frame.t_s - self._late_s:
            gaps.popleft()
        closing = phase in CLOSING
        new = self._is_new(reading)
        faults = [self._balance.see(frame, phase, new=new)]
        if not new:
            return [fault for fault in faults if fault is not None]
        earlier_gap_m = gaps[0][1]
        self._least_gap_m = min(self._least_gap_m, earlier_gap_m)
        forces = (frame.force_left_n, frame.force_right_n)
        if closing and not self._balance.ended:
            faults.append(self._spikes.see(forces, phase))
        for pad, force_n in zip(self._pads, forces, strict=True):
            if force_n != force_n or earlier_gap_m != earlier_gap_m:
                continue
            if closing:
                if min(forces) > self._contact_n:
                    pad.touch(earlier_gap_m)
                faults.append(pad.close(force_n, earlier_gap_m, phase))
            elif phase == Phase.RELEASE and earlier_gap_m <= self._least_gap_m + SLACK_M:
                # Fingers that were fast go on closing for a while.
                pad.press(force_n, earlier_gap_m)
            elif phase == Phase.RELEASE:
                faults.append(pad.open(force_n, frame.t_s, frame.gap_m, earlier_gap_m))
        if closing:
            faults += self._stand_still()
        return [fault for fault in faults if fault is not None]

    def _stand_still(self) -> list[Fault]:
        """Return the faults of pads of which one alone, or both at once, stand still for longer than noise explains."""
        chances = [pad.still_chance for pad in self._pads]
        both = sum(chances) if all(chances) else 0.0
        return [
            pad.stands_still()
            for pad, chance in zip(self._pads, chances, strict=True)
            if min(chance, both) <= STILL_CHANCE
        ]

    def released(self, t_s: float) -> list[Fault]:
        """Return what the pads show at the end of the release (s)."""
        return [fault for pad in self._pads if (fault := pad.released(t_s)) is not None]

    def _is_new(self, reading: Reading) -> bool:
        """Return whether this tick has a new force, by the counter of the images or by the rate."""
        counter, t_s = reading.pads.counter, reading.frame.t_s
        if counter:
            new, self._counter = counter != self._counter, counter
            return new
        # A frame may come a little early.
        if t_s - self._t_s < 0.9 * self._period_s:
            return False
        self._t_s = t_s
        return True
