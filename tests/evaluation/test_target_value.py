"""Numbers to predict: a force at break, a fill level. Training, prediction and evaluation with controls."""

import csv
import json
import math

import numpy as np
import pytest
from attrs import evolve
from cases import every_case
from commands import answered, graspsense, printed, refused
from kept import keep

from graspsense.core.components.registry import installed
from graspsense.core.learn.groups import grouped
from graspsense.core.learn.labelled import ControlFeatures, Labelled
from graspsense.core.learn.model_file import load_model
from graspsense.core.learn.target_value import TargetValue, value_label
from graspsense.core.values.errors import ConfigError, DataDamaged
from graspsense.core.values.features import FeatureTable
from graspsense.evaluation.json_codec import to_json
from graspsense.regression.estimators import ESTIMATORS
from graspsense.regression.evaluate import evaluate_regression
from graspsense.regression.intervals import intervals_of
from graspsense.regression.model import load_regression, train_regression, write_regression
from graspsense.regression.results import difference_of_errors, error_of
from graspsense.store.store import Store


def table(*columns, names=("p_first", "f_steady")):
    values = np.column_stack(columns)
    units = ("m", "N", "", "")[: values.shape[1]]
    return FeatureTable(names=tuple(names[: values.shape[1]]), units=units, values=values)


def bottles(objects=20, each=4, seed=0, noise=0.1, **more):
    """Bottles whose stiffness is their fill level; the width says nothing about it."""
    rng = np.random.default_rng(seed)
    object_numbers = np.repeat(np.arange(objects), each)
    fill = rng.uniform(0.0, 10.0, objects)[object_numbers]
    width = 0.06 + 0.001 * rng.normal(size=objects)[object_numbers]
    force = fill + noise * rng.normal(size=len(object_numbers))
    features = table(width, force)
    return Labelled(
        source="bottles",
        table=features,
        labels=("bottle",) * len(object_numbers),
        instances=tuple(f"bottle#{k}" for k in object_numbers),
        order=tuple(rng.permutation(len(object_numbers)).tolist()),
        width=ControlFeatures(table=features.columns(["p_first"]), what="p_first alone"),
        value=TargetValue(name="fill", unit="ml", values=tuple(fill.tolist())),
        **more,
    )


def measured(trials, estimator="ridge", **more):
    return evaluate_regression(estimator, trials, folds=5, **more)


@pytest.mark.slow
@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_every_estimator_predicts_what_a_feature_tells(estimator):
    evaluation = measured(bottles(each=2), estimator)
    assert evaluation.protocol == "instance_held_out"
    assert evaluation.headline.instances == 20
    assert evaluation.headline.mean_absolute < 0.5 * evaluation.controls["mean_only"].error.mean_absolute
    assert evaluation.controls["mean_only"].difference.is_positive
    assert evaluation.controls["width_only"].difference.is_positive
    assert not [warning for warning in evaluation.warnings if "mean" in warning or "width" in warning]
    assert evaluation.explained > 0.7


def test_the_error_is_that_of_the_predictions_and_its_interval_that_of_the_instances():
    evaluation = measured(bottles(noise=1.0))
    errors = np.array([predicted - true for true, predicted in evaluation.predictions])
    assert evaluation.headline.mean_absolute == pytest.approx(np.abs(errors).mean())
    assert evaluation.headline.root_mean_square == pytest.approx(math.sqrt((errors**2).mean()))
    # With as many trials in each instance, this is Student's interval of the means of the instances, widened for five
    # folds that share their training trials, on the logarithm.
    means = np.abs(errors).reshape(20, 4).mean(axis=1)
    half = 2.093024054408263 * means.std(ddof=1) / math.sqrt(20) * math.sqrt(1.0 + 5.0 / 4.0)
    factor = math.exp(half / means.mean())
    assert evaluation.headline.interval == pytest.approx((means.mean() / factor, means.mean() * factor))


@pytest.mark.slow
def test_noise_is_not_predicted_and_said_so():
    trials = bottles()
    rng = np.random.default_rng(3)
    noise = table(rng.normal(size=80), rng.normal(size=80))
    evaluation = measured(evolve(trials, table=noise, width=None, order=None))
    assert any("always predicting" in warning for warning in evaluation.warnings)
    assert evaluation.explained < 0.2


def test_a_number_that_is_the_instance_is_found_out():
    """A feature that is a fingerprint of the bottle: trials of the same bottle in training give the number away."""
    trials = bottles()
    rng = np.random.default_rng(1)
    fingerprint = rng.normal(size=20).repeat(4) + 1e-4 * rng.normal(size=80)
    evaluation = measured(evolve(trials, table=table(fingerprint), width=None, order=None), "tree")
    assert evaluation.protocols["5_fold"].error.mean_absolute < 0.5 * evaluation.headline.mean_absolute
    assert any("the same objects" in warning for warning in evaluation.warnings)


def test_what_the_width_or_the_recording_tells_is_a_warning():
    trials = bottles()
    told = ControlFeatures(table=trials.table.columns(["f_steady"]), what="all of it")
    nothing = ControlFeatures(table=table(np.full(80, np.nan)), what="the first frame")
    evaluation = measured(evolve(trials, width=told, before_contact=told, first_line=nothing, order=None))
    assert any("the width alone" in warning for warning in evaluation.warnings)
    assert any("before contact alone" in warning for warning in evaluation.warnings)
    assert evaluation.controls["first_line"].reason.startswith("0 of 80 trials")
    assert evaluation.controls["recording_order"].error is None


@pytest.mark.slow
def test_prediction_intervals_contain_nine_of_ten_new_objects():
    covered = [measured(bottles(objects=40, seed=seed, noise=1.0)).intervals for seed in range(3)]
    assert np.mean([intervals.covered.rate for intervals in covered]) == pytest.approx(0.9, abs=0.06)
    assert all(1.0 < intervals.mean_half_width < 3.0 for intervals in covered)
    few = measured(bottles(objects=8)).intervals
    assert few.covered is None
    assert few.reason.endswith("calibration instances, 90 % needs 9")


@pytest.mark.slow
def test_the_evaluation_is_json_and_repeatable():
    trials = bottles(each=1)
    text, again = (json.dumps(to_json(measured(trials, "tree")), allow_nan=False) for _ in range(2))
    assert text == again


@pytest.mark.slow
@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_a_model_predicts_the_same_after_loading(tmp_path, estimator):
    trials = bottles(objects=12)
    trials.table.values[3, 1] = np.nan
    model = train_regression(estimator, trials, name="m")
    write_regression(tmp_path / "m.json", model)
    again = load_regression(str(tmp_path / "m.json"))
    assert again.predict(trials.table) == model.predict(trials.table)
    assert (again.target, again.intervals) == (model.target, model.intervals)
    assert model.intervals.half_widths


def test_a_trial_unlike_all_training_trials_is_marked_and_one_that_lacks_a_feature_has_no_interval():
    model = train_regression("ridge", bottles(), name="m")
    usual, wide = model.predict(table([0.06, 0.5], [5.0, 5.0]))
    assert usual.unlike == ""
    assert "p_first" in wide.unlike
    assert usual.low < usual.value < usual.high
    assert (wide.low, wide.high, wide.no_interval) == (None, None, wide.unlike)
    # The error of a prediction from a feature that was filled in was never measured.
    (lacking,) = model.predict(table([0.06], [np.nan]))
    assert (lacking.low, lacking.high, lacking.unlike) == (None, None, "")
    assert lacking.no_interval


@pytest.mark.slow
def test_intervals_hold_for_new_objects_that_nobody_named_and_are_not_for_those_outside_the_trials():
    """Five grasps of each object in any order, each with its number measured again."""
    none = np.empty((2, 0), dtype=np.int64)
    inside, told = [], []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        weights, objects = rng.normal(size=4), rng.normal(size=(20, 4))
        numbers = objects @ weights + rng.normal(size=20)
        of_object = rng.permutation(np.repeat(np.arange(20), 5))
        grasps = objects[of_object] + 0.2 * rng.normal(size=(100, 4))
        measured_again = numbers[of_object] + 0.1 * rng.normal(size=100)
        trials = Labelled(
            source="grasps",
            table=table(*grasps.T, names="abcd"),
            labels=("",) * 100,
            value=TargetValue(name="fill", unit="ml", values=tuple(measured_again.tolist())),
        )
        model = train_regression("knn", grouped(trials, none), name="m")
        fresh = rng.normal(size=(200, 4))
        truth = fresh @ weights + rng.normal(size=200)
        made = model.predict(table(*(fresh + 0.2 * rng.normal(size=(200, 4))).T, names="abcd"))
        inside += [
            answer.low <= number <= answer.high
            for answer, number in zip(made, truth, strict=True)
            if answer.low is not None
        ]
        told.append(np.mean([answer.low is not None for answer in model.predict(trials.table)]))
        beyond = model.predict(table(*(fresh + 2.5).T, names="abcd"))
        assert np.mean([answer.low is None for answer in beyond]) > 0.3
    assert np.mean(inside) > 0.87
    assert np.mean(told) == 1.0


def test_trials_with_one_finely_measured_number_are_held_out_together_and_levels_and_zeros_are_not():
    none = np.empty((2, 0), dtype=np.int64)
    rng = np.random.default_rng(0)
    measured = np.repeat(rng.uniform(0.0, 10.0, 12), 5)
    levels, fresh = np.repeat([0.0, 50.0, 125.0, 250.0, 333.0], 12), rng.uniform(0.0, 10.0, 60)
    cases = (
        (measured, 12),
        (levels, None),
        (fresh.round(2), None),
        (np.where(fresh < 3.0, 0.0, fresh), None),
    )
    for fill, groups in cases:
        value = TargetValue(name="fill", unit="ml", values=tuple(fill.tolist()))
        named = bottles(objects=12, each=5)
        trials = grouped(
            evolve(named, value=value, instances=None, table=table(*rng.normal(size=(2, 60)))), none
        )
        assert (trials.instances and len(set(trials.instances))) == groups
        assert grouped(evolve(named, value=value), none).instances == named.instances


def test_trials_under_other_settings_have_no_interval():
    def at_force(force_n):
        return {"settings": {"controller": {"type": "graspsense/velocity", "probing_force_n": force_n}}}

    model = train_regression("ridge", bottles(provenance=at_force(20.0)), name="m")
    trial = table([0.06], [5.0])
    (same,), (other,) = (model.predict(trial, at_force(force_n)) for force_n in (20.0, 15.0))
    assert same.low is not None
    assert (other.value, other.low) == (same.value, None)
    assert other.no_interval
    (difference,) = model.differences(at_force(15.0))
    assert "controller.probing_force_n" in difference


def test_an_interval_holds_for_large_predictions_too():
    """Where errors grow with the number, one width for all is right on average, and too small for the large ones."""

    def drawn(n):
        size = rng.uniform(0.0, 1.0, n)
        return size, 0.4 * size**2 * rng.normal(size=n)

    rng = np.random.default_rng(3)
    covered = []
    for _ in range(30):
        intervals = intervals_of(*drawn(200), None)
        predicted, errors = drawn(1000)
        inside = np.abs(errors) <= intervals.half_width(predicted)
        covered.append([inside[predicted < 0.2].mean(), inside[predicted > 0.8].mean()])
    # A band of 20 units covers 90 % with a standard deviation of 7 points: that of 30 means is 1.2 points.
    assert np.mean(covered, axis=0) == pytest.approx([0.91, 0.91], abs=0.04)


@pytest.fixture
def path(tmp_path):
    """The file of a trained model."""
    write_regression(tmp_path / "m.json", train_regression("ridge", bottles(), name="m"))
    return tmp_path / "m.json"


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"seed": 5}, "sha256"),
        ({"version": 9}, "version 9"),
        ({"format": "other"}, "of a number"),
    ],
)
def test_a_damaged_model_is_refused(path, change, says):
    path.write_text(json.dumps({**json.loads(path.read_text()), **change}))
    with pytest.raises(DataDamaged, match=says):
        load_regression(str(path))


def test_a_model_of_a_number_is_not_one_of_labels(path):
    with pytest.raises(ConfigError, match=r"m\.json.*graspsense predict"):
        load_model(str(path), installed())


@pytest.fixture
def folder(tmp_path):
    """A store of twelve bottles of two trials each, with the fill level among the labels of most."""
    with Store.open(tmp_path / "trials") as store:
        for k in range(24):
            fill = 10.0 * (k // 2 * 7 % 12)
            labels = {"fill [ml]": str(fill)} if k < 22 else {"colour": "red"}
            values = (0.06, 1.0 + fill + k % 2)
            keep(store, "bottle", f"bottle#{k // 2}", values=values, ticks=9, labels=labels, grasp=k)
    return tmp_path / "trials"


@pytest.mark.slow
def test_a_store_is_trained_on_predicted_and_evaluated(folder, tmp_path):
    number = ("--target-value", "fill", "--classifier", "ridge")
    answer = answered("evaluate", f"store:{folder}", *number)
    assert (answer["unit"], answer["headline"]["n"], answer["headline"]["instances"]) == ("ml", 22, 11)
    assert (
        answer["headline"]["mean_absolute"] < 10.0 < answer["controls"]["mean_only"]["error"]["mean_absolute"]
    )
    assert any("2 trials left out" in note for note in answer["notes"])

    model = tmp_path / "m.json"
    arguments = ("train", f"store:{folder}", *number, "--out", model)
    assert "fill [ml], trained on 22 trials" in printed(*arguments)
    assert graspsense(*arguments)[0] == 2  # it exists

    told = answered("predict", model, f"store:{folder}", "--target-value", "fill")
    assert told["n"] == 22
    assert told["error"]["mean_absolute"] < 10.0
    assert told["predictions"][4]["truth"] == 20.0
    assert told["predictions"][4]["value"] == pytest.approx(20.0, abs=10.0)
    assert "PREDICTION [ml]" in graspsense("predict", model, f"store:{folder}")[1]


@pytest.mark.slow
def test_an_export_and_a_csv_of_other_programs_give_the_same(folder, tmp_path):
    assert graspsense("export", folder, "--to", tmp_path / "t.csv")[0] == 0
    with (tmp_path / "t.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    with (tmp_path / "other.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["bottle", "fill [ml]", "p_first [m]", "f_steady [N]"])
        writer.writerows(
            [row["instance"], row["value.fill [ml]"], row["p_first [m]"], row["f_steady [N]"]] for row in rows
        )
    more = ("--target-value", "fill", "--classifier", "ridge", "--json")
    stored, exported, other = (
        json.loads(graspsense("evaluate", source, *more, *options)[1])
        for source, options in (
            (f"store:{folder}", ()),
            (tmp_path / "t.csv", ()),
            (tmp_path / "other.csv", ("--instance", "bottle")),
        )
    )
    for trials in (stored, exported):
        trials.pop("source"), trials.pop("notes")
    assert exported == stored
    assert other["headline"] == stored["headline"]
    assert other["unit"] == "ml"
    assert ["fill", "ml"] not in other["features"]


@every_case(
    ("arguments", "says"),
    [
        (("--target-value", "fil"), "'fill'"),
        (("--target-value", "colour"), "is 'red'"),
        (("--target-value", "fill", "--classifier", "c45"), "'c45' cannot predict"),
        (("--target-value", "fill", "--target", "class"), "--target is for"),
        (("--target-value", "fill", "-o", "classifier.trees=3"), "no settings"),
        (("--target-value", "fill", "--folds", "99"), "into 99 folds"),
    ],
)
def test_what_makes_no_sense_is_told(folder, arguments, says):
    assert says in " ".join(refused("evaluate", f"store:{folder}", *arguments).split())


def test_simulated_trials_have_no_numbers():
    assert "numbers to predict" in refused("evaluate", "simulated", "--target-value", "fill")


@every_case("text", ["fill", "=3", "fill [ml]=", "fill=much", "label=3", "fill=inf"])
def test_a_number_of_a_trial_is_name_and_number(text):
    with pytest.raises(ConfigError, match=r"NAME \[UNIT\]=NUMBER"):
        value_label(text)
    assert value_label("fill [ml] = 250") == ("fill [ml]", "250")


def test_the_interval_of_an_error_is_one_of_its_logarithm_and_counts_the_folds():
    errors = [1.0, -2.0, 3.0, 1.0, -1.0, 4.0, 2.0, 2.0]
    alone, folded = error_of(errors, None), error_of(errors, None, folds=10)
    for error in (alone, folded):
        low, high = error.interval
        assert low * high == pytest.approx(error.mean_absolute**2)
    # The variance of a mean of ten folds is multiplied by 1 + 10 / 9.
    wider = math.log(folded.interval[1] / 2.0) / math.log(alone.interval[1] / 2.0)
    assert wider == pytest.approx(math.sqrt(1.0 + 10.0 / 9.0))
    shown = difference_of_errors([5.0, 6.0, 5.5, 5.0, 6.5, 6.0], [1.0, 4.0, 1.0, 2.0, 4.0, 1.0], None)
    folded = difference_of_errors([5.0, 6.0, 5.5, 5.0, 6.5, 6.0], [1.0, 4.0, 1.0, 2.0, 4.0, 1.0], None, 10)
    assert folded.interval[1] - folded.value == pytest.approx(
        math.sqrt(1.0 + 10.0 / 9.0) * (shown.interval[1] - shown.value)
    )
