"""The force at the tip of the jaw, estimated from the load or the current of the motor, and back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, final

from graspsense.gripper_api import load_within, motor_at, stored_motor_tables
from graspsense_so101_gripper.config import So101Config
from graspsense_so101_gripper.registers import AMPERES_A_STEP, FULL_LOAD, MotorState


class ForceEstimate(NamedTuple):
    """A force (N, positive closes) and how far off it can be (N); the full force where no load cell has measured it."""

    force_n: float
    error_n: float


@final
class ForceOfMotor:
    """Turns what the motor measures into a force, by the stored load-cell tables, or by the stall torque."""

    def __init__(self, config: So101Config, stored: Mapping[str, Any]) -> None:
        self._config = config
        self._tables = stored_motor_tables(stored["load-cell"]) if "load-cell" in stored else None

    @property
    def calibrated(self) -> bool:
        """Whether a load cell has measured the force."""
        return self._tables is not None

    def push(self, state: MotorState, opens: int) -> float:
        """Return how the motor pushes: load as a share of the full one, or current (A); positive closes.

        The load is positive where the motor pushes towards smaller positions. The current has no sign, and gets it.
        """
        load = state.load * opens / FULL_LOAD
        if self._config.force_from == "load":
            return load
        amperes = state.current * AMPERES_A_STEP
        return amperes if load >= 0.0 else -amperes

    def estimate(self, push: float) -> ForceEstimate:
        """Return the force at this push, by the table of the direction in which the motor pushes."""
        if self._tables is None:
            return ForceEstimate(self._by_stall_torque(push), self._config.full_force_n)
        closing, opening = self._tables
        force_n, error_n = load_within(closing if push >= 0.0 else opening, abs(push))
        return ForceEstimate(force_n if push >= 0.0 else -force_n, min(error_n, self._config.full_force_n))

    def torque_limit(self, force_n: float) -> int:
        """Return the torque limit with which the motor presses with at most this force."""
        full = 1.0 if self._config.force_from == "load" else self._config.stall_current_a
        if self._tables is None:
            share = force_n / self._config.full_force_n
        else:
            share = motor_at(self._tables[0], force_n) / full
        return int(min(max(share, 0.0), self._config.largest_load) * FULL_LOAD + 1e-9)

    def _by_stall_torque(self, push: float) -> float:
        share = push if self._config.force_from == "load" else push / self._config.stall_current_a
        return share * self._config.full_force_n
