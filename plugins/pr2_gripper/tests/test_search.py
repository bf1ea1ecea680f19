"""Looking for the gripper: what is said when it is not there, and which devices count as it."""

import sys
from types import ModuleType

import pytest
from cases import every_case

from graspsense.plugin_api import DeviceLost, NoDevice, PluginUnavailable
from graspsense_pr2_gripper.backend import Pr2Backend
from graspsense_pr2_gripper.config import Pr2Config
from graspsense_pr2_gripper.diagnosis import found_devices
from graspsense_pr2_gripper.discovery import LIBRARY, search

# No machine that runs these tests has a device of this number: pid.codes gives it to nobody.
NOBODYS = Pr2Config(vendor_id=0x1209, product_id=0xFFFF)


@pytest.fixture
def two_grippers_and_a_mouse(monkeypatch):
    """The library at its outermost edge: a listing in the form that hidapi 0.15 gives."""
    plugged = ((0x1209, 0x0001, "L7"), (0x046D, 0xC077, ""), (0x1209, 0x0001, "R2"))
    listed = [
        {"vendor_id": vendor, "product_id": product, "serial_number": serial, "path": b"/dev/hidraw%d" % i}
        for i, (vendor, product, serial) in enumerate(plugged)
    ]
    module = ModuleType(LIBRARY)
    module.enumerate = lambda: listed
    monkeypatch.setitem(sys.modules, LIBRARY, module)


def test_absent_device_says_what_was_looked_for_and_what_to_try():
    with pytest.raises(NoDevice) as caught:
        Pr2Backend(NOBODYS).open(seed=0)
    assert caught.value.exit_code == 3
    for said in ("USB HID device 1209:ffff", f"module {LIBRARY}", "graspsense devices", "--gripper sim"):
        assert said in str(caught.value)


@pytest.mark.usefixtures("two_grippers_and_a_mouse")
def test_device_is_known_by_its_numbers_and_serial():
    matching = {serial: search(Pr2Config(serial=serial)).matching for serial in ("", "R2", "X")}
    paths = {serial: [node.path for node in nodes] for serial, nodes in matching.items()}
    assert paths == {"": ["/dev/hidraw0", "/dev/hidraw2"], "R2": ["/dev/hidraw2"], "X": []}
    assert search(Pr2Config()).total == 3


@pytest.mark.usefixtures("two_grippers_and_a_mouse")
def test_two_grippers_and_no_serial_is_a_question_back():
    with pytest.raises(NoDevice, match=r"2 devices 1209:0001\n.*gripper\.serial"):
        Pr2Backend(Pr2Config()).open(seed=0)


@pytest.mark.usefixtures("two_grippers_and_a_mouse")
def test_device_that_may_not_be_opened_is_not_passed_off_as_ready():
    """The nodes of this listing do not exist, so nobody may open them."""
    assert [(device.serial, device.ready) for device in found_devices(1.0)] == [("L7", False), ("R2", False)]
    assert "/dev/hidraw0" in found_devices(1.0)[0].advice


def test_missing_library_is_told(monkeypatch):
    monkeypatch.setitem(sys.modules, LIBRARY, None)
    with pytest.raises(PluginUnavailable, match="pip install hidapi"):
        search(Pr2Config())


def test_nothing_moves_before_it_is_open():
    backend = Pr2Backend(NOBODYS)
    backend.close()
    backend.close()
    with pytest.raises(DeviceLost, match="not open"):
        backend.read(timeout_s=0.1)


@every_case("number", [-1, 0x10000])
def test_ids_are_sixteen_bits(number):
    with pytest.raises(ValueError):
        Pr2Config(vendor_id=number)
