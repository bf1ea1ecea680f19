"""Opens the board in the settings: a real one by its serial number, or an emulated one."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Final, NamedTuple

from graspsense.gripper_api import set_option
from graspsense.plugin_api import NoDevice
from graspsense_pr2_gripper.ceilings import refuse_implausible
from graspsense_pr2_gripper.config import Pr2Config
from graspsense_pr2_gripper.discovery import search
from graspsense_pr2_gripper.emulation import Emulation, emulated_board
from graspsense_pr2_gripper.link import JOIN_S, READ_S, Link, LockStepLink, ThreadedLink, close_within
from graspsense_pr2_gripper.protocol import FEATURE_ID, Identity, ProtocolError, decode_identity
from graspsense_pr2_gripper.transports.emulated import LockStepTransport, PacedTransport
from graspsense_pr2_gripper.transports.interface import Transport, TransportGone

POLL_S: Final = 0.25
"""Time between two searches for a lost device."""


class Opened(NamedTuple):
    """An open board: its link, its identity, and the emulation behind it if there is one."""

    link: Link
    identity: Identity
    emulation: Emulation | None


def open_board(config: Pr2Config, seed: int, wait_s: float) -> Opened:
    """Open the board and check its identity.

    `wait_s` is the time to wait for a device that is not connected. Raises NoDevice, ConfigError, PluginUnavailable.
    """
    if config.emulated:
        return _emulated(config, seed)
    transport = _open_transport(config, wait_s)
    try:
        identity = _identified(config, transport)
        # An old report can remain in the device; all reports after it would count as lost.
        transport.read(READ_S)
    except NoDevice:
        close_within(transport, JOIN_S)
        raise
    except TransportGone as error:
        close_within(transport, JOIN_S)
        raise _no_answer(config, error) from error
    return Opened(ThreadedLink(transport), identity, None)


def _identified(config: Pr2Config, transport: Transport) -> Identity:
    """Return the identity of the board. Raises NoDevice for one that is no PR2 gripper, or claims what none has."""
    try:
        identity = decode_identity(transport.feature(FEATURE_ID))
        if config.serial and identity.serial != config.serial:
            raise ProtocolError(
                f"its feature report says serial {identity.serial!r}, but the settings ask for {config.serial!r}"
            )
    except (ProtocolError, TransportGone) as error:
        raise _no_answer(config, error) from error
    refuse_implausible(identity)
    return identity


def _no_answer(config: Pr2Config, error: Exception) -> NoDevice:
    return NoDevice(
        f"the device {config.vendor_id:04x}:{config.product_id:04x} does not answer as a PR2 gripper: "
        f"{error}\n  try: other USB ids in gripper.vendor_id and gripper.product_id, or gripper.serial"
    )


def _emulated(config: Pr2Config, seed: int) -> Opened:
    emulation = emulated_board(config, seed)
    wire = emulation.wire
    transport = LockStepTransport(wire) if config.pace == "lock-step" else PacedTransport(wire)
    try:
        identity = _identified(config, transport)
    except NoDevice:
        transport.close()
        raise
    if config.pace != "lock-step":
        return Opened(ThreadedLink(transport), identity, emulation)
    return Opened(LockStepLink(transport, 1.0 / identity.report_rate_hz), identity, emulation)


def _open_transport(config: Pr2Config, wait_s: float) -> Transport:
    look = _hidraw if config.transport == "hidraw" else _pyusb
    give_up = time.monotonic() + wait_s
    while True:
        openers, missing = look(config)
        if len(openers) == 1:
            try:
                return openers[0]()
            except OSError as error:
                # Directly after plugging in, udev may not have set the permissions of the node yet.
                missing = NoDevice(
                    f"the PR2 gripper is connected but cannot be opened: {error}\n"
                    "  try: the udev rule that `graspsense doctor` prints, then plug it in again;\n"
                    "       or close the other program that uses it"
                )
        elif openers:
            raise NoDevice(
                f"there are {len(openers)} devices {config.vendor_id:04x}:{config.product_id:04x}\n"
                f"  try: {set_option('gripper.serial=SERIAL')}, with a serial of `graspsense devices`"
            )
        if time.monotonic() >= give_up:
            raise missing
        time.sleep(POLL_S)


def _hidraw(config: Pr2Config) -> tuple[Sequence[Callable[[], Transport]], NoDevice]:
    from graspsense_pr2_gripper.transports.hidraw import HidrawTransport

    listing = search(config)
    missing = NoDevice(
        f"no PR2 gripper: searched for {listing.wanted}\n"
        f"  {listing.looked}\n"
        "  try: plug it in and switch it on, then `graspsense devices`\n"
        f"       other USB ids: {set_option('gripper.vendor_id=0x1209', 'gripper.product_id=0x0001')}\n"
        f"       no gripper at hand: {set_option('gripper.transport=emulated')}, or `graspsense run --gripper sim`"
    )
    return [partial(HidrawTransport, device) for device in listing.matching], missing


def _pyusb(config: Pr2Config) -> tuple[Sequence[Callable[[], Transport]], NoDevice]:
    from graspsense_pr2_gripper.transports.pyusb import PyusbTransport, find

    devices = find(config)
    serial = f" with serial number {config.serial!r}" if config.serial else ""
    missing = NoDevice(
        f"no PR2 gripper: searched for USB device {config.vendor_id:04x}:{config.product_id:04x}{serial} with libusb\n"
        "  try: plug it in and switch it on; gripper.transport hidraw sees devices that are not on USB, too\n"
        f"       no gripper at hand: {set_option('gripper.transport=emulated')}, or `graspsense run --gripper sim`"
    )
    return [partial(PyusbTransport, device) for device in devices], missing
