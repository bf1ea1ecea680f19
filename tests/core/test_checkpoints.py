"""Predictions while a grasp goes on: the same part of a grasp in training and in use, and the end of a sure squeeze."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable

import numpy as np
import pytest
from attrs import evolve, frozen
from cases import every_case
from test_conformal import model_of
from test_evaluate import learner

from graspsense.core.components.registry import installed
from graspsense.core.components.run_config import RunConfig
from graspsense.core.grasp.runner import run_grasp
from graspsense.core.learn.checkpoints import (
    CheckpointFeatures,
    checkpoints_of,
    contact_of,
    split_checkpoints,
)
from graspsense.core.learn.labelled import Labelled
from graspsense.core.learn.model_file import load_model, write_model
from graspsense.core.pipeline.anytime import Anytime, anytime_of
from graspsense.core.settings.resolved import resolve
from graspsense.core.values.errors import ConfigError, DataDamaged
from graspsense.core.values.features import CheckpointPrediction, Features, Prediction, table_of
from graspsense.core.values.signals import Outcome, Phase
from graspsense.evaluation.checkpoints import SURE, WHOLE, checkpoint_models, early_recognition
from graspsense.plugin_api import create
from graspsense.testing.model_gripper import ModelGripper

CHECKPOINTS = (0.02, 0.05)
C45 = learner("c45")
RUN = RunConfig(hold_s=0.1)


class Watched(ModelGripper):
    """A model gripper that keeps its commands with the gap before them; `clock` as a real one has it.

    Its ticks take no time, so that `wait` stands for the time until the next one, and `ended` for that after the grasp.
    """

    def __init__(self, stiffness_n_m, clock="virtual", wait=lambda: None, ended=lambda: None):
        super().__init__(
            frozenset({"gap", "velocity", "effort", "force_left", "force_right"}), 0.07, stiffness_n_m
        )
        self.clock, self.commanded, self.closed, self.wait, self.ended = clock, [], 0, wait, ended

    def open(self, seed):
        return evolve(super().open(seed), clock=self.clock, simulated=self.clock == "virtual")

    def read(self, timeout_s):
        self.wait()
        return super().read(timeout_s)

    def apply(self, command):
        self.commanded.append((command, self._gap))
        super().apply(command)

    def close(self):
        self.closed += 1
        self.ended()


@frozen
class Stub:
    """A part of a model that answers with this function."""

    predict: Callable[..., Prediction]
    sets: None = None


def told_by_model(grasp):
    return [event.what for event in grasp.events if event.source == "model"]


def grasp_of(gripper, **more):
    controller = create("controller", "hybrid", closing_speed_m_s=0.02)
    return run_grasp(gripper, controller, RUN, **more)


def curve():
    return create("feature-set", "graspsense/curve")


@pytest.fixture(scope="module")
def traces():
    """Fifteen soft and fifteen stiff objects of the same width, whose forces differ by some percent."""
    rng = np.random.default_rng(1)
    drawn = []
    for label, stiffness_n_m in (("soft", 2000.0), ("stiff", 9000.0)):
        grasped = [grasp_of(Watched(stiffness_n_m * factor)).trace for factor in (0.95, 1.05)]
        for k in range(25):
            trace, factor = grasped[k % 2], rng.uniform(0.95, 1.05)
            forces = {side: factor * getattr(trace, side) for side in ("force_left_n", "force_right_n")}
            drawn.append((label, evolve(trace, **forces)))
    return drawn


@pytest.fixture(scope="module")
def trials(traces):
    return trials_of(traces, CHECKPOINTS)


def trials_of(traces, checkpoints):
    """Return the trials of these traces, each of an instance of its own, with their features at these checkpoints."""
    features = CheckpointFeatures(curve(), checkpoints)
    return Labelled(
        source="grasps of a model gripper",
        table=table_of([features.extract(trace) for _, trace in traces]),
        labels=tuple(label for label, _ in traces),
        instances=tuple(f"{label}#{k}" for k, (label, _) in enumerate(traces)),
    )


@pytest.fixture(scope="module")
def model(trials):
    *parts, whole = split_checkpoints(trials, CHECKPOINTS)
    of_whole = model_of(whole.labelled, "c45")
    return evolve(of_whole, checkpoints=checkpoint_models(of_whole, C45, parts, 0))


def watcher(model, *, stops=False):
    return Anytime(model, curve(), resolve("default"), stops=stops)


def test_the_features_of_a_checkpoint_are_those_of_the_trace_up_to_it(traces, trials):
    part = split_checkpoints(trials, CHECKPOINTS)[1]
    assert part.after_s == 0.05
    for k, (_, trace) in enumerate(traces):
        cut = trace.until(contact_of(trace) + 0.05)
        assert cut.phase.max() < Phase.RELEASE
        assert np.array_equal(part.labelled.table.values[k], curve().extract(cut).values, equal_nan=True)
        assert part.used_s[k] == pytest.approx(0.05, abs=0.0011)
    assert part.labelled.table.names == split_checkpoints(trials, CHECKPOINTS)[-1].labelled.table.names


def test_predictions_in_the_loop_are_those_of_the_same_part_afterwards(model, tmp_path):
    write_model(tmp_path / "kept.json", model)
    loaded = load_model(str(tmp_path / "kept.json"), installed())
    assert [after_s for after_s, _ in loaded.checkpoints] == list(CHECKPOINTS)
    anytime = watcher(loaded)
    grasp = grasp_of(Watched(2000.0), watcher=anytime)
    anytime.end()

    assert grasp.outcome == Outcome.STEADY
    assert [prediction.after_s for prediction in anytime.predictions] == list(CHECKPOINTS)
    contact = contact_of(grasp.trace)
    for (after_s, part), made in zip(model.checkpoints, anytime.predictions, strict=True):
        features = curve().extract(grasp.trace.until(contact + after_s))
        assert made.features.values == pytest.approx(features.values, nan_ok=True, rel=1e-12)
        assert made.prediction.label == part.predict(features).label
        assert made.t_s == pytest.approx(contact + after_s, abs=0.0011)
    told = told_by_model(grasp)
    assert told == [prediction.words for prediction in anytime.predictions]
    assert re.match("0.05 s .*: soft", told[-1])
    assert "0.05 s after" in anytime.predictions[-1].prediction.model


def test_a_checkpoint_in_the_hold_is_predicted_then(model):
    trace = grasp_of(Watched(2000.0)).trace
    held_s = trace.t_s[trace.phase == Phase.HOLD]
    after_s = float(np.median(held_s)) - contact_of(trace)
    anytime = watcher(evolve(model, checkpoints=((after_s, model.checkpoints[0][1]),)))
    grasp_of(Watched(2000.0), watcher=anytime)
    (made,) = anytime.predictions
    assert held_s[0] < made.t_s < held_s[-1]


@every_case(
    ("labels", "certainty", "said"),
    [
        (("soft", "stiff", "hard"), {}, "soft or stiff or hard (right in 90 % of grasps)"),
        (("soft", "stiff", "hard", "empty"), {}, "soft or one of 3 others (right in 90 % of grasps)"),
        # Which answers are sure depends on luck, too: of few trials, the interval says how much.
        (("soft",), {"calibrated": True, "certainty_interval": (0.75, 0.98)}, "soft, 92 % (75 to 98 %)"),
    ],
)
def test_an_answer_is_one_line_with_its_set_or_its_certainty(labels, certainty, said):
    prediction = Prediction(
        label="soft",
        probabilities={"soft": 0.92, "stiff": 0.08},
        because=(),
        prediction_set=labels,
        coverage=0.9,
        **certainty,
    )
    features = Features(names=(), values=(), units=())
    made = CheckpointPrediction(after_s=0.2, t_s=1.0, features=features, prediction=prediction)
    assert made.words == f"0.2 s after the contact: {said}"
    assert made.sure == (labels == ("soft",))


@pytest.mark.parametrize("clock", ["virtual", "device"])
def test_a_sure_prediction_ends_the_squeeze_and_the_release_is_the_usual_one(model, clock):
    anytime = watcher(model, stops=True)

    def until_predicted():
        if anytime._running is not None:
            anytime._running.result()

    gripper = Watched(9000.0, clock, until_predicted)
    grasp = grasp_of(gripper, watcher=anytime)
    anytime.end()

    assert grasp.outcome == Outcome.RECOGNISED
    assert f"after the contact: stiff, {anytime.predictions[-1].prediction.certainty_figure}" in grasp.reason
    assert anytime.predictions[-1].prediction.prediction_set == ("stiff",)
    stopped_s = anytime.predictions[-1].t_s
    assert stopped_s - contact_of(grasp.trace) < 0.06
    phases = [Phase(p) for p in dict.fromkeys(grasp.trace.phase.tolist())]
    assert [phase for phase in phases if phase != Phase.HOLD] == [
        Phase.APPROACH,
        Phase.SQUEEZE,
        Phase.RELEASE,
    ]
    # The tick after the decision opens; from there on nothing closes, and the fingers end open and relaxed.
    after = grasp.trace.t_s > stopped_s
    assert (grasp.trace.phase[after] == Phase.RELEASE).all()
    assert (grasp.trace.command[after] > 0.0).all(), "a positive velocity opens"
    command, gap_m = gripper.commanded[-1]
    assert command.value == 0.0
    assert gap_m > 0.077
    assert gripper.closed == 1


def test_a_prediction_that_takes_long_makes_no_tick_wait_and_the_next_checkpoint_is_skipped(model):
    """The first prediction ends only when the gripper is closed."""
    done = threading.Event()

    def late(features, settings, device):
        if device is not None:  # not while it is prepared
            assert done.wait(30.0)
        return model.predict(features, settings, device)

    slow = evolve(model, checkpoints=((0.02, Stub(late)), (0.05, Stub(late))))
    anytime = watcher(slow, stops=True)
    grasp = grasp_of(Watched(2000.0, "device", ended=done.set), watcher=anytime)
    anytime.end()

    assert grasp.outcome == Outcome.STEADY
    skipped = "0.05 s after the contact: no prediction, since the last one is still being made"
    assert told_by_model(grasp) == [skipped]


def test_a_prediction_that_fails_does_not_end_the_grasp(model):
    def failing(features, settings, device):
        raise ZeroDivisionError("no weights")

    anytime = watcher(evolve(model, checkpoints=((0.02, Stub(failing)),)), stops=True)
    grasp = grasp_of(Watched(2000.0), watcher=anytime)
    assert grasp.outcome == Outcome.STEADY
    (told,) = told_by_model(grasp)
    assert "0.02 s after" in told


def test_only_a_model_with_checkpoints_and_sets_can_stop_a_squeeze(model):
    settings = resolve("default", options=("run.stop_when_sure=true",))
    late = evolve(model, checkpoints=())
    unsure = tuple((after_s, evolve(part, sets=None)) for after_s, part in model.checkpoints)
    for given, says in (
        (late, r"has no checkpoints.*train .*--checkpoints"),
        (None, r"run\.stop_when_sure.*classifier\.model"),
        (evolve(model, checkpoints=unsure), r"run.stop_when_sure: model 'm'"),
    ):
        with pytest.raises(ConfigError, match=says):
            anytime_of(given, curve(), settings)
    assert anytime_of(late, curve(), resolve("default")) is None


def test_a_checkpoint_of_a_model_of_other_objects_is_refused(model, trials, tmp_path):
    others = evolve(trials, labels=tuple({"soft": "egg", "stiff": "toy"}[label] for label in trials.labels))
    part, *_, whole = split_checkpoints(others, CHECKPOINTS)
    mixed = evolve(model, checkpoints=checkpoint_models(model_of(whole.labelled, "c45"), C45, [part], 0))
    write_model(tmp_path / "mixed.json", mixed)
    with pytest.raises(DataDamaged, match="egg, toy"):
        load_model(str(tmp_path / "mixed.json"), installed())


@every_case("text", ["", "soon", "0", "-0.1", "0.2,0.1", "0.1,0.1", "nan", "inf"])
def test_checkpoints_that_are_no_times(text):
    with pytest.raises(ConfigError, match=r"as in 0.1,0.2,0.4"):
        checkpoints_of(text)


def test_trials_without_traces_or_of_short_grasps_have_no_checkpoints(traces, trials):
    plain = split_checkpoints(trials, CHECKPOINTS)[-1].labelled
    with pytest.raises(ConfigError, match=r"model gripper .*checkpoints_s"):
        split_checkpoints(plain, CHECKPOINTS)
    with pytest.raises(ConfigError, match=r"0 of 50 .* 60 s"):
        split_checkpoints(trials_of(traces, (60.0,)), (60.0,))


def test_recognition_against_seconds_and_newtons(trials):
    """The later the answer, the more it costs; a sure squeeze costs no more than a whole one."""
    recognition = early_recognition(C45, split_checkpoints(trials, CHECKPOINTS))
    rows = {row.name: row for row in recognition.rows}
    assert list(rows) == ["0.02 s", "0.05 s", WHOLE, SURE]
    assert recognition.protocol == "instance_held_out"
    earliest, halfway, whole, sure = rows.values()
    assert earliest.seconds < halfway.seconds < whole.seconds
    assert earliest.newtons < halfway.newtons < whole.newtons
    assert whole.rate.correct >= 18, "the stiffness tells them apart"
    # Every grasp that is ended early saves what is between its checkpoint and its end.
    early = sure.single.correct
    assert early > 0
    assert earliest.seconds <= sure.seconds < whole.seconds
    assert sure.newtons < whole.newtons
    assert sure.covered.n == early


def test_trials_without_enough_instances_have_rates_but_no_sets(trials):
    few = trials.rows(np.array([0, 1, 2, 25, 26, 27]))
    recognition = early_recognition(C45, split_checkpoints(few, CHECKPOINTS), folds=3)
    assert [row.name for row in recognition.rows] == ["0.02 s", "0.05 s", WHOLE]
    assert "90 % needs 9" in recognition.reason
    assert all(row.covered is None for row in recognition.rows)
