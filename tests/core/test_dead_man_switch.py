"""The process that stops a gripper whose program ended without a word."""

import os
import subprocess
import sys
import time

import pytest

ATTEMPTS = 3
PATIENT_S = 60.0
STOPPING = f"""
def stop(path, number):
    with open(path, "a") as file:
        file.write(f"{{number}}\\n")
    if len(open(path).readlines()) < {ATTEMPTS}:
        raise OSError("the port is not free yet")
"""
PROGRAM = """
import os, signal, sys
from graspsense.gripper_api import DeadManSwitch
switch = DeadManSwitch("stopping:stop", sys.argv[1], 2.5)
if sys.argv[2] == "released":
    switch.release()
    switch.release()
elif sys.argv[2] == "killed":
    os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.parametrize("ending", ["killed", "unreleased", "released"])
def test_the_gripper_is_stopped_until_that_succeeds_unless_the_switch_was_released(tmp_path, ending):
    (tmp_path / "stopping.py").write_text(STOPPING)
    called = tmp_path / "called"
    called.touch()
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    subprocess.run([sys.executable, "-c", PROGRAM, called, ending], env=environment, timeout=PATIENT_S)
    expected = [] if ending == "released" else ["2.5"] * ATTEMPTS
    until_s = time.monotonic() + PATIENT_S
    while called.read_text().split() != expected and time.monotonic() < until_s:
        time.sleep(0.01)
    assert called.read_text().split() == expected
