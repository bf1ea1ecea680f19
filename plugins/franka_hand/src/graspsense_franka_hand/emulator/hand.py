"""The hand in software: one command at a time, over fingers that go to their target on their own."""

from __future__ import annotations

from typing import Final

from graspsense.gripper_api import EmulatedFingers, FingerTarget
from graspsense_franka_hand.config import FrankaConfig
from graspsense_franka_hand.orders import FASTEST_M_S, FORCES_N, WIDEST_M
from graspsense_franka_hand.protocol import (
    ABORTED,
    FAILED,
    GRASP,
    HOMING,
    MOVE,
    STOP,
    SUCCESS,
    UNSUCCESSFUL,
    HandRequest,
)

REST_S: Final = 0.1
"""Time at rest after which a grasp has ended."""
THERE_M: Final = 1e-3
MOVE_FORCE_N: Final = FORCES_N[0]
STALLED_S: Final = 100.0
"""A move that something blocks ends after that (users' measurements)."""
TEMPERATURE_C: Final = 30


class FrankaHand:
    """A hand of these settings, at the time (s) that each call gives. Raises ConfigError for an unfit body."""

    def __init__(self, config: FrankaConfig, seed: int) -> None:
        self.fingers = EmulatedFingers(config.body, config.body_config, config.object, seed, WIDEST_M)
        self.active_since_s = 0.0
        self._target: FingerTarget | None = None
        self.widest_m = WIDEST_M
        self.grasped = False
        self._running: HandRequest | None = None
        self._began_s = 0.0
        self._ended: list[tuple[HandRequest, int]] = []

    @property
    def width_m(self) -> float:
        """The width between the fingers, which the encoder of the hand cannot take for less than 0."""
        return max(self.fingers.gap_m, 0.0)

    @property
    def pressing(self) -> bool:
        """Whether the motor is on."""
        return self._target is not None

    def ask(self, request: HandRequest, now_s: float) -> None:
        """Begin a command. The one that runs is aborted."""
        self.look(now_s)
        self.abort()
        if request.command == STOP:
            self._target = None
            self._end(request, SUCCESS)
            return
        if request.command == HOMING:
            target = FingerTarget(WIDEST_M, FASTEST_M_S / 2.0, MOVE_FORCE_N)
        elif request.command == MOVE:
            target = FingerTarget(request.values[0], request.values[1], MOVE_FORCE_N)
        else:
            width_m, _, _, speed, force_n = request.values
            target = FingerTarget(width_m, speed, min(max(force_n, FORCES_N[0]), FORCES_N[1]))
        if not (0.0 <= target.gap_m <= self.widest_m and 0.0 < target.speed_m_s < 10.0 * FASTEST_M_S):
            self._end(request, FAILED)
            return
        self.grasped, self.fingers.rest_s = False, 0.0
        self._target = target._replace(speed_m_s=min(target.speed_m_s, FASTEST_M_S))
        self._running, self._began_s = request, now_s

    def abort(self) -> None:
        """Let go of the running command; the fingers go on to where it sent them."""
        if self._running is not None:
            self._end(self._running, ABORTED)

    def look(self, now_s: float) -> None:
        """Move on up to this time."""
        self.fingers.move(now_s, self._target)
        request, target = self._running, self._target
        if request is None or target is None:
            return
        there = abs(self.width_m - target.gap_m) < THERE_M
        if request.command == GRASP:
            if there or self.fingers.rest_s >= REST_S:
                width_m, inner_m, outer_m = request.values[:3]
                self.grasped = width_m - inner_m < self.width_m < width_m + outer_m
                self._end(request, SUCCESS if self.grasped else UNSUCCESSFUL)
        elif there:
            self._end(request, SUCCESS)
        elif now_s - self._began_s > STALLED_S:
            self._end(request, UNSUCCESSFUL)

    def ended(self) -> list[tuple[HandRequest, int]]:
        """Return the commands that have ended since the last call, each with its status."""
        ended, self._ended = self._ended, []
        return ended

    def _end(self, request: HandRequest, status: int) -> None:
        self._running = None
        self._ended.append((request, status))
