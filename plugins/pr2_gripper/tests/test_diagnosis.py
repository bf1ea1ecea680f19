"""What the doctor says of a gripper, with hidapi's module at the outermost edge and the emulated board behind it."""

import gc
import re
import threading
from contextlib import contextmanager, nullcontext
from datetime import UTC, datetime, timedelta
from itertools import count
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
from graspsense_pr2_gripper.discovery import hidraw_rule
from graspsense_pr2_gripper.emulator import reasons
from graspsense_pr2_gripper.emulator.board import emulate
from graspsense_pr2_gripper.protocol import EFFORT_KIND, OWN_LIMIT, OutputReport, encode_output


@pytest.fixture
def doctor(monkeypatch):
    """Runs `graspsense doctor --json`; returns the exit code and the PR2 plugin's findings by subject."""
    monkeypatch.setattr(diagnosis, "TRANSPORTS", ("hidraw",))

    def run(*arguments):
        done = graspsense("doctor", "--json", "--timeout", "0.2", *arguments)
        diagnoses = {diagnosis["distribution"]: diagnosis for diagnosis in done.json["diagnoses"]}
        ours = diagnoses["graspsense-pr2-gripper"]
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
    assert "'R2'" in said["device"]["found"]
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
    sound = {
        "serial": "L7",
        "firmware": "1.2.3",
        "rate_wanted_hz": 1000.0,
        "lost": 0,
        "corrupt": 0,
        "in_use": False,
    }
    assert sound.items() <= numbers.items()
    assert min(numbers["reports"], numbers["echoes"]) > 0
    assert 0.0 < numbers["latency_median_ms"] <= numbers["latency_99_ms"]
    assert 0.0 <= numbers["jitter_median_ms"] <= numbers["jitter_99_ms"] <= numbers["jitter_most_ms"]
    assert wire.firmware.effort_un == 0
    assert (said["transport hidraw"]["state"], said["calibration tare"]["state"]) == ("ok", "note")


LOST = FaultConfig(drop=0.2, corrupt=0.2)
IMPLAUSIBLE = {"watchdog_ms": 65535, "effort_limit_un": 2_147_000_000}


@every_case(
    ("numbers", "reports", "advice"),
    [
        (
            IMPLAUSIBLE,
            False,
            "(?s)(?=.*watchdog_ms is 65535 ms, allowed are 5 to).*effort_limit_un is 2147000000",
        ),
        ({}, False, "it sends no reports"),
        # The last one, since it gives the doctor the time of the machine.
        ({"faults": LOST}, True, "(?s)(?=.*another cable or port).*firmware is faulty"),
    ],
)
def test_what_is_wrong_with_a_gripper_is_a_problem_with_a_remedy(
    doctor, machine, board, powered, numbers, reports, advice
):
    machine.plugged.clear()
    machine.plug("/dev/hidraw3", board(**numbers))
    with powered(machine) if reports else nullcontext():
        code, said = doctor("--gripper", "pr2")
    finding = said["transport hidraw"]
    assert (code, finding["state"]) == (1, "problem")
    assert re.search(advice, finding["advice"])
    if reports:
        assert min(finding["numbers"]["lost"], finding["numbers"]["corrupt"]) > 0


def test_a_gripper_that_somebody_else_commands_is_left_alone(doctor, machine, board, powered):
    """A hidraw node is open to two programs at once: letting go here would drop what the other one holds."""
    wire = board()
    machine.plug("/dev/hidraw3", wire)
    counter, plain = count(1), machine.tick

    def tick():
        effort = OutputReport(next(counter) & 0xFFFF, EFFORT_KIND, 9_000_000, OWN_LIMIT, OWN_LIMIT)
        wire.output(encode_output(effort))
        plain()

    machine.tick = tick
    with powered(machine):
        _, said = doctor("--gripper", "pr2")
    numbers = said["transport hidraw"]["numbers"]
    assert (numbers["in_use"], numbers["echoes"], wire.firmware.effort_un) == (True, 0, 9_000_000)


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
    made = (datetime.now(UTC) - timedelta(days=3)).isoformat()
    zero = {"left": [3000.0] * 22, "right": [3000.0] * 22, "images": 24}
    tare = Calibration(
        kind="tare", serial="L7", device=device_numbers(device_identity()), made=made, data=zero
    )
    write_calibration(calibration_path("", "L7", "tare"), tare)
    with powered(machine):
        _, said = doctor("--gripper", "pr2")
    assert said["calibration tare"]["state"] == "ok"
    assert said["calibration tare"]["numbers"]["age_days"] == pytest.approx(3.0, abs=0.01)
    assert said["calibration friction"]["advice"] == "graspsense calibrate friction --gripper pr2"


@every_case(("platform", "says"), [("darwin", "darwin"), ("win32", "win32"), ("linux", "modprobe")])
def test_where_no_device_can_be_emulated_it_says_why_and_offers_another(
    monkeypatch, platform, says, tmp_path
):
    monkeypatch.setattr(reasons.sys, "platform", platform)
    monkeypatch.setattr(reasons, "UHID_NODE", str(tmp_path / "uhid"))
    monkeypatch.setattr(reasons, "VHCI", tmp_path / "vhci")
    with pytest.raises(NoDevice, match=rf"(?s)uhid.*{says}.*vhci.*{says}.*-o gripper.transport=emulated"):
        emulate(Pr2Config(transport="emulated"), "", 0)
