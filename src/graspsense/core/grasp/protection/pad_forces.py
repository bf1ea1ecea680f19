"""The forces of both pads against each other: different at rest, or one stands still while the other changes."""

from __future__ import annotations

from math import inf, nan
from typing import Final

from graspsense.core.grasp.protection.motor import RecentMean, lasting
from graspsense.core.values.faults import Fault
from graspsense.core.values.signals import CLOSING, Frame, Phase

MEAN_S: Final = 0.1
"""Time over which the forces are averaged, and after which they are compared."""
HELD_S: Final = 1.0
"""Time of the hold after which the pads are not compared: the mass of an object that an arm moves presses on one."""
ALLOWED_N: Final = 2.0
"""Difference that friction can hold: 1.5 N for half a kilogram on a table."""
ALLOWED_SHARE: Final = 1.0 / 3.0
"""Difference that is allowed, as a share of the larger force: calibrations differ."""
FREE_SHARE: Final = 0.3
"""Share of the contact force below which a pad is free."""
SCALED_CONTACTS: Final = 0.5
SCALED_SHARE: Final = 0.2
"""Difference that is allowed if it has grown from the contact on, over the contact force, or as a share of the larger
force: features of their mean are then 10 % off. Real pads are not calibrated better."""
LIGHT_SHARE: Final = 0.5
"""Share of the force below which both pads tell what friction held before: a wrong scale differs by less then."""
FRICTION_N: Final = 1.5
"""Difference that friction can hold while the force changes: of half a kilogram on a table."""
APART_SHARE: Final = 0.3
FEWEST_APART: Final = 3
"""Share of the greatest force by which the pads may differ besides, in so many samples in a row."""
STILL_S: Final = 0.25
"""Least time for which the force of a pad stands still."""
RESTS_M: Final = 0.0003
"""Travel in that time below which the fingers rest."""
IMAGES: Final = 5.0
"""Periods of the pads for which it stands still at least."""
CHANGE_N: Final = 1.0
"""Change of the other pad's force in that time that a sound pad would have felt too."""

EMPTY_SHARE: Final = 0.25
"""Share of the contact force below which a pad holds nothing."""
EMPTY_S: Final = 0.1
"""Time after which it does."""


class PadBalance:
    """Compares the forces of both pads, which come at this rate (Hz; 0: not known), while they press.

    Friction holds an object that one finger has pushed, so that this finger feels more throughout; a wrong scale lets
    the difference grow with the force. A force that stands still while the other one changes is found also where it has
    no noise, or no cells.
    """

    def __init__(self, contact_n: float, pads_hz: float = 0.0) -> None:
        self._still_s = max(STILL_S, IMAGES / pads_hz) if pads_hz > 0.0 else STILL_S
        self._forces = (nan, nan)
        self._stood = [(nan, nan, nan), (nan, nan, nan)]
        """Of each pad, since when its force has stood (s), and the other force (N) and the gap (m) at that time."""
        self._empty_n, self._empty_s = EMPTY_SHARE * contact_n, 0.0
        self._left, self._right = RecentMean(MEAN_S), RecentMean(MEAN_S)
        self._held_s = 0.0
        self._scaled_n, self._free_n = SCALED_CONTACTS * contact_n, FREE_SHARE * contact_n
        self._pushed_n = self._pressed_n = 0.0
        """What the left pad felt more than the right one before both touched, and the greatest force of both (N)."""
        self._light_n, self._light_more_n = inf, 0.0
        """The least force since both touched, and what the left pad felt more than the right one then (N)."""
        self._apart_samples = 0

    @property
    def ended(self) -> bool:
        """Whether the fingers have held for so long that the pads are not compared until they open."""
        return self._held_s > HELD_S

    def see(self, frame: Frame, phase: int, *, new: bool) -> Fault | None:
        """Take the frame of a tick, with new forces or not; return what no friction or calibration explains."""
        forces = (frame.force_left_n, frame.force_right_n)
        more_n, greatest_n = forces[0] - forces[1], max(forces)
        if phase == Phase.APPROACH and min(forces) < self._free_n:
            self._pushed_n = more_n if more_n == more_n else self._pushed_n
        elif phase in CLOSING and self._free_n <= greatest_n < self._light_n:
            self._light_n, self._light_more_n = greatest_n, more_n
        self._held_s = self._held_s + frame.dt_s if phase == Phase.HOLD else 0.0
        pressed = self._stuck(frame, forces) if phase in (Phase.SQUEEZE, Phase.HOLD) else None
        pressed = pressed or (self._empty(greatest_n, frame.dt_s) if phase == Phase.HOLD else None)
        if pressed is not None or self.ended:
            return pressed
        at_rest = self._at_rest(frame) if phase == Phase.HOLD else None
        return at_rest or (self._changing(forces, phase) if new else None)

    def _at_rest(self, frame: Frame) -> Fault | None:
        """Return the fault of pads that differ in the hold, in the mean of some time."""
        self._left.add(frame.force_left_n, frame.dt_s)
        self._right.add(frame.force_right_n, frame.dt_s)
        forces = {"left": self._left.value, "right": self._right.value}
        weak, strong = sorted(forces, key=lambda side: forces[side])
        difference_n = forces[strong] - forces[weak]
        light = self._light_n < LIGHT_SHARE * forces[strong]
        before_n = self._light_more_n if light else self._pushed_n
        grown_n = difference_n - (before_n if strong == "left" else -before_n)
        far = difference_n > max(ALLOWED_N, ALLOWED_SHARE * forces[strong])
        scaled = min(difference_n, grown_n) > max(self._scaled_n, SCALED_SHARE * forces[strong])
        if self._held_s < MEAN_S or not (far or scaled):
            return None
        return Fault(
            "pads disagree",
            f"at rest the {weak} pad feels {forces[weak]:.1f} N and the {strong} one {forces[strong]:.1f} N, though "
            f"both hold the same object, and {100.0 * SCALED_SHARE:.0f} % are allowed: one has another scale, or lost "
            "its zero; check the cells of both, and calibrate them (graspsense calibrate)",
        )

    def _changing(self, forces: tuple[float, float], phase: int) -> Fault | None:
        """Return the fault of pads that differ by more than friction holds in several samples in a row."""
        self._pressed_n = max(self._pressed_n, *forces)
        more_n = abs(forces[0] - forces[1] - self._pushed_n)
        apart = phase > Phase.APPROACH and more_n > max(FRICTION_N, APART_SHARE * self._pressed_n)
        self._apart_samples = self._apart_samples + 1 if apart else 0
        if self._apart_samples < FEWEST_APART:
            return None
        return Fault(
            "pads disagree",
            f"while the force changes, the left pad feels {forces[0]:.1f} N and the right one {forces[1]:.1f} N, "
            "though both touch one object: one is late, has another scale, or lost its zero; check both fingertips",
        )

    def _stuck(self, frame: Frame, forces: tuple[float, float]) -> Fault | None:
        """Return the fault of a pad that stands still; while the fingers rest, the other one can also be wrong."""
        last, self._forces = self._forces, forces
        for i, side in enumerate(("left", "right")):
            since_s, other_n, gap_m = self._stood[i]
            if forces[i] != last[i]:
                self._stood[i] = frame.t_s, forces[1 - i], frame.gap_m
            elif (
                frame.t_s - since_s >= self._still_s
                and abs(forces[1 - i] - other_n) >= CHANGE_N
                and last[1 - i] == last[1 - i]
            ):
                words = (
                    f"its force has stood at {forces[i]:.2f} N for {frame.t_s - since_s:.2f} s, while that of "
                    f"the other pad went from {other_n:.2f} to {forces[1 - i]:.2f} N"
                )
                if abs(frame.gap_m - gap_m) < RESTS_M:
                    words = f"{side} pad: {words}, and the fingers rest: one is stuck, or the other jumps or is late"
                    return Fault("pads disagree", f"{words}; check the cables of both", ends=True)
                return Fault(f"{side} pad stuck", f"{words}: check its cable", ends=True)
        return None

    def _empty(self, felt_n: float, dt_s: float) -> Fault | None:
        """Return the fault of pads that both feel nothing while the fingers hold what both have felt."""
        self._empty_s = lasting(self._empty_s, felt_n < self._empty_n, dt_s)
        if self._empty_s <= EMPTY_S:
            return None
        return Fault(
            "pads feel nothing in the hold",
            f"both felt a contact, and feel {felt_n:.2f} N at most now: the object is gone, or both have stopped; "
            "check the fingertips",
        )
