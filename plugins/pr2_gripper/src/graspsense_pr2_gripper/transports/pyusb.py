"""The same reports through libusb, for a device without a HID driver, or to examine the effect of that driver."""

from __future__ import annotations

import errno
import math
from contextlib import suppress
from importlib import import_module
from typing import Any, Final, final

from graspsense.gripper_api import set_option
from graspsense.plugin_api import PluginUnavailable
from graspsense_pr2_gripper.config import Pr2Config
from graspsense_pr2_gripper.protocol import REPORT_SIZE
from graspsense_pr2_gripper.transports.interface import Transport, TransportGone

WRITE_TIMEOUT_MS: Final = 50
FEATURE_TIMEOUT_MS: Final = 500
_INTERFACE: Final = 0
_GET_REPORT: Final = (0xA1, 0x01)
_FEATURE_TYPE: Final = 3


def find(config: Pr2Config) -> list[Any]:
    """Return the USB devices with the USB ids and the serial number of the config.

    A device whose serial number cannot be read for lack of permission is included; opening it reports the reason.
    Raises PluginUnavailable without pyusb or the library libusb-1.0.
    """
    try:
        core, util = import_module("usb.core"), import_module("usb.util")
        devices = core.find(find_all=True, idVendor=config.vendor_id, idProduct=config.product_id)
        plugged = list(devices)
    except ImportError as error:
        raise PluginUnavailable(f"transport pyusb needs pyusb: {error}\n  try: pip install pyusb") from error
    except core.NoBackendError as error:
        raise PluginUnavailable(
            "transport pyusb needs the system library libusb-1.0, which pyusb cannot find\n"
            f"  try: apt install libusb-1.0-0, or {set_option('gripper.transport=hidraw')}"
        ) from error
    if not config.serial:
        return plugged
    wanted = []
    for device in plugged:
        try:
            serial = util.get_string(device, device.iSerialNumber)
        except (ValueError, core.USBError):
            serial = None
        if serial in (config.serial, None):
            wanted.append(device)
    return wanted


@final
class PyusbTransport(Transport):
    """A USB device with its HID interface claimed. Raises usb.core.USBError if it cannot be claimed."""

    def __init__(self, device: Any) -> None:
        self._core, self._util = import_module("usb.core"), import_module("usb.util")
        self._device = device
        self._detached = False
        # No reset: it would enumerate the device again and invalidate every handle.
        try:
            if device.is_kernel_driver_active(_INTERFACE):
                device.detach_kernel_driver(_INTERFACE)
                self._detached = True
        except NotImplementedError:
            pass  # only Linux has a driver to detach
        self._util.claim_interface(device, _INTERFACE)
        endpoints = device.get_active_configuration()[(_INTERFACE, 0)].endpoints()
        addresses = [endpoint.bEndpointAddress for endpoint in endpoints]
        self._in = next((address for address in addresses if address & 0x80), 0x81)
        self._out = next((address for address in addresses if not address & 0x80), 0x01)

    def read(self, timeout_s: float) -> bytes:
        """Return the next report, empty bytes after the timeout."""
        try:
            data: bytes = self._device.read(
                self._in, REPORT_SIZE, max(1, math.ceil(timeout_s * 1e3))
            ).tobytes()
        except self._core.USBTimeoutError:
            return b""
        except self._core.USBError as error:
            if error.errno == errno.EPIPE and self._unstalled():
                return b""
            raise TransportGone(f"reading: {error}") from error
        return data

    def write(self, report: bytes) -> None:
        """Send a report. A device that does not accept it in time counts as lost, because its state is unknown."""
        try:
            written = self._device.write(self._out, report, WRITE_TIMEOUT_MS)
        except self._core.USBError as error:
            raise TransportGone(f"writing: {error}") from error
        if written != len(report):
            raise TransportGone(f"writing: {written} of {len(report)} bytes were accepted")

    def feature(self, report_id: int) -> bytes:
        """Return a feature report through the control endpoint."""
        try:
            return bytes(
                self._device.ctrl_transfer(
                    *_GET_REPORT, _FEATURE_TYPE << 8 | report_id, _INTERFACE, REPORT_SIZE, FEATURE_TIMEOUT_MS
                )
            )
        except (self._core.USBError, TypeError, ValueError) as error:
            raise TransportGone(f"feature report {report_id}: {error}") from error

    def close(self) -> None:
        """Release the interface and return it to the kernel; errors of a lost device are ignored."""
        for give_back in (self._release, self._reattach):
            with suppress(self._core.USBError, NotImplementedError):
                give_back()
        self._util.dispose_resources(self._device)

    def _release(self) -> None:
        self._util.release_interface(self._device, _INTERFACE)

    def _reattach(self) -> None:
        if self._detached:
            self._device.attach_kernel_driver(_INTERFACE)

    def _unstalled(self) -> bool:
        try:
            self._device.clear_halt(self._in)
        except self._core.USBError:
            return False
        return True
