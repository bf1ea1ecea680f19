"""The driver over pyusb, with the real pyusb in front of functions that stand for libusb's.

They behave as libusb was seen to on a Linux kernel with pyusb 1.3: see the table "Observed behaviour of the libraries"
in benchmarks/results/pr2.md.
"""

from __future__ import annotations

import array
import errno
import struct
import threading
from collections import deque
from types import SimpleNamespace

import pytest
import usb.backend
import usb.backend.libusb1
import usb.core

from graspsense.plugin_api import EFFORT, Command, DeviceLost, NoDevice, PluginUnavailable
from graspsense_pr2_gripper.backend import Pr2Backend
from graspsense_pr2_gripper.config import Pr2Config
from graspsense_pr2_gripper.emulator.port import Plug
from graspsense_pr2_gripper.emulator.usb_device import UsbDevice

DEVICE = """bLength bDescriptorType bcdUSB bDeviceClass bDeviceSubClass bDeviceProtocol bMaxPacketSize0 idVendor
idProduct bcdDevice iManufacturer iProduct iSerialNumber bNumConfigurations"""
CONFIGURATION = """bLength bDescriptorType wTotalLength bNumInterfaces bConfigurationValue iConfiguration bmAttributes
bMaxPower"""
INTERFACE = """bLength bDescriptorType bInterfaceNumber bAlternateSetting bNumEndpoints bInterfaceClass
bInterfaceSubClass bInterfaceProtocol iInterface"""


def described(names, layout, data, start=0, **more):
    """Return the fields of a descriptor under the names of the USB specification."""
    fields = zip(names.split(), struct.unpack_from(layout, data, start), strict=True)
    return SimpleNamespace(**dict(fields), extra_descriptors=[], **more)


class Libusb(usb.backend.IBackend):
    """One board on a USB port. `usbhid` has claimed it, as the kernel does with every HID device."""

    def __init__(self, wire):
        self.wire = wire
        board = SimpleNamespace(output=wire.output, feature=lambda report_id: wire.firmware.feature())
        self.usb = UsbDevice(board, Plug(0x1209, 1, "L7", "a gripper"))
        self.about, self.configuration = (self._asked(0x80, 6, kind << 8, 0, 255) for kind in (1, 2))
        self.plugged, self.stalled, self.naks = True, False, False
        self.driver_active, self.claimed, self.resets, self.reattached = True, False, 0, False
        self.reports: deque[bytes] = deque()
        self.changed = threading.Condition()

    def tick(self):
        with self.changed:
            self.reports.clear()  # nothing is queued between transfers: only the fresh one
            self.reports.extend(self.wire.step())
            self.changed.notify_all()

    def _there(self):
        if not self.plugged:
            raise usb.core.USBError("No such device (it may have been disconnected)", -4, errno.ENODEV)

    def _asked(self, *setup):
        answer = self.usb.control(struct.pack("<BBHHH", *setup), b"")
        if answer is None:
            raise usb.core.USBError("Pipe error", -9, errno.EPIPE)
        return answer

    def enumerate_devices(self):
        return iter(["port"] if self.plugged else [])

    def get_device_descriptor(self, dev):
        place = {"address": 5, "bus": 1, "port_number": 1, "port_numbers": (1,), "speed": 2}
        return described(DEVICE, "<BBHBBBBHHHBBBB", self.about, **place)

    def get_configuration_descriptor(self, dev, config):
        return described(CONFIGURATION, "<BBHBBBBB", self.configuration)

    def get_interface_descriptor(self, dev, intf, alt, config):
        if intf or alt:
            raise IndexError
        return described(INTERFACE, "<9B", self.configuration, 9)

    def get_endpoint_descriptor(self, dev, ep, intf, alt, config):
        # Other addresses than those of the emulated board.
        return SimpleNamespace(
            bLength=7, bDescriptorType=5, bEndpointAddress=(0x83, 0x04)[ep], bmAttributes=3, wMaxPacketSize=64,
            bInterval=1, bRefresh=0, bSynchAddress=0, extra_descriptors=[],
        )  # fmt: skip

    def open_device(self, dev):
        self._there()
        return "handle"

    def close_device(self, handle):
        pass

    def get_configuration(self, handle):
        return 1

    def set_configuration(self, handle, value):
        raise AssertionError("setting the configuration of a device in use disturbs its other users")

    def reset_device(self, handle):
        self.resets += 1

    def is_kernel_driver_active(self, handle, intf):
        self._there()
        return self.driver_active

    def detach_kernel_driver(self, handle, intf):
        self.driver_active = False

    def attach_kernel_driver(self, handle, intf):
        self._there()
        self.driver_active = self.reattached = True

    def claim_interface(self, handle, intf):
        if self.driver_active:
            raise usb.core.USBError("Resource busy", -6, errno.EBUSY)
        self.claimed = True

    def release_interface(self, handle, intf):
        self._there()
        self.claimed = False

    def clear_halt(self, handle, ep):
        self._there()
        self.stalled = False

    def intr_read(self, handle, ep, intf, buff, timeout):
        assert ep == 0x83, "the descriptors' own endpoint"
        assert timeout > 0
        with self.changed:
            self.changed.wait_for(lambda: self.reports or not self.plugged or self.stalled, timeout / 1e3)
            self._there()
            if self.stalled:
                raise usb.core.USBError("Pipe error", -9, errno.EPIPE)
            if not self.reports:
                raise usb.core.USBTimeoutError("Operation timed out", -7, errno.ETIMEDOUT)
            report = self.reports.popleft()
        buff[: len(report)] = array.array("B", report)
        return len(report)

    def intr_write(self, handle, ep, intf, data, timeout):
        assert ep == 0x04
        self._there()
        if self.naks:
            raise usb.core.USBTimeoutError("Operation timed out", -7, errno.ETIMEDOUT)
        with self.changed:
            self.wire.output(data.tobytes())
        return len(data)

    def ctrl_transfer(self, handle, kind, request, value, index, data, timeout):
        self._there()
        answer = self._asked(kind, request, value, index, len(data))
        data[: len(answer)] = array.array("B", answer)
        return len(answer)


@pytest.fixture
def port(monkeypatch, board, time_stands_still):
    backend = Libusb(board())
    monkeypatch.setattr(usb.backend.libusb1, "get_backend", lambda *a, **k: backend)
    return backend


@pytest.fixture
def opened(port):
    backend = Pr2Backend(Pr2Config(transport="pyusb"))
    backend.open(0)
    yield backend
    backend.close()


def following(backend, port):
    """Tick until the reader, which may be between two transfers, has caught one."""
    while True:
        port.tick()
        reading = backend.read(0.01)
        if reading is not None:
            return reading


def test_device_is_taken_from_the_kernel_and_given_back(port):
    backend = Pr2Backend(Pr2Config(transport="pyusb", serial="L7"))
    info = backend.open(0)
    assert (info.serial, info.clock) == ("L7", "device")
    assert (port.claimed, port.driver_active) == (True, False)
    backend.close()
    assert (port.claimed, port.reattached) == (False, True)
    assert port.resets == 0, "a reset enumerates the device anew"


def test_frames_come_and_commands_arrive_and_an_idle_timeout_is_no_loss(opened, port):
    assert opened.read(0.12) is None
    assert following(opened, port).frame.gap_m == pytest.approx(0.086, abs=1e-6)
    opened.apply(Command(EFFORT, 7.0, float("inf"), float("inf")))
    assert following(opened, port).frame.effort_n == 7.0


def test_pulled_cable_ends_a_read_and_closing_survives_it(opened, port):
    """attach_kernel_driver raises errno 19 after an unplug."""
    following(opened, port)
    with port.changed:
        port.plugged = False
        port.changed.notify_all()
    with pytest.raises(DeviceLost, match="No such device"):
        opened.read(60.0)
    opened.close()
    assert opened.report()["closed_cleanly"] is True


def test_stalled_endpoint_is_cleared(opened, port):
    following(opened, port)
    with port.changed:
        port.stalled = True
        port.changed.notify_all()
    assert following(opened, port) is not None
    assert not port.stalled


def test_device_that_takes_no_command_in_time_is_lost(opened, port):
    following(opened, port)
    port.naks = True
    with pytest.raises(DeviceLost, match="timed out"):
        opened.apply(Command(EFFORT, 7.0, float("inf"), float("inf")))


def test_another_serial_is_another_device(port):
    with pytest.raises(NoDevice, match=r"'R2'.*libusb"):
        Pr2Backend(Pr2Config(transport="pyusb", serial="R2")).open(0)


def test_missing_libusb_says_how_to_get_it(monkeypatch):
    for name in ("libusb1", "libusb0", "openusb"):
        module = __import__(f"usb.backend.{name}", fromlist=["get_backend"])
        monkeypatch.setattr(module, "get_backend", lambda *a, **k: None)
    with pytest.raises(PluginUnavailable, match=r"apt install libusb-1\.0-0"):
        Pr2Backend(Pr2Config(transport="pyusb")).open(0)
