"""The example of docs/tcp_gripper.md runs, conforms, and does with one force sensor what the page says."""

import inspect
import re
import sys
import threading
import time
from functools import partial
from math import nan
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from parts import offering
from repository import ROOT

from graspsense import load_pipeline
from graspsense.core.components.registry import IsolatedPlugins
from graspsense.gripper_api import Polling
from graspsense.plugin_api import Reading, SensorBackendEntry
from graspsense.testing import examine

LATE_S = 0.15
"""Longer than the page's driver waits for an answer before it asks again; this is waited for in earnest."""
PAGE = (ROOT / "docs" / "tcp_gripper.md").read_text(encoding="utf-8")
EXAMPLE = ROOT / "examples" / "tcp_gripper"


PLUGIN = offering(
    SensorBackendEntry(name="lab-hand", target="tcp_hand:TcpHand", summary="a hand on a socket"),
    SensorBackendEntry(name="seeing", target="tcp_hand:TcpHandWithCamera", summary="a hand with a camera"),
)


@pytest.fixture
def hand(monkeypatch):
    """The modules of the example. Time passes while the driver sleeps, and a little as anybody looks at it."""
    module = ModuleType("tcp_hand")
    monkeypatch.setitem(sys.modules, "tcp_hand", module)
    for name in ("tcp_hand.py", "tcp_hand_camera.py"):
        code = (EXAMPLE / name).read_text(encoding="utf-8")
        exec(compile(code, name, "exec", dont_inherit=True), vars(module))
    now_s, looked = 0.0, threading.Lock()

    def sleep(seconds):
        nonlocal now_s
        with looked:
            now_s += seconds
        if seconds == LATE_S:
            time.sleep(LATE_S)

    def monotonic():
        sleep(1e-5)
        return now_s

    module.time = SimpleNamespace(monotonic=monotonic, sleep=sleep)
    module.Polling = partial(Polling, clock=module.time)
    return module


@pytest.fixture
def plugins(hand):
    with IsolatedPlugins() as plugins:
        plugins.add(PLUGIN, "lab-hand")
        yield plugins


def grasp(plugins, *options, name="lab-hand"):
    fixed = [f"gripper.type=lab-hand/{name}", "gripper.patience_s=60", "classifier.type=none"]
    return load_pipeline(options=[*fixed, *options], plugins=plugins).grasp()


@pytest.mark.slow
def test_it_conforms(plugins):
    report = examine(
        "lab-hand/lab-hand",
        keys={"patience_s": 60.0},
        unplugged={"vanishes_s": 0.5},
        absent={"address": "127.0.0.1:9"},
        plugins=plugins,
    ).report()
    assert report.failures == []
    assert {result.check for result in report.results if result.state == "skipped"} <= {
        *("images-count-up", "pads-can-be-zeroed", "same-seed-same-frames"),
        # It has no further channels.
        *("signals-have-no-gaps-or-repeats", "images-stay-as-they-were-delivered"),
        *("dry-run-accepts-the-same-commands", "objects-can-be-grasped"),
    }


@pytest.mark.parametrize("late_s", [0.0, pytest.param(LATE_S, marks=pytest.mark.slow)])
def test_it_grasps_with_the_default_pipeline_and_asks_again_for_late_answers(plugins, late_s):
    trial = grasp(plugins, f"gripper.late_s={late_s}")
    features = trial.features.as_dict()
    assert trial.outcome.words == "steady"
    assert features["p_first"] == pytest.approx(0.05, abs=1e-3)
    # At 10 mm/s on 1500 N/m, the force rises by 15 N/s until the answer is there, and for two frames.
    assert 20.0 <= features["f_steady"] <= 20.0 + 15.0 * (late_s + 2.0 / 50.0)
    if late_s:
        assert trial.report["repeated"] > 0
        assert trial.counts["lost_frames"] > 0
        assert f"{trial.counts['lost_frames']} frames" in trial.reason


@pytest.mark.slow
def test_its_camera_conforms_and_sees_the_force(hand, plugins):
    keys = {"patience_s": 60.0}
    report = examine("lab-hand/seeing", keys=keys, unplugged={"vanishes_s": 0.5}, plugins=plugins).report()
    assert report.failures == []
    passed = {result.check for result in report.results if result.state == "passed"}
    assert {"images-stay-as-they-were-delivered", "what-it-delivers-is-kept"} <= passed

    trace = grasp(plugins, name="seeing").trace
    eye = trace.signals["eye"]
    assert eye.cells.shape == (len(eye.t_s), *hand.EYE.shape)
    forces = np.interp(eye.t_s, trace.t_s, trace.force_left_n)
    assert eye.cells[:, 100, 150, 0] == pytest.approx(40 + np.minimum(10 * forces, 200), abs=1)
    assert (eye.cells[:, 0, 0] == 40).all()


@pytest.mark.parametrize("right_force_n", [nan, pytest.param(0.0, marks=pytest.mark.slow)])
def test_a_second_pad_without_a_force_never_touches(hand, plugins, monkeypatch, right_force_n):
    read = hand.TcpHand.read

    def one_pad(self, timeout_s):
        reading = read(self, timeout_s)
        return reading and Reading(reading.frame._replace(force_right_n=right_force_n), reading.pads)

    monkeypatch.setattr(hand.TcpHand, "read", one_pad)
    trial = grasp(plugins)
    assert trial.features.as_dict()["p_first"] is None
    assert trial.outcome.words != "steady"


def test_every_option_of_the_checks_is_explained():
    named = re.findall(r"^\| `(\w+)` \|", PAGE.partition("## Conformance checks")[2], re.MULTILINE)
    options = [name for name in inspect.signature(examine).parameters if name != "name"]
    assert named[: len(options)] == options
