"""Where a gripper is mounted: what a user writes, and that it is kept with a trial, replayed and exported."""

import json
from math import pi

import pytest
from attrs import evolve
from cases import every_case

from graspsense import load_pipeline
from graspsense.core.components.registry import installed
from graspsense.core.grasp.runner import run_grasp
from graspsense.core.pipeline.pipeline import grasp_with
from graspsense.core.values.errors import ConfigError
from graspsense.gripper_api import Mounting
from graspsense.plugin_api import create
from graspsense.recording.export_trace import WRITERS
from graspsense.recording.reader import read_recorded
from graspsense.recording.trial_record import DeviceRecord
from graspsense.sources.recordings.exported_grasp import read_exported
from graspsense.store.comparable import check_settings, newest_grasp
from graspsense.store.record_grasp import record_grasp
from graspsense.store.store import Store

TOOL = "tool0 of models/arm.urdf"
THUMB = "0 20 95 mm, 0 0 90 deg in tool"


def settings(*options):
    quick = ["gripper.object=block", "gripper.rate_hz=250"] if "gripper.type=replay" not in options else []
    return load_pipeline(options=["classifier.type=none", *quick, *options]).settings


def test_a_pose_is_in_metres_and_radians_whatever_it_was_written_in():
    assert Mounting.parse(THUMB) == Mounting(
        position_m=(0.0, 0.02, 0.095), rpy_rad=(0.0, 0.0, pi / 2), parent="tool"
    )


@every_case("text", ["tool0", "1 2 mm", "1 2 3", "1 2 3 in", "1 2 nan m", "0 0 0 m, 0 0 1 turns", ""])
def test_what_is_no_mounting_is_refused_with_the_form_of_one(text):
    with pytest.raises(ConfigError, match=r"tool0 of arm\.urdf"):
        settings(f'run.mounting.tool="{text}"')


@pytest.mark.slow
def test_the_mounting_of_the_settings_is_kept_with_the_trial_replayed_and_exported(tmp_path):
    given = settings(f'run.mounting.tool="{TOOL}"', f'run.mounting.thumb="{THUMB}"')
    with Store.open(tmp_path / "trials") as store:
        trial = record_grasp(store, given, installed(), labels={}, origin="run").trial
        # Another mounting is no other experiment: it raises ConfigError if they differ.
        check_settings(store, newest_grasp(store), settings())
    (path,) = (tmp_path / "trials" / "recordings").glob("*.mcap")
    recorded = read_recorded(path)
    replayed = grasp_with(settings("gripper.type=replay", f"gripper.recording={path}"), installed())
    WRITERS[".csv"](tmp_path / "grasp.csv", recorded)

    wanted = {"tool": Mounting.parse(TOOL), "thumb": Mounting.parse(THUMB)}
    assert trial.device.mounting == recorded.device.mounting == replayed.device.mounting == wanted
    assert read_exported(str(tmp_path / "grasp.csv")).mounting == wanted
    exported = json.loads((tmp_path / "grasp.csv.json").read_text())["mounting"]
    assert exported["tool"] == {"link": "tool0", "model": "models/arm.urdf"}


def test_the_settings_add_to_the_mounting_that_a_gripper_declares():
    gripper = create("sensor-backend", "sim", object="block", rate_hz=250.0)
    opened, palm = gripper.open, Mounting(link="palm", model="hand.xml")
    gripper.open = lambda seed: evolve(opened(seed), mounting={"palm": palm, "tool": palm})
    chosen = settings(f'run.mounting.tool="{TOOL}"')
    grasp = run_grasp(gripper, chosen.controller.create(), chosen.run)
    assert grasp.device.mounting == {"palm": palm, "tool": Mounting.parse(TOOL)}


def test_a_trial_without_a_mounting_is_stored_as_before_there_was_one():
    record = DeviceRecord(name="hand")
    assert "mounting" not in json.loads(record.to_text())
    assert DeviceRecord.from_text(record.to_text()) == record
