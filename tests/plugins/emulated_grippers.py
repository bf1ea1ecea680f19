"""What the tests of drivers share that speak to an emulated gripper over a line."""

import subprocess
import sys
import time
from contextlib import contextmanager
from types import SimpleNamespace

from graspsense import load_pipeline
from graspsense.core.drivers import emulated_serial

PATIENT_S = 60.0
"""For a reply that comes: when it does is this machine's business."""
CLOSING = """
import sys
from graspsense.plugin_api import POSITION, Command, create
driver = create("sensor-backend", sys.argv[1], **{settings})
driver.open(0)
for number in range(10**9):
    reading = driver.read(10.0)
    driver.apply(Command(POSITION, 0.0, {force_n}, 0.05))
    if {told}:
        print("closes", flush=True)
"""


def give_own_time(monkeypatch, backend):
    """Give driver and emulator a time of their own, which passes while the driver sleeps or looks at it."""
    now_s = 0.0

    def sleep(seconds):
        nonlocal now_s
        now_s += seconds

    def look():
        sleep(0.001)
        return now_s

    monkeypatch.setattr(backend, "time", SimpleNamespace(monotonic=look, sleep=sleep))
    monkeypatch.setattr(emulated_serial, "time", SimpleNamespace(monotonic=lambda: now_s))


@contextmanager
def plugged_in(emulator):
    """Give what makes emulated grippers, as `emulator` does, and plugs them in; at the end they are unplugged."""
    made = []

    def make(*arguments, **keys):
        made.append(emulator(*arguments, **keys))
        made[-1].tell("plug")
        return made[-1]

    yield make
    for gripper in made:
        gripper.close()


def assert_a_killed_program_lets_go(backend, presses, force_n, told="number == 10", **settings):
    """Kill a program that closes a gripper; `presses` tells whether the gripper still does, which has to end."""
    program = CLOSING.format(settings=settings, force_n=force_n, told=told)
    with subprocess.Popen(
        [sys.executable, "-c", program, backend], stdout=subprocess.PIPE, text=True
    ) as running:
        assert running.stdout.readline() == "closes\n"
        assert presses()
        running.kill()
    until_s = time.monotonic() + PATIENT_S
    while presses() and time.monotonic() < until_s:
        time.sleep(0.01)
    assert not presses()


def assert_lost_in_a_grasp(pipeline, fault, at_s, *options):
    """Unplug the emulated gripper in a grasp, or let it fall silent: the grasp ends, and says what to look at."""
    faults = {"unplug": ["unplug_at_s={}"], "silent": ["mood=silent", "mood_at_s={}"]}[fault]
    faults = [f"gripper.faults.{setting.format(at_s)}" for setting in faults]
    trial = load_pipeline(pipeline, options=["gripper.port=emulated", *options, *faults]).grasp()
    assert trial.outcome.words == "device lost"
    assert "cable and power" in trial.reason
