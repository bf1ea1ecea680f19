"""A model's file, and what a model says of a grasp."""

import json
import math
from pathlib import Path

import pytest
from attrs import evolve
from cases import every_case
from commands import refused
from test_classifiers import NAMES, UNITS, trials
from test_conformal import bottles, model_of
from test_damaged_models import resealed

from graspsense.core.components.registry import IsolatedPlugins, installed
from graspsense.core.components.setting import worded
from graspsense.core.learn.labelled import Labelled
from graspsense.core.learn.model_file import load_model, write_model
from graspsense.core.learn.training import train
from graspsense.core.pipeline.pipeline import model_for
from graspsense.core.settings.layers import Flag
from graspsense.core.settings.resolved import resolve
from graspsense.core.values.errors import ConfigError, DataDamaged, UnknownName
from graspsense.core.values.features import UNKNOWN, Features
from graspsense.testing.samples import a_trial

CAN = Features(names=NAMES, values=(0.0661, 8.0, 0.0), units=UNITS)


def model(name="c45", features=NAMES, **provenance):
    table, labels = trials()
    table = table.columns(features)
    component = installed().find("classifier", name)
    labelled = Labelled(source="a test", table=table, labels=tuple(labels), provenance=provenance)
    return train(component, component.config_class()(), labelled, name="test", seed=4)


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "model.json"
    write_model(path, model())
    return path


def device(clock):
    return evolve(a_trial().device, clock=clock, simulated=clock == "virtual")


def test_a_pipeline_reads_a_model_once_and_again_when_its_file_has_changed(tmp_path):
    path = tmp_path / "kept.json"
    write_model(path, model("knn", NAMES[:2]))  # those that the pipeline has
    settings = resolve("default", options=["classifier.type=knn", f"classifier.model={path}"])
    first_read = model_for(settings, installed())
    assert model_for(settings, installed()) is first_read

    resealed(path, lambda content: content.update(target="object"))

    assert model_for(settings, installed()).target == "object"


def test_the_file_says_what_it_was_trained_on(file):
    kept = json.loads(file.read_text())
    said = kept["provenance"]
    assert kept["classifier"] == "graspsense-c45/c45"
    assert kept["features"] == [["p_first", "m"], ["f_steady", "N"], ["noise", ""]]
    assert (said["source"], said["seed"]) == ("a test", 4)
    assert said["by_label"] == {"bottle:empty": 40, "bottle:full": 40, "can:full": 40}
    assert said["versions"].keys() == {"graspsense", "graspsense-c45", "numpy", "python"}


def test_a_thing_unlike_anything_is_unknown_and_says_why():
    said = model().predict(Features(names=NAMES, values=(0.03, 8.0, 0.0), units=UNITS))

    assert said.label == UNKNOWN
    unlike, nearest = (reason.words for reason in said.because[:2])
    assert unlike.startswith("p_first = 30 mm is unlike")
    assert "bottle:" in unlike
    assert "bottle:" in nearest


@every_case(
    ("names", "values", "units", "why"),
    [
        (NAMES, (math.nan,) * 3, UNITS, "no contact"),
        (("p_first",), (0.06,), ("m",), "no f_steady, noise among p_first"),
        (NAMES, (0.06, 8.0, 0.0), ("m", "counts", ""), "takes f_steady in N"),
    ],
)
def test_no_features_other_ones_or_other_units_cannot_be_judged(names, values, units, why):
    reasons = {name: "no contact" for name, value in zip(names, values, strict=True) if math.isnan(value)}
    said = model().predict(Features(names=names, values=values, units=units, reasons=reasons))

    assert said.label == UNKNOWN
    assert why in said.because[0].words


def test_further_features_and_another_order_do_no_harm():
    names, units = ("x", "noise", "f_steady", "p_first"), ("", "", "N", "m")
    more = Features(names=names, values=(1.0, 0.0, 8.0, 0.0661), units=units)

    assert model().predict(more).label == "can:full"


def test_simulated_training_is_said_and_louder_on_a_real_gripper():
    assert "on 120 simulated" in model(simulated=True, recorded_too=True).in_a_line
    simulated = model(simulated=True)

    (warning,) = simulated.predict(CAN).warnings
    assert "simulated" in warning
    assert simulated.predict(CAN, None, device("virtual")).warnings == simulated.predict(CAN).warnings
    (warning,) = simulated.predict(CAN, None, device("device")).warnings
    assert "is real" in warning
    assert model().predict(CAN, None, device("device")).warnings == ()


DEFAULTS = {table: resolve().values[table] for table in ("gripper", "controller", "features")}


@every_case(
    ("options", "gripper", "said"),
    [
        ("", None, ""),
        ("gripper.object=can:empty_open run.seed=4", None, ""),
        ("gripper.explain=true gripper.compile=never", None, ""),
        ("controller.probing_force_n=17", None, "probing force 20 N, this one was with 17 N"),
        ("controller.closing_speed_m_s=0.05", None, "closing speed 10 mm/s, this one was with 50 mm/s"),
        ("gripper.transmission=pr2_paper", None, "transmission pr2, this one was with pr2_paper"),
        (
            "gripper.recording=icub:x.txt",
            "replay",
            "gripper graspsense-sim-gripper/sim, this one was with grasp",
        ),
    ],
)
def test_another_force_speed_or_gripper_is_said(options, gripper, said):
    trained = model(simulated=True, settings=DEFAULTS)
    flags = [Flag("--gripper", "gripper.type", gripper)] if gripper else []

    warnings = trained.predict(CAN, resolve(options=options.split(), flags=flags)).warnings[1:]

    assert len(warnings) == bool(said)
    assert all(f"simulated grasps with {said}" in warning for warning in warnings)
    # A key is named where it is not the gripper itself.
    assert all(options.split("=")[0] in warning for warning in warnings if not gripper)


@every_case(
    ("options", "forgotten", "told"),
    [
        ("", "", 0),
        ("gripper.object=can:empty_open", "", 0),
        ("gripper.transmission=pr2_paper", "", 1),
        ("controller.probing_force_n=17", "", 1),
        ("", "gripper", 1),
    ],
)
def test_of_a_recording_what_made_it_counts_as_far_as_it_is_known(options, forgotten, told):
    trained = model(simulated=True, settings=DEFAULTS)
    made = resolve(options=options.split()).values
    recorded_with = {table: made[table] for table in ("gripper", "controller") if table != forgotten}
    replayed = evolve(device("virtual"), recorded_with=recorded_with)
    flags = (Flag("", "gripper.type", "replay"), Flag("", "gripper.recording", "icub:x.txt"))

    assert len(trained.predict(CAN, resolve(flags=flags), replayed).warnings[1:]) == told
    # What follows a recording is compared as well, and the same difference is told once.
    follows = resolve(options=("controller.probing_force_n=17",), flags=flags)
    assert len(trained.predict(CAN, follows, replayed).warnings[1:]) == told + ("controller" not in options)


def test_no_figure_is_given_that_was_not_measured_under_the_settings_of_the_grasp():
    bottled, provenance = bottles(20, spread=0.3), {"simulated": True, "settings": DEFAULTS}
    measured = evolve(model_of(bottled, "c45"), provenance=provenance)
    row = bottled.table.row(0)
    same, other = resolve(), resolve(options=("controller.probing_force_n=15",))
    changed = {**provenance, "settings": {**DEFAULTS, "controller": other.values["controller"]}}

    for said in (measured.predict(row, same), measured.predict(row, provenance=provenance)):
        assert said.certainty is not None
        assert said.coverage == 0.9
    elsewhere = (
        measured.predict(row, other),
        measured.predict(row, same, device("device")),
        measured.predict(row, provenance=changed),
        measured.predict(row, provenance={"simulated": False}),
        *measured.predictions(bottled.table, changed),
    )
    for said in elsewhere:
        assert (said.certainty, said.coverage, said.prediction_set) == (None, None, ())
        assert "%" not in said.certainty_in_words
        assert said.as_json()["no_certainty"]


def test_the_sets_of_an_earlier_version_are_left_out_and_it_says_what_to_do(file):
    sets = {"coverage": 0.9, "unit": "trials", "reason": "", "thresholds": {"can:full": [0.1, 9, True]}}
    resealed(file, lambda content: content.update(version=1, sets=sets))
    resealed(file, lambda content: content.pop("certainty"))

    said = load_model(str(file), installed()).predict(CAN)

    assert (said.certainty, said.prediction_set) == (None, ())
    assert "train it again" in said.no_certainty


def test_a_model_of_other_features_is_refused_before_the_grasp_with_what_to_do():
    given = ("-o", "features.type=curve", "--gripper", "sim")
    for command in (("run",), ("run", "-o", "run.stop_when_sure=true"), ("config", "validate")):
        told = refused(*command, *given)
        words = ("approach", "p_first", "-o features.type=curve --classifier c45")
        assert [word in told for word in words] == [False, True, True]


def edited(change):
    """Return a change of a file by one of its bytes."""
    return lambda path: path.write_bytes(change(path.read_bytes()))


def saying(**changes):
    """Return a change of a file to one with other content and the hash of that."""
    return lambda path: resealed(path, lambda content: content.update(changes))


@every_case(
    ("spoil", "error", "says"),
    [
        (edited(lambda data: data.replace(b"0.25", b"0.26", 1)), DataDamaged, "its sha256"),
        (edited(lambda data: data[:400]), DataDamaged, "is not JSON"),
        (edited(lambda data: b""), DataDamaged, "is empty"),
        (edited(lambda data: b"\x80\x04\x95pickle"), DataDamaged, "is not JSON"),
        (edited(lambda data: b"[]"), DataDamaged, "not a model"),
        (edited(lambda data: b'{"format": "other"}'), DataDamaged, "not a model"),
        (saying(version=3), DataDamaged, "version 3.*2"),
        # A classifier that is not installed is not imported.
        (saying(classifier="os/system"), UnknownName, "named 'os/system'"),
        (Path.unlink, ConfigError, "cannot be read"),
    ],
)
def test_a_file_that_is_damaged_of_a_later_version_or_not_there_is_refused(tmp_path, spoil, error, says):
    path = tmp_path / "model.json"
    write_model(path, model())
    spoil(path)
    with pytest.raises(error, match=says):
        load_model(str(path), installed())


def test_no_such_name():
    with pytest.raises(UnknownName, match=r"\.json"):
        load_model("nosuch", installed())
    with IsolatedPlugins() as plugins, pytest.raises(UnknownName, match="by graspsense-sim-gripper"):
        load_model("default", plugins)


def test_a_model_of_another_classifier_or_none_is_refused_with_how_to_get_one(file):
    other = resolve(options=["classifier.type=knn", f"classifier.model={file}"])
    without = resolve(options=["classifier.type=forest"])
    with pytest.raises(ConfigError, match=r"graspsense-c45/c45.*graspsense/knn"):
        model_for(other, installed())
    with pytest.raises(
        ConfigError, match="graspsense train simulated --gripper sim --classifier forest --out"
    ):
        model_for(without, installed())
    assert model_for(evolve(without, classifier=None), installed()) is None


@every_case(
    ("key", "value", "words"),
    [
        ("rise_n_s", 10.0, ("rise", "10 N/s")),
        ("closed_gap_m", 0.003, ("closed gap", "3 mm")),
        ("velocity_gain_n_s_m", 15000, ("velocity gain", "15000 N s/m")),
        ("hold_s", "long", ("hold s", "long")),
        ("min_objects", 2, ("min objects", "2")),
        ("is_m", True, ("is m", "True")),
    ],
)
def test_a_setting_in_words_has_the_unit_of_its_key(key, value, words):
    assert worded(key, value) == words
