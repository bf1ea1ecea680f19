"""An emulated board connected to this computer. It runs in real time, and shows faults on request."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import ClassVar, Final, final

from graspsense.gripper_api import EmulatedDevice
from graspsense.plugin_api import NoDevice
from graspsense_pr2_gripper.config import Pr2Config
from graspsense_pr2_gripper.emulation import emulated_board
from graspsense_pr2_gripper.emulator.port import Plug, Port
from graspsense_pr2_gripper.emulator.reasons import why_no_uhid, why_no_vhci
from graspsense_pr2_gripper.emulator.uhid import UhidPort
from graspsense_pr2_gripper.emulator.vhci import VhciPort
from graspsense_pr2_gripper.protocol import FEATURE_ID, INPUT_LAYOUT, OUTPUT_ID
from graspsense_pr2_gripper.transports.emulated import on_time

PRODUCT: Final = "graspsense emulated PR2 gripper"
APPEARS_S: Final = 5.0
"""Largest time to wait for the device node to appear."""
JOIN_S: Final = 2.0


def emulate(config: object, wire: str, seed: int) -> EmulatedBoard:
    """Return an emulated board that is not connected yet.

    `wire` is `uhid` or `usb`, or any other text for the first of them that is available. Raises NoDevice if none is
    available, ConfigError.
    """
    assert isinstance(config, Pr2Config)
    return EmulatedBoard(config, _way_in(wire), seed)


@final
class EmulatedBoard(EmulatedDevice):
    """Runs the firmware in its own thread, connected or not."""

    moods: ClassVar[Mapping[str, str]] = {
        "silent": "send no reports, but take commands",
        "stalled": "complete nothing, in either direction",
        "well": "behave again",
    }

    def __init__(self, config: Pr2Config, wire: str, seed: int) -> None:
        self._board = emulated_board(config, seed).wire
        identity = self._board.firmware.identity
        self.wire = wire
        self.rate_hz = float(identity.report_rate_hz)
        self._serial = identity.serial
        plug = Plug(config.vendor_id, config.product_id, identity.serial, PRODUCT)
        self._port = _PORTS[wire](self, plug)
        self._lock = threading.Lock()
        self._told = "well"
        self._plugged = self._stop = False
        self._failed = ""
        self._sent = self._lost = self._sequence = self._commands = 0
        self._late_s = 0.0
        self._known = nodes(identity.serial)
        self._thread = threading.Thread(target=self._run, name="emulated PR2 board", daemon=True)
        self._thread.start()

    @property
    def stalled(self) -> bool:
        """Whether no transfer completes, in either direction."""
        return self._told == "stalled"

    @property
    def words(self) -> Mapping[str, str]:
        """The words that `tell` understands, with their effects."""
        return {**super().words, "halt": "stall the reading endpoint until the host clears it (usb)"}

    def tell(self, word: str) -> None:
        """Execute one of `words`. Raises KeyError for any other, NoDevice if it cannot be plugged in."""
        if word == "halt":
            self._port.halt()
        else:
            super().tell(word)

    def state(self) -> Mapping[str, float | int | str | bool]:
        """Return the state of the fingers, and the numbers of sent and lost reports and of received commands."""
        with self._lock:
            firmware = self._board.firmware
            return {
                "plugged": self._plugged,
                "mood": self._told,
                "node": self.node(),
                "sequence": self._sequence,
                "sent": self._sent,
                "lost": self._lost,
                "commands": self._commands,
                "effort_n": firmware.effort_un / 1e6,
                "late_s": round(self._late_s, 4),
                "failed": self._failed,
            }

    def node(self) -> str:
        """Return the hidraw node of this device, "" if it has none, for example while libusb uses it."""
        return next(iter(sorted(nodes(self._serial) - self._known)), "")

    def close(self) -> None:
        """Disconnect the board and stop its thread."""
        self._stop = True
        self._thread.join(JOIN_S)
        self._plugged = False
        self._port.close()

    def output(self, report: bytes) -> None:
        """Receive a command from the host."""
        if report[:1] != bytes((OUTPUT_ID,)):
            return
        with self._lock:
            if not self.stalled:
                self._commands += 1
                self._board.output(report)

    def feature(self, report_id: int) -> bytes | None:
        """Return the feature report."""
        if report_id != FEATURE_ID or self.stalled:
            return None
        with self._lock:
            return self._board.feature()

    def plug(self) -> None:
        """Plug it in, and wait until its device node appears. Raises NoDevice if it does not."""
        self._port.plug()
        self._plugged = True
        give_up = time.monotonic() + APPEARS_S
        while not self.node() and time.monotonic() < give_up:
            time.sleep(0.01)
        if not self.node():
            raise NoDevice(
                f"the kernel accepted the device, but no device node appeared within {APPEARS_S:.0f} s"
            )

    def unplug(self) -> None:
        """Pull the plug."""
        self._plugged = False
        self._port.unplug()

    def _run(self) -> None:
        try:
            for late_s in on_time(1.0 / self.rate_hz):
                if self._stop:
                    return
                with self._lock:
                    reports = self._board.step()
                    self._late_s = late_s
                # Without the lock: the port calls `output` while it holds its own lock.
                for report in reports:
                    self._hand_over(report)
                if self._board.unplugged and self._plugged:
                    self.unplug()
        except Exception as error:
            # The simulated fingers can be a user's code and fail; the host then sees a lost device.
            self._failed = f"{type(error).__name__}: {error}"
            self.unplug()

    def _hand_over(self, report: bytes) -> None:
        if self._told != "well" or not self._plugged:
            return
        self._lost += self._port.send(report)
        self._sent += 1
        self._sequence = INPUT_LAYOUT.unpack_from(report)[1]


def nodes(serial: str) -> set[str]:
    """Return the hidraw nodes of devices with this serial number, as the kernel lists them."""
    paths = set()
    for entry in Path("/sys/class/hidraw").glob("*"):
        try:
            about = (entry / "device" / "uevent").read_text()
        except OSError:
            continue  # gone meanwhile
        if f"HID_UNIQ={serial}\n" in about:
            paths.add(f"/dev/{entry.name}")
    return paths


_PORTS: Final[Mapping[str, Callable[[EmulatedBoard, Plug], Port]]] = {"uhid": UhidPort, "usb": VhciPort}
_WHY_NOT: Final = {"uhid": why_no_uhid, "usb": why_no_vhci}


def _way_in(wire: str) -> str:
    """Return this wire, or the first that is available. Raises NoDevice with the reason for each wire."""
    wires = (wire,) if wire else tuple(_PORTS)
    reasons = {port: _WHY_NOT[port]() for port in wires}
    for port, reason in reasons.items():
        if not reason:
            return port
    told = "\n".join(f"{port}: {reason}" for port, reason in reasons.items())
    raise NoDevice(
        f"the emulated gripper cannot be connected to this computer\n{told}\n"
        "to emulate it within one process, without a device of the system:\n"
        "  graspsense run --gripper pr2 -o gripper.transport=emulated -o gripper.pace=device"
    )
