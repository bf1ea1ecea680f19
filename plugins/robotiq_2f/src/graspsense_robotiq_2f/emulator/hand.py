"""The registers of a gripper in software, over a body that takes an effort: it goes to its target on its own."""

from __future__ import annotations

from math import inf
from typing import Any, Final

from graspsense.plugin_api import EFFORT, Command, ConfigError, SensorBackend, create
from graspsense_robotiq_2f.config import RobotiqConfig
from graspsense_robotiq_2f.emulator.fingertips import Felt
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
GAIN_N_S_M: Final = 15000.0
INTEGRAL_N_M: Final = 2000.0
"""Effort per error of the speed, and per error of the way."""
NEAR_S: Final = 0.02
"""The fingers slow down over the way of this time at their speed."""
REST_M_S: Final = 1e-3
REST_S: Final = 0.05
"""Speed and time of fingers that have met something."""
CATCH_UP_S: Final = 5.0
"""Most time that is made up at once: by then the fingers have come to rest."""


class Hand:
    """A gripper of these settings, at the time (s) that each call gives. Raises ConfigError for an unfit body."""

    def __init__(self, config: RobotiqConfig, seed: int) -> None:
        self._model = MODELS[config.model]
        values = dict(config.body_config)
        if config.object is not None:
            values["object"] = config.object
        self.body: SensorBackend[Any] = create("sensor-backend", config.body, **values)
        info = self.body.open(seed)
        if info.clock != "virtual":
            self.body.close()
            raise ConfigError(
                f"gripper.body {config.body!r} has a clock of its own, so no gripper can be emulated over it: name a "
                "gripper with a virtual clock, such as sim"
            )
        self._tick_s = 1.0 / info.rate_hz
        self._registers = [0] * COUNT
        self._integral_n = self._rest_s = self._body_s = 0.0
        self._object = MOVING
        self.active_since_s = inf
        self._frame = self._read()
        # A hand with a shorter stroke than the body has its fingers mounted closer together.
        self._offset_m = max(self._frame.gap_m - self._model.stroke_m, 0.0)

    @property
    def gap_m(self) -> float:
        """The gap between the fingers."""
        return float(self._frame.gap_m - self._offset_m)

    @property
    def felt(self) -> Felt:
        """The forces on the pads of the body."""
        return Felt(float(self._frame.force_left_n), float(self._frame.force_right_n))

    @property
    def going(self) -> bool:
        """Whether the motor is asked to go to its target."""
        return request_of(self._registers).go

    @property
    def effort_n(self) -> float:
        """The effort of the motor."""
        return float(self._frame.effort_n)

    def write(self, address: int, values: list[int], now_s: float) -> None:
        """Receive output registers. Raises IndexError for others."""
        start = address - OUTPUT
        if start < 0 or start + len(values) > COUNT:
            raise IndexError
        was_active = request_of(self._registers).active
        self.look(now_s)
        before = request_of(self._registers)
        self._registers[start : start + len(values)] = values
        request = request_of(self._registers)
        if request.position != before.position or not request.go:
            self._rest_s, self._object = 0.0, MOVING
        if request.active and not was_active:
            self.active_since_s = now_s
        if not request.active:
            self.active_since_s = inf

    def read(self, address: int, count: int, now_s: float) -> list[int]:
        """Return input registers at this time. Raises IndexError for others."""
        start = address - INPUT
        if start < 0 or start + count > COUNT:
            raise IndexError
        return self.look(now_s)[start : start + count]

    def look(self, now_s: float) -> list[int]:
        """Move up to this time, and return the input registers."""
        self._body_s = max(self._body_s, now_s - CATCH_UP_S)
        while self._body_s + self._tick_s <= now_s:
            self._body_s += self._tick_s
            self.body.apply(Command(EFFORT, self._effort(), inf, inf))
            self._frame = self._read()
        request = request_of(self._registers)
        up = now_s - self.active_since_s >= ACTIVATION_S
        state = (ACTIVE if up else 1) if request.active else 0
        status = request.active | request.go << 3 | state << 4 | self._object << 6
        amperes = min(round(abs(self.effort_n) / NEWTONS_PER_AMPERE / AMPERES_A_STEP), 255)
        return [status << 8, request.position, self._model.position(self.gap_m) << 8 | amperes]

    def close(self) -> None:
        """Release the body."""
        self.body.close()

    def _read(self) -> Any:
        reading = self.body.read(1.0)
        if reading is None:
            raise RuntimeError("the body of an emulated gripper gave no frame: it needs a virtual clock")
        return reading.frame

    def _effort(self) -> float:
        """Return the effort of the next tick: a loop of the speed, whose effort is at most the force of the request."""
        request = request_of(self._registers)
        if not request.go or self._body_s - self.active_since_s < ACTIVATION_S:
            self._integral_n = 0.0
            return 0.0
        model = self._model
        speed = value_of(request.speed, model.speeds_m_s)
        most_n = value_of(request.force, model.forces_n)
        # A target beyond the stroke is reached at the end of the stroke.
        way_m = self.gap_m - model.gap_m(request.position)
        wanted = min(max(way_m / NEAR_S, -speed), speed)
        error = wanted + self._frame.velocity_m_s
        effort = GAIN_N_S_M * error + self._integral_n
        if abs(effort) < most_n:
            self._integral_n += INTEGRAL_N_M * self._tick_s * error
        self._watch(way_m)
        return float(min(max(effort, -most_n), most_n))

    def _watch(self, way_m: float) -> None:
        rests = abs(self._frame.velocity_m_s) < REST_M_S
        self._rest_s = self._rest_s + self._tick_s if rests else 0.0
        if abs(way_m) <= self._model.step_m:
            self._object = THERE
        elif self._rest_s < REST_S:
            self._object = MOVING
        else:
            self._object = STOPPED_CLOSING if way_m > 0.0 else STOPPED_OPENING
