"""graspsense as a step of a LeRobot processor: it follows the grasps in observations and adds what it knows."""

import json
import math
import sys
from itertools import product
from pathlib import Path

import lerobot_stand_in  # noqa: F401
import numpy as np
import pytest
from cases import every_case
from commands import printed

from graspsense import Phase
from graspsense.plugin_api import ConfigError, PluginUnavailable
from graspsense_lerobot.processor import ADDED, processor_step
from graspsense_lerobot.running import EVENTS

FPS = 50
READING = f"gap_m_per_unit=0.0008&fps={FPS}"
OPTIONS = ["classifier.type=none", "controller.type=hybrid"]


def grasp(width_m=0.05, stiffness_n_m=4000.0, most_n=17.0, speed_m_s=0.02):
    """Return observations of a gripper that closes from 70 mm on a spring until a force, holds, and opens."""
    gap_m, observations = 0.07, []
    closed_m = width_m - most_n / stiffness_n_m
    path = list(np.arange(0.07, closed_m, -speed_m_s / FPS)) + [closed_m] * FPS
    path += list(np.arange(closed_m, 0.07, speed_m_s / FPS)) + [0.07] * 5
    for gap_m in path:
        force_n = stiffness_n_m * max(width_m - gap_m, 0.0)
        names = product("01", "01", "xyz")
        cells = {f"f{finger}.p{cell}.f{axis}": force_n / 2 * (axis == "z") for finger, cell, axis in names}
        observations.append({"shoulder.pos": 1.0, "gripper.pos": gap_m / 0.0008, **cells})
    return observations


def processed(step, observations):
    """Return what LeRobot makes of the observations with this step in a processor."""
    return [step({"observation": observation})["observation"] for observation in observations]


def events(seen):
    return [EVENTS[int(told["graspsense.event"])] for told in seen if told["graspsense.event"]]


def test_the_step_tells_contact_rest_and_end_of_each_grasp():
    step = processor_step()("default", OPTIONS, READING)
    observations = [*grasp(), *grasp(width_m=0.04)]
    seen = processed(step, observations)

    assert events(seen) == ["contact", "rest", "end"] * 2
    touch = next(k for k, told in enumerate(seen) if told["graspsense.event"] == 1)
    assert observations[touch]["gripper.pos"] * 0.0008 == pytest.approx(0.05, abs=1e-3)
    phases = {Phase.APPROACH, Phase.SQUEEZE, Phase.HOLD, Phase.RELEASE}
    assert {int(told["graspsense.phase"]) for told in seen} == phases
    assert all({*told} == {*given, *ADDED} for told, given in zip(seen, observations, strict=True))
    assert all(told["graspsense.prediction"] == 0 for told in seen)


@pytest.fixture
def end_of_grasp(tmp_path, monkeypatch):
    """Return a function that trains a tree; it gives the step with it, and what this tells at the end of a grasp."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["graspsense"])

    def told(observations, *training):
        printed("train", *training, "--classifier", "tree", "--out", "model.json", "--overwrite")
        step = processor_step()("default", ["classifier.type=tree", "classifier.model=model.json"], READING)
        seen = processed(step, observations)
        (end,) = [told for told in seen if told["graspsense.event"] == EVENTS.index("end")]
        return step, end

    return told


def test_a_model_predicts_at_the_end_of_the_grasp(end_of_grasp):
    samples = Path(__file__).parents[3] / "samples" / "trials"
    # As wide, stiff and slow as the cans of the training: what is unlike them would be unknown.
    can = grasp(width_m=0.0659, stiffness_n_m=2800.0, most_n=6.5, speed_m_s=0.01)
    step, end = end_of_grasp(can, f"store:{samples}")

    assert step.grasp.classes == ("can:empty_open", "can:full_open")
    assert end["graspsense.prediction"] in (1, 2)
    # Four trials measure no certainty, whatever the probability in the leaf.
    assert all(math.isnan(end[f"graspsense.certainty{bound}"]) for bound in ("", "_low", "_high"))


def test_a_certainty_that_was_measured_comes_with_its_interval(end_of_grasp):
    widths = [("jar", 50.0 + 0.1 * k) if k % 2 else ("can", 66.0 + 0.1 * k) for k in range(-20, 20)]
    rows = [f"{what},{mm / 1e3:g}" for what, mm in widths]
    Path("widths.csv").write_text("\n".join(["what,p_first [m]", *rows]))
    step, end = end_of_grasp(grasp(), "widths.csv", "--label", "what")

    assert step.grasp.classes[int(end["graspsense.prediction"]) - 1] == "jar"
    low, certainty, high = (end[f"graspsense.certainty{bound}"] for bound in ("_low", "", "_high"))
    # All 40 held-out answers are right. Since ten folds share training trials, they count as 40 / (1 + 10 / 9) units.
    # The distance of their rate from guessing one of two labels, 1/2, has a square of so many variances. The interval
    # is that of the 20 answers with this label.
    units = 40.0 / (1.0 + 10.0 / 9.0)
    variances = units * (units + 2.0) ** 2 / 4.0 / (units + 1.0)
    right = units * (1.0 - 0.5 / (variances + 1.0))
    assert certainty == pytest.approx((right + 1.0) / (units + 2.0))
    assert 0.65 < low < certainty < high < 1.0

    # A finger whose forces stand still where they were at 4 N.
    stuck, kept = grasp(), None
    for observation in stuck:
        finger = {name: value for name, value in observation.items() if name.startswith("f0.")}
        kept = finger if kept is None and sum(finger.values()) >= 4.0 else kept
        observation |= kept or {}
    step, end = end_of_grasp(stuck, "widths.csv", "--label", "what")
    assert [fault.split(":")[0] for fault in step.grasp.faults] == ["left pad stuck"]
    assert step.grasp.classes[int(end["graspsense.prediction"]) - 1] == "jar"
    assert math.isnan(end["graspsense.certainty"])


def test_reset_begins_anew_and_a_missing_number_is_counted():
    step = processor_step()("default", OPTIONS, READING)
    observations = grasp()
    seen = processed(step, observations[:60])
    step.reset()
    damaged = [{**observation, "gripper.pos": math.nan} for observation in observations[:3]]
    again = processed(step, [*damaged, *observations])
    assert len(seen) == 60
    assert step.grasp.missing == 3
    assert events(again) == ["contact", "rest", "end"]


def test_the_step_declares_what_it_adds_and_can_be_stored():
    step = processor_step()("default", OPTIONS, READING)
    from lerobot.configs.types import PipelineFeatureType

    features = step.transform_features({PipelineFeatureType.OBSERVATION: {"observation.state": 1}})
    assert {*features[PipelineFeatureType.OBSERVATION]} == {"observation.state", *ADDED}
    kept = json.loads(json.dumps(step.get_config()))
    assert processor_step()(**kept).get_config() == kept


@every_case(
    ("reading", "word"),
    [("", "metres"), ("gap=claw", "claw"), ("gap_m_per_unit=0.0008&force=nothing", "nothing")],
)
def test_observations_that_are_not_understood_are_told(reading, word):
    step = processor_step()("default", OPTIONS, reading)
    with pytest.raises(ConfigError, match=word):
        processed(step, grasp()[:1])


def test_features_that_need_more_than_numbers_are_refused():
    with pytest.raises(ConfigError, match="pads"):
        processor_step()("default", ["classifier.type=none", "features.type=contact-image"], READING)


def test_without_lerobot_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "lerobot.processor", None)
    with pytest.raises(PluginUnavailable, match="pip install lerobot"):
        processor_step.__wrapped__()
