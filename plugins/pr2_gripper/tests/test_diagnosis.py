"""What the doctor says of a gripper, with hidapi's module at the outermost edge and the emulated board behind it."""

import gc
import threading
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

import pytest
from cases import every_case
from commands import graspsense

import graspsense_pr2_gripper.plugin
from graspsense.core.components.registry import IsolatedPlugins
from graspsense.core.components.registry import plugins as loader
from graspsense.core.grasp.calibration_files import Calibration, calibration_path, write_calibration
from graspsense.plugin_api import NoDevice
from graspsense_pr2_gripper import diagnosis, link, watching
from graspsense_pr2_gripper.backend import device_numbers
from graspsense_pr2_gripper.config import FaultConfig, Pr2Config
from graspsense_pr2_gripper.emulator import reasons
from graspsense_pr2_gripper.emulator.board import emulate
from graspsense_pr2_gripper.protocol import EFFORT_KIND, OWN_LIMIT, OutputReport, encode_output
from graspsense_pr2_gripper.udev import hidraw_rule


@pytest.fixture
def doctor(monkeypatch):
    """Runs `graspsense doctor --json`; returns the exit code and the PR2 plugin's findings by subject."""
    monkeypatch.setattr(diagnosis, "TRANSPORTS", ("hidraw",))

    def run(*arguments):
        done = graspsense("doctor", "--json", "--timeout", "0.2", *arguments)
        (ours,) = (
            diagnosis
            for diagnosis in done.json["diagnoses"]
            if diagnosis["distribution"] == "graspsense-pr2-gripper"
        )
        assert ours["error"] == ""
        return done.returncode, {finding["subject"]: finding for finding in ours["findings"]}

    return run


@pytest.fixture
def powered(monkeypatch):
    """The boards of a machine report once a millisecond of its own time, by which the doctor measures too.

    It passes no faster than their reports are read, so that nothing that the doctor finds tells how busy this one is.
    """

    @contextmanager
    def on(machine):
        for module in (link, watching):
            monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: machine.now_s))
        stop = threading.Event()

        def tick():
            while not stop.wait(0.0002):
                if not any(handle.queue for handle in machine.open_handles):
                    machine.tick()

        thread = threading.Thread(target=tick)
        thread.start()
        try:
            yield
        finally:
            stop.set()
            thread.join()

    return on


def test_no_garbage_is_collected_within_a_measurement(doctor, machine, board, powered, monkeypatch):
    measure, collects = diagnosis.watch_link, []

    def watch_link(measured, seconds):
        collects.append(gc.isenabled())
        return measure(measured, seconds)

    monkeypatch.setattr(diagnosis, "watch_link", watch_link)
    machine.plug("/dev/hidraw3", board())
    with powered(machine):
        doctor()
    assert collects == [False], "its pause would be told as a late report of the device"
    assert gc.isenabled()


def test_no_gripper_is_a_problem_only_where_one_was_asked_for(doctor, machine):
    assert doctor()[1]["device"]["state"] == "note"
    code, said = doctor("--gripper", "pr2", "-o", "gripper.serial=R2")
    assert (code, said["device"]["state"]) == (1, "problem")
    assert "1209:0001 with serial number 'R2'" in said["device"]["found"]
    assert "transport hidraw" not in said


def test_the_doctor_comes_also_where_a_part_of_the_pipeline_is_missing(doctor, machine, monkeypatch):
    alone = IsolatedPlugins(graspsense_pr2_gripper.plugin)  # without the default pipeline's classifier
    monkeypatch.setattr(loader, "_current", alone)
    assert graspsense("doctor", "--json", "--gripper", "pr2").returncode == 1, "there is no gripper"


def test_a_gripper_is_measured_and_not_moved(doctor, machine, board, powered):
    wire = board()
    machine.plug("/dev/hidraw3", wire)
    with powered(machine):
        _, said = doctor("--gripper", "pr2")
    numbers = said["transport hidraw"]["numbers"]
    assert (numbers["serial"], numbers["firmware"], numbers["rate_wanted_hz"]) == ("L7", "1.2.3", 1000.0)
    assert numbers["reports"] > 0
    assert (numbers["lost"], numbers["corrupt"], numbers["in_use"]) == (0, 0, False)
    assert numbers["echoes"] > 0
    assert said["transport hidraw"]["state"] == "ok"
    assert 0.0 < numbers["latency_median_ms"] <= numbers["latency_99_ms"]
    assert 0.0 <= numbers["jitter_median_ms"] <= numbers["jitter_99_ms"] <= numbers["jitter_most_ms"]
    assert wire.firmware.effort_un == 0
    assert said["calibration tare"]["state"] == "note"


def test_lost_and_damaged_reports_are_a_problem_with_a_remedy(doctor, machine, board, powered):
    machine.plug("/dev/hidraw3", board(faults=FaultConfig(drop=0.2, corrupt=0.2)))
    with powered(machine):
        code, said = doctor("--gripper", "pr2")
    finding = said["transport hidraw"]
    assert (code, finding["state"]) == (1, "problem")
    assert finding["numbers"]["lost"] > 0
    assert finding["numbers"]["corrupt"] > 0
    assert "another cable or port" in finding["advice"]
    assert "firmware is faulty" in finding["advice"]


def test_board_with_implausible_numbers_is_a_problem_with_each_of_them(doctor, machine, board):
    machine.plug("/dev/hidraw3", board(watchdog_ms=65535, effort_limit_un=2_147_000_000))
    code, said = doctor("--gripper", "pr2")
    finding = said["transport hidraw"]
    assert (code, finding["state"]) == (1, "problem")
    assert "watchdog_ms is 65535 ms, allowed are 5 to 100 ms" in finding["advice"]
    assert "effort_limit_un is 2147000000" in finding["advice"]


def test_a_silent_gripper_is_a_problem(doctor, machine, board):
    machine.plug("/dev/hidraw3", board())
    code, said = doctor("--gripper", "pr2")
    assert (code, said["transport hidraw"]["state"]) == (1, "problem")
    assert "it sends no reports" in said["transport hidraw"]["advice"]


def test_a_gripper_that_somebody_else_commands_is_left_alone(doctor, machine, board, powered):
    """A hidraw node is open to two programs at once: letting go here would drop what the other one holds."""
    wire = board()
    machine.plug("/dev/hidraw3", wire)
    counter = 0
    plain = machine.tick

    def tick():
        nonlocal counter
        counter += 1
        wire.output(
            encode_output(OutputReport(counter & 0xFFFF, EFFORT_KIND, 9_000_000, OWN_LIMIT, OWN_LIMIT))
        )
        plain()

    machine.tick = tick
    with powered(machine):
        _, said = doctor("--gripper", "pr2")
    assert said["transport hidraw"]["numbers"]["in_use"] is True
    assert said["transport hidraw"]["numbers"]["echoes"] == 0
    assert wire.firmware.effort_un == 9_000_000


@pytest.mark.slow
def test_who_may_not_open_it_is_given_the_rule(doctor, machine, board, monkeypatch):
    machine.plug("/dev/hidraw3", board())
    monkeypatch.setattr("graspsense_pr2_gripper.discovery.sys.platform", "linux")
    monkeypatch.setattr("graspsense_pr2_gripper.discovery.os.access", lambda path, mode: False)
    code, said = doctor()
    assert (code, said["permission"]["state"]) == (1, "problem")
    rule = hidraw_rule(Pr2Config())
    assert rule in said["permission"]["advice"]
    assert rule == 'KERNEL=="hidraw*", KERNELS=="0003:1209:0001.*", TAG+="uaccess"'


def test_calibrations_are_told_with_their_age(doctor, machine, board, device_identity, powered):
    machine.plug("/dev/hidraw3", board())
    made = datetime.now(UTC) - timedelta(days=3)
    zero = {"left": [3000.0] * 22, "right": [3000.0] * 22, "images": 24}
    numbers = device_numbers(device_identity())
    tare = Calibration(kind="tare", serial="L7", device=numbers, made=made.isoformat(), data=zero)
    write_calibration(calibration_path("", "L7", "tare"), tare)
    with powered(machine):
        _, said = doctor("--gripper", "pr2")
    assert said["calibration tare"]["state"] == "ok"
    assert said["calibration tare"]["numbers"]["age_days"] == pytest.approx(3.0, abs=0.01)
    assert said["calibration friction"]["advice"] == "graspsense calibrate friction --gripper pr2"


@every_case(
    ("platform", "says"),
    [
        ("darwin", "uhid is of the Linux kernel, and this is darwin"),
        ("win32", "vhci-hcd is of the Linux kernel, and this is win32"),
        ("linux", "modprobe"),
    ],
)
def test_where_no_device_can_be_emulated_it_says_why_and_offers_another(
    monkeypatch, platform, says, tmp_path
):
    monkeypatch.setattr(reasons.sys, "platform", platform)
    monkeypatch.setattr(reasons, "UHID_NODE", str(tmp_path / "uhid"))
    monkeypatch.setattr(reasons, "VHCI", tmp_path / "vhci")
    with pytest.raises(NoDevice) as caught:
        emulate(Pr2Config(transport="emulated"), "", 0)
    assert says in str(caught.value)
    assert "-o gripper.transport=emulated" in str(caught.value)
