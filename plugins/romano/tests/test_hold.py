"""`graspsense hold` as a user runs it, and the laws compiled together with the simulator. Simulated."""

import signal
import subprocess
import sys

import numpy as np
import pytest
from cases import every_case
from commands import graspsense, refused

from graspsense.plugin_api import create
from graspsense.testing.controller import LONGEST_S
from graspsense.testing_api import parametrize_checks

COMMAND = [sys.executable, "-m", "graspsense", "hold"]
PR2 = ["--gripper", "pr2", "-o", "gripper.transport=emulated", "-o", "controller.sends=effort"]


# Laws that wait until the thing is put down are checked with a shorter wait: the default is a minute at 1 kHz.
@pytest.mark.slow
@parametrize_checks("graspsense-romano", keys={"place_timeout_s": 5.0})
def test_conformance(check):
    check.run()


@every_case("name", ["pick-and-place", "release", "event-detector"])
def test_by_default_a_law_ends_within_the_time_that_conformance_allows(name):
    assert create("controller", name).params().plan.place_timeout_s <= LONGEST_S


@every_case(
    ("arguments", "said"),
    [
        (["--seconds", "0"], "seconds"),
        (["--seconds", "nan"], "seconds"),
        (["--gripper", "mujocco"], "mujoco"),
        (["-o", "controller.force_n=-1"], "force_n"),
        (["-o", "controller.sends=effect"], "effort"),
        (["--object", "tuged"], "tugged"),
        (["-o", "controller.force_n=30"], "force_limit_n"),
        (["-o", "controller.force_n=0.5"], "lightest_n"),
        (["-o", "controller.type=grab", "-o", "controller.lightest_n=30"], "force_limit_n"),
        (["--seconds", "3", "-o", "run.hold_s=9"], "run.hold_s"),
        (["--gripper", "sim"], "controller.sends=effort"),
    ],
)
def test_bad_input_is_a_wrong_use(arguments, said):
    assert said in refused("hold", *arguments)


@pytest.mark.slow
def test_a_gripper_that_is_lost_ends_it_and_may_not_be_open():
    done = graspsense("hold", "--seconds", "30", *PR2, "-o", "gripper.faults.unplug_at_s=0.7")
    assert done.returncode == 4
    assert "device lost" in done.stdout
    assert "does not answer" in done.stderr


@pytest.mark.slow
@every_case(
    ("arguments", "printed", "shown"),
    [
        (["--pipeline", "robotiq", "-o", "gripper.port=emulated"], ["steady"], ["no pads", "release"]),
        # 3 N and the weight of 0.15 kg need 5.6 N at a friction of 0.4.
        (["-o", "controller.force_limit_n=4"], ["slipped", "too heavy"], ["force limit reached"]),
    ],
)
def test_a_force_that_is_not_measured_or_does_not_suffice_is_said(arguments, printed, shown):
    done = graspsense("hold", "--seconds", "5", *arguments)
    assert done.returncode == 0
    assert all(word in done.stdout for word in printed)
    assert all(word in done.stderr for word in shown)
    assert "nan" not in done.stderr


@pytest.mark.slow
def test_a_tugged_block_is_held_with_more_force_from_the_first_slip_on():
    code, out, err = graspsense("hold", "--seconds", "5")
    assert code == 0
    told = [line.split() for line in err.splitlines() if line.endswith(("slip", "holds"))]
    slips = [float(t) for t, _, _, _, what in told if what == "slip"]
    forces = {float(t): float(force) for t, _, force, _, what in told if what == "holds"}
    assert slips
    early_n, after = forces[min(forces)], forces[max(forces)]
    # 0.15 kg and 3 N at a friction of 0.4 need (1.47 + 3) / 0.8 = 5.6 N; it begins at 2.5 N.
    assert early_n == pytest.approx(2.5, abs=0.3)
    assert 5.6 < after < 12.0
    assert "steady" in out


@pytest.mark.slow
@pytest.mark.parametrize("when", ["contact", "holds"])
def test_ctrl_c_opens_the_fingers(when):
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    running = subprocess.Popen([*COMMAND, "--seconds", "600", *PR2], **pipes)
    for line in running.stderr:
        if line.rstrip().endswith(when):
            running.send_signal(signal.SIGINT)
            break
    out, err = running.communicate(timeout=120)
    assert running.returncode == 4
    assert "interrupted" in out
    (opened,) = [line for line in err.splitlines() if "opened to" in line]
    assert float(opened.split()[-2]) > 80.0


LAWS = {"pick-and-place": "slow", "grab": "long", "event-detector": "long"}


@pytest.mark.parametrize("name", [pytest.param(law, marks=getattr(pytest.mark, LAWS[law])) for law in LAWS])
def test_laws_give_the_same_grasp_compiled_and_plain(name):
    law, runs = create("controller", name), []
    for compiled in ("always", "never"):
        gripper = create("sensor-backend", "sim", compile=compiled)
        runs.append(gripper.run_many(law, ["odwalla:full_open"], [1], workers=1, traces=True)[0])
    always, never = runs
    assert always.outcome == never.outcome
    assert np.allclose(always.trace.gap_m, never.trace.gap_m, atol=1e-9)
    assert np.allclose(always.trace.command, never.trace.command, atol=1e-6)
    assert [event.what for event in always.trace.events] == [event.what for event in never.trace.events]
