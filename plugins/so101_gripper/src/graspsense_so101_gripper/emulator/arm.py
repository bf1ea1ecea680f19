"""An emulated arm as a serial port of this machine. It runs in real time, and shows faults on request."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Final, final

from graspsense.gripper_api import EmulatedSerial
from graspsense_so101_gripper.config import So101Config
from graspsense_so101_gripper.emulator.motor import EmulatedMotor, GripperMotor
from graspsense_so101_gripper.emulator.protocol import Requests
from graspsense_so101_gripper.registers import MODEL_NUMBER

RATE_HZ: Final = 100.0
MOTORS: Final = range(1, 7)
OWN_WORDS: Final = {
    "restart": "cut the power of the motors for a moment",
    "takeover": "command the gripper as another program would",
}


def emulate(config: object, wire: str, seed: int) -> EmulatedArm:
    """Return an emulated arm not connected yet, on a `pty`. Raises ConfigError."""
    assert isinstance(config, So101Config)
    return EmulatedArm(config, wire or "pty", seed)


@final
class EmulatedArm(EmulatedSerial[GripperMotor]):
    """Six motors on a bus. It is active from the first time that the gripper's motor has torque."""

    rate_hz = RATE_HZ

    def __init__(self, config: So101Config, wire: str, seed: int) -> None:
        super().__init__(wire, config.faults, GripperMotor(config, seed))
        self._others = {
            number: EmulatedMotor(number, MODEL_NUMBER) for number in MOTORS if number != config.motor
        }
        # One of them holds the arm, as while another program has it.
        next(iter(self._others.values())).put("torque_enable", 1)
        self._requests_of_bus = Requests({**self._others, config.motor: self.hand})

    @property
    def words(self) -> Mapping[str, str]:
        """The words that `tell` understands, with their effects."""
        return {**super().words, **OWN_WORDS}

    def tell(self, word: str) -> None:
        """Execute one of `words`. Raises KeyError for any other."""
        if word not in OWN_WORDS:
            super().tell(word)
            return
        with self._lock:
            if word == "restart":
                for motor in (self.hand, *self._others.values()):
                    motor.power_up()
            else:
                limits = [self.hand.number(f"{end}_position_limit") for end in ("min", "max")]
                self.hand.put("goal_position", sum(limits) // 2)

    def answer(self, data: bytes, now_s: float) -> bytes:
        """Return the replies to the requests that these bytes complete."""
        if not data:
            self._requests_of_bus.forget()
            return b""
        self.hand.look(now_s)
        reply = self._requests_of_bus.fed(data)
        if self.hand.active_since_s == inf and self.hand.number("torque_enable"):
            self.hand.active_since_s = now_s
        return reply

    def details(self) -> Mapping[str, float | int | str | bool]:
        """Return the state of the jaw, and how often motors other than the gripper's were written to."""
        gripper = self.hand
        going = gripper.number("torque_enable") and abs(
            gripper.number("goal_position") - gripper.number("present_position")
        )
        return {
            "force_n": round(min(gripper.fingers.forces_n), 3),
            "steps_to_go": int(going),
            "torque": bool(gripper.number("torque_enable")),
            "written_to_others": sum(motor.writes for motor in self._others.values()),
        }
