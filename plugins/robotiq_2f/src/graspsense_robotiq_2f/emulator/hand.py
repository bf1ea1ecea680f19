"""The registers of a gripper in software: it goes to its target on its own."""

from __future__ import annotations

from math import inf
from typing import Final

from graspsense.gripper_api import EmulatedFingers, FingerTarget
from graspsense_robotiq_2f.config import RobotiqConfig
from graspsense_robotiq_2f.registers import (
    ACTIVE,
    AMPERES_A_STEP,
    COUNT,
    INPUT,
    MODELS,
    MOVING,
    OUTPUT,
    STOPPED_CLOSING,
    STOPPED_OPENING,
    THERE,
    request_of,
    value_of,
)

ACTIVATION_S: Final = 0.2
NEWTONS_PER_AMPERE: Final = 150.0
REST_S: Final = 0.05
"""Time for which fingers rest that have met something."""


class Hand:
    """A gripper of these settings, at the time (s) that each call gives. Raises ConfigError for an unfit body."""

    def __init__(self, config: RobotiqConfig, seed: int) -> None:
        self._model = MODELS[config.model]
        self.fingers = EmulatedFingers(
            config.body, config.body_config, config.object, seed, self._model.stroke_m
        )
        self._registers = [0] * COUNT
        self.active_since_s = inf

    @property
    def registers(self) -> tuple[int, ...]:
        """The output registers as they were written last."""
        return tuple(self._registers)

    @property
    def going(self) -> bool:
        """Whether the motor is asked to go to its target."""
        return request_of(self._registers).go

    def write(self, address: int, values: list[int], now_s: float) -> None:
        """Receive output registers. Raises IndexError for others."""
        start = address - OUTPUT
        if start < 0 or start + len(values) > COUNT:
            raise IndexError
        was_active = request_of(self._registers).active
        self.look(now_s)
        earlier = request_of(self._registers)
        self._registers[start : start + len(values)] = values
        request = request_of(self._registers)
        if request.position != earlier.position or not request.go:
            self.fingers.rest_s = 0.0
        if request.active and not was_active:
            self.active_since_s = now_s
        if not request.active:
            self.active_since_s = inf

    def power_up(self) -> None:
        """Have what a gripper has after its power came: it is not active, and was asked for nothing."""
        self._registers = [0] * COUNT
        self.active_since_s = inf

    def read(self, address: int, count: int, now_s: float) -> list[int]:
        """Return input registers at this time. Raises IndexError for others."""
        start = address - INPUT
        if start < 0 or start + count > COUNT:
            raise IndexError
        return self.look(now_s)[start : start + count]

    def look(self, now_s: float) -> list[int]:
        """Move up to this time, and return the input registers."""
        request = request_of(self._registers)
        up = now_s - self.active_since_s >= ACTIVATION_S
        model, fingers = self._model, self.fingers
        target = FingerTarget(
            model.gap_m(request.position),
            value_of(request.speed, model.speeds_m_s),
            value_of(request.force, model.forces_n),
        )
        fingers.move(now_s, target if request.go and up else None)
        state = (ACTIVE if up else 1) if request.active else 0
        status = request.active | request.go << 3 | state << 4 | self._objects(target.gap_m) << 6
        amperes = min(round(abs(fingers.effort_n) / NEWTONS_PER_AMPERE / AMPERES_A_STEP), 255)
        return [status << 8, request.position, model.position(fingers.gap_m) << 8 | amperes]

    def _objects(self, target_m: float) -> int:
        way_m = self.fingers.gap_m - target_m
        if not self.going:
            return MOVING
        if abs(way_m) <= self._model.step_m:
            return THERE
        if self.fingers.rest_s < REST_S:
            return MOVING
        return STOPPED_CLOSING if way_m > 0.0 else STOPPED_OPENING
