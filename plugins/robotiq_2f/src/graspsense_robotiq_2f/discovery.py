"""Search for a gripper: the serial ports of this computer, and what answers at the port of the settings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from graspsense.gripper_api import Finding, FoundDevice, converter_findings, found_converters, port_failed
from graspsense_robotiq_2f.config import RobotiqConfig
from graspsense_robotiq_2f.link import NoReply
from graspsense_robotiq_2f.registers import MODELS, STATUS_BITS, bit_of, status_of
from graspsense_robotiq_2f.ur_cap import opened_link

CONVERTERS: Final = {(0x0403, 0x6001), (0x0403, 0x6015)}
"""USB numbers of the FTDI chips in RS-485 converters. Others have them too."""


def found_devices(timeout_s: float) -> Sequence[FoundDevice]:
    """Return the converters, to which nothing is sent: what hangs on them is not known before it is asked."""
    from serial.tools.list_ports import comports

    return found_converters(
        comports(), "robotiq", CONVERTERS, "an RS-485 converter, perhaps of a Robotiq gripper"
    )


def diagnose(config: object, timeout_s: float) -> Iterator[Finding]:
    """Return the findings about the gripper of these settings, by default about the converters. No finger moves."""
    if config is None:
        yield from converter_findings(found_devices(timeout_s), "robotiq", "a Robotiq gripper")
    elif isinstance(config, RobotiqConfig):
        yield from _asked(config, timeout_s)


def _asked(config: RobotiqConfig, timeout_s: float) -> Iterator[Finding]:
    if config.emulated:
        yield Finding("robotiq", "note", "gripper.port is emulated, so no device is searched")
        return
    model = MODELS[config.model]
    try:
        link = opened_link(config.port, config.address, min(config.reply_timeout_s, timeout_s))
    except (OSError, ValueError) as error:
        yield port_failed("robotiq", config.port, error)
        return
    try:
        status = status_of(link.status())
    except (NoReply, OSError) as error:
        yield Finding(
            "robotiq",
            "problem",
            f"{config.port} opens, but unit {config.address} gives: {error}",
            "look at the gripper's 24 V, at the two data wires (swapped?), and at gripper.address",
        )
        return
    finally:
        link.close()
    yield Finding(
        "robotiq",
        "ok",
        f"a gripper at {config.port}, {'active' if status.active else 'not activated'}; taken for a {model.name}",
        numbers={"position": status.position, "gap_m": model.gap_m(status.position)},
    )
    for bit in STATUS_BITS:
        if bit.mask & bit_of(status.fault):
            yield Finding("robotiq", "problem", f"fault {status.fault}: {bit.name}", bit.meaning)
