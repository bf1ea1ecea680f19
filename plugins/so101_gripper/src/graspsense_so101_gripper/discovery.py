"""Search for an arm: the serial ports of this computer, and what answers at the port of the settings."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from graspsense.gripper_api import Finding, GripperAtPort, port_failed
from graspsense.plugin_api import ConfigError, DataDamaged
from graspsense_so101_gripper.arm_calibration import read_arm_calibration
from graspsense_so101_gripper.bus import NoStatusPacket, ServoBus
from graspsense_so101_gripper.config import So101Config
from graspsense_so101_gripper.jaw import Unfit, jaw_of
from graspsense_so101_gripper.registers import (
    FULL_LOAD,
    IDENTITY,
    STATE,
    STATUS_BITS,
    VOLTS_A_STEP,
    motor_state,
)

MOTORS: Final = range(1, 7)


def serial_number(config: So101Config, port: str) -> str:
    """Return the name by which calibrations are kept: that of the bus board at this port, and the motor."""
    from serial.tools.list_ports import comports

    board = "emulated" if config.emulated else "unknown"
    for comport in comports():
        if os.path.realpath(comport.device) == os.path.realpath(port) and comport.serial_number:
            board = re.sub(r"[^\w+-]", "_", comport.serial_number)
    return f"{board}-{config.motor}"


def _asked(config: So101Config, timeout_s: float) -> Iterator[Finding]:
    try:
        bus = ServoBus(config.port, min(config.reply_timeout_s, timeout_s))
    except OSError as error:
        yield port_failed("so101", config.port, error)
        return
    try:
        yield from _motor(bus, config)
    finally:
        bus.close()


def _motor(bus: ServoBus, config: So101Config) -> Iterator[Finding]:
    try:
        arm = read_arm_calibration(Path(config.arm_calibration)) if config.arm_calibration else None
        memory = bus.read(config.motor, *IDENTITY)
        state = motor_state(bus.read(config.motor, *STATE))
        jaw = jaw_of(memory, config, arm)
    except (NoStatusPacket, OSError) as error:
        others = ", ".join(map(str, _answering(bus))) or "none"
        yield Finding(
            "so101",
            "problem",
            f"{config.port} opens, but motor {config.motor} gives: {error}. Motors that answer: {others}",
            "look at the power of the arm, the cable from motor to motor, and gripper.motor",
        )
        return
    except (Unfit, ConfigError, DataDamaged) as error:
        yield Finding("so101", "problem", f"motor {config.motor}: {error}", "look at gripper.motor")
        return
    yield Finding(
        "so101",
        "ok",
        f"motor {config.motor} at {config.port}, torque {'on' if state.asked.torque_enable else 'off'}",
        numbers={
            "position": state.position,
            "gap_m": jaw.gap_m(state.position),
            "load": state.load * jaw.opens / FULL_LOAD,
            "voltage_v": state.voltage * VOLTS_A_STEP,
            "temperature_c": state.temperature,
        },
    )
    for bit in STATUS_BITS:
        if bit.mask & state.status:
            yield Finding("so101", "problem", f"status {state.status}: {bit.name}", bit.meaning)


def _answering(bus: ServoBus) -> Iterator[int]:
    for motor in MOTORS:
        try:
            bus.read(motor, *IDENTITY)
        except (NoStatusPacket, OSError):
            continue
        yield motor


_SO101 = GripperAtPort(
    backend="so101",
    gripper="an SO-101 arm",
    converter="a serial converter",
    # The CH343 and CH340 chips on bus boards of such arms.
    usb_numbers={(0x1A86, 0x55D3), (0x1A86, 0x7523)},
    settings=So101Config,
    asked=_asked,
)
found_devices, diagnose = _SO101.found_devices, _SO101.diagnose
