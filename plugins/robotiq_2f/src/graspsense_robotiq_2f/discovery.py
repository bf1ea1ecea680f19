"""Search for a gripper: the serial ports of this computer, and what answers at the port of the settings."""

from __future__ import annotations

from collections.abc import Iterator

from graspsense.gripper_api import Finding, GripperAtPort, port_failed
from graspsense_robotiq_2f.config import RobotiqConfig
from graspsense_robotiq_2f.link import NoReply
from graspsense_robotiq_2f.registers import MODELS, STATUS_BITS, bit_of, status_of
from graspsense_robotiq_2f.ur_cap import opened_link


def _asked(config: RobotiqConfig, timeout_s: float) -> Iterator[Finding]:
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


_ROBOTIQ = GripperAtPort(
    backend="robotiq",
    gripper="a Robotiq gripper",
    converter="an RS-485 converter",
    # The FTDI chips in such converters.
    usb_numbers={(0x0403, 0x6001), (0x0403, 0x6015)},
    settings=RobotiqConfig,
    asked=_asked,
)
found_devices, diagnose = _ROBOTIQ.found_devices, _ROBOTIQ.diagnose
