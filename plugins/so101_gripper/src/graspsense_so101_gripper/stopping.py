"""Stopping the motor of a gripper whose program was killed."""

from __future__ import annotations

from contextlib import closing

from graspsense_so101_gripper.bus import ServoBus
from graspsense_so101_gripper.registers import STATE, MotorRequest, motor_state


def stop(port: str, motor: int, timeout_s: float, *earlier: int) -> None:
    """Let the motor stay where it is, and ask it for what it was asked `earlier`. Raises OSError, NoStatusPacket."""
    with closing(ServoBus(port, timeout_s)) as bus:
        position = motor_state(bus.read(motor, *STATE)).position
        bus.write(motor, STATE[0], MotorRequest(*earlier).staying_at(position).written())
