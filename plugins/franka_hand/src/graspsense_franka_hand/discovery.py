"""Search for a hand: what answers at the address of the settings. No finger moves."""

from __future__ import annotations

import socket
import struct
from collections.abc import Iterator
from contextlib import suppress

from graspsense.gripper_api import Finding, FoundDevice
from graspsense.plugin_api import PluginUnavailable
from graspsense_franka_hand.config import FrankaConfig
from graspsense_franka_hand.link import LibfrankaLink
from graspsense_franka_hand.orders import HandGone
from graspsense_franka_hand.protocol import (
    CONNECT,
    LARGEST,
    PORT,
    SUCCESS,
    VERSION,
    connection,
    request_bytes,
)

ADVICE = (
    "look at gripper.host, at the cable to the control, whether FCI is active in Desk, and whether another program has "
    "the hand"
)


def found_devices(timeout_s: float, host: str = FrankaConfig().host) -> Iterator[FoundDevice]:
    """Return the hand that answers at this address, by default that of the settings; no finger moves.

    It is greeted as every program greets it, since a port that opens may be anything's.
    """
    with suppress(OSError, struct.error), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as states:
        states.bind(("", 0))
        with socket.create_connection((host, PORT), timeout_s) as hand:
            hand.settimeout(timeout_s)
            hand.sendall(request_bytes(CONNECT, 0, VERSION, states.getsockname()[1]))
            answer = connection(hand.recv(LARGEST))
        if answer is not None:
            status, version = answer
            advice = (
                "" if status == SUCCESS else f"it speaks version {version} of the protocol, not {VERSION}"
            )
            yield FoundDevice("franka", "", host, ready=status == SUCCESS, advice=advice)


def diagnose(config: object, timeout_s: float) -> Iterator[Finding]:
    """Return the findings about the hand of these settings; without settings there is no address to ask."""
    if config is None:
        yield Finding(
            "franka",
            "note",
            "no hand was searched: it would be on the network, at an address that only you know",
            "graspsense doctor --gripper franka -o gripper.host=ADDRESS asks the one at this address",
        )
    elif isinstance(config, FrankaConfig):
        yield from _asked(config, timeout_s)


def _asked(config: FrankaConfig, timeout_s: float) -> Iterator[Finding]:
    if config.emulated:
        yield Finding("franka", "note", "gripper.host is emulated, so no device is searched")
        return
    try:
        link = LibfrankaLink(config.host, timeout_s)
    except PluginUnavailable as error:
        yield Finding("franka", "problem", "pylibfranka is not installed", str(error))
        return
    except HandGone as error:
        yield Finding("franka", "problem", f"{config.host}: {error}", ADVICE)
        return
    state = link.first
    link.close()
    yield Finding(
        "franka",
        "ok",
        f"a hand at {config.host}",
        numbers={
            "width_m": state.width_m,
            "widest_m": state.widest_m,
            "temperature_c": state.temperature_c,
        },
    )
