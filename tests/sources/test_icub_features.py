"""The iCub Grasp Dataset as labelled trials: the mapping on files of our own making, the figures on the real ones."""

import os
import re

import numpy as np
import pytest

from graspsense.core.components.registry import installed
from graspsense.core.settings.selected import SelectedComponent
from graspsense.core.values.errors import ConfigError, DataDamaged
from graspsense.evaluation.evaluate import evaluate
from graspsense.plugin_api import create
from graspsense.sources.recordings.icub_dataset import read_dataset

real_data = pytest.mark.skipif(
    "GRASPSENSE_ICUB" not in os.environ,
    reason="needs the iCub Grasp Dataset: name its folder in GRASPSENSE_ICUB",
)


def grasp(flexion, pressed):
    """A file: all six flexion joints at each of these angles, every finger pressed by so many counts on one taxel."""
    lines = ["-10000"]
    for angle, counts in zip(flexion, pressed, strict=True):
        lines.append(" ".join(["20", "80", *[str(angle)] * 6, "2"]))
        lines.append(" ".join(["15.0"] * 5))
        lines += [" ".join([str(240 - counts), *["240"] * 11])] * 5
    return "\n".join(lines) + "\n"


@pytest.fixture
def folder(tmp_path):
    for k in range(1, 4):
        flexion = [10 + k, 14 + k, 16 + k, 16 + k, 16 + k]
        (tmp_path / f"can_{k}.txt").write_text(grasp(flexion, [0, 0, 10, 20, 20]))
        (tmp_path / f"none_{k}.txt").write_text(grasp([30, 40, 50, 60, 60], [0] * 5))
        (tmp_path / f"full_coke_{k}.txt").write_text(grasp([30, 40, 50, 60, 60], [0] * 5))
    (tmp_path / "README.txt").write_text("not a grasp")
    return tmp_path


def read(folder, **more):
    return read_dataset(str(folder), create("feature-set", "chitta"), **more)


def test_labels_order_and_what_is_left_out(folder):
    trials = read(folder)

    assert trials.labels == ("can",) * 3 + ("none",) * 3
    assert trials.order == (1, 2, 3) * 2
    assert trials.instances is None
    assert trials.no_instances
    assert any("3 grasps of full_coke left out: their author" in note for note in trials.notes)
    assert any("frame numbers" in note for note in trials.notes)
    assert read(folder, unreliable=True).labels == ("can",) * 3 + ("full_coke",) * 3 + ("none",) * 3


def test_features_are_relative_to_the_first_frame_and_the_variant_adds_it_back(folder):
    trials = read(folder)
    relative, absolute = trials.table, trials.variants["absolute"].table

    # Contact in the third frame: six degrees on from the first, hence 80 - 6 mm; there it stays.
    # The frame after it shows the rest, with 20 counts (2 N) on either side.
    for row in relative.values[:3]:
        assert row[:4].tolist() == pytest.approx([0.074, 0.074, 2.0, 0.0])
    # The first frame differs by a degree from grasp to grasp: -1 mm a degree, and 15 counts on 12 taxels at rest.
    assert absolute.values[:3, 0] - relative.values[:3, 0] == pytest.approx([-0.011, -0.012, -0.013])
    assert absolute.values[:3, 2] - relative.values[:3, 2] == pytest.approx(0.1 * 15 * 12)
    assert (absolute.values[:3, 3:] == relative.values[:3, 3:])[~np.isnan(relative.values[:3, 3:])].all()
    assert np.isnan(relative.values[3:]).all()
    assert any("3 of 6 grasps" in note for note in trials.notes)
    assert relative.units == ("m", "m", "N", "frame", "m/frame", "N/frame")
    # The first frame as it stands.
    first_frames = trials.before_contact.table.values
    assert first_frames.shape == (6, 74)
    assert first_frames[0].tolist() == [20.0, 80.0, *[11.0] * 6, 2.0, *[15.0] * 5, *[240.0] * 60]


def test_a_folder_without_grasps_and_a_damaged_file(folder, tmp_path):
    with pytest.raises(ConfigError, match="nowhere"):
        read(tmp_path / "nowhere")
    (tmp_path / "empty").mkdir()
    with pytest.raises(ConfigError, match="empty "):
        read(tmp_path / "empty")
    (folder / "can_2.txt").write_text((folder / "can_2.txt").read_text()[:-40])
    trials = read(folder)
    assert len(trials) == 5
    assert any(re.search(r"1 of 6 recordings.*read.*can_2\.txt, line", note) for note in trials.notes)
    for path in folder.glob("*.txt"):
        path.write_text("nothing\n")
    with pytest.raises(DataDamaged, match=r" 6 .*can_1\.txt, line 1"):
        read(folder)


@pytest.fixture(scope="module")
def evaluation():
    labelled = read(os.environ["GRASPSENSE_ICUB"])
    component = installed().find("classifier", "c45")
    learner = SelectedComponent(component, component.config_class()())
    return evaluate(learner, labelled, classifier="c45", permutations=1, learning_curve=False)


@pytest.mark.slow
@real_data
def test_rates_are_split_by_contact_and_do_not_pretend_to_generalise(evaluation):
    """Every class there is one object in one session, so no number of grasps tells of another object."""
    names = ("with features", "without any feature")
    touched, untouched = (evaluation.by_features[name] for name in names)

    assert (touched.n, untouched.n) == (133, 70)
    assert touched.correct + untouched.correct == evaluation.headline.correct
    assert evaluation.unknown.correct >= 70
    assert evaluation.headline.interval is None
    assert "one session" in evaluation.headline.no_interval
    assert any("are the same" in note for note in evaluation.notes)


@pytest.mark.slow
@real_data
def test_blocks_of_recording_order_are_reported_with_their_interval(evaluation):
    blocks = evaluation.controls["recording_order"]

    assert blocks.rate.n == 203
    assert blocks.difference.value == pytest.approx(evaluation.headline.rate - blocks.rate.rate)
    low, high = blocks.difference.interval
    assert low < blocks.difference.value < high
    assert blocks.difference_of == "stratified_10_fold"


@pytest.mark.slow
@real_data
def test_the_first_frame_alone_gives_the_class_away_before_any_touch(evaluation):
    leak = evaluation.controls["before_contact"]
    assert leak.rate.n == 203
    assert leak.rate.rate >= 0.9
    assert any("from before contact" in warning for warning in evaluation.warnings)
    # Features relative to it are a tenth below the absolute ones.
    assert evaluation.protocol == "stratified_10_fold"
    assert evaluation.headline.rate <= evaluation.controls["absolute"].rate.rate - 0.1
    assert evaluation.headline.rate > evaluation.controls["majority_class"].rate.rate + 0.2
    held = evaluation.controls["instance_held_out"]
    assert held.rate is None
    assert held.reason == "every class of this data set is a single object, so none can be held out"
