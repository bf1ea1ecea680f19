"""Labels that cannot be told from how their trials were recorded have no certainty; others do."""

import numpy as np
from attrs import evolve
from cases import every_case
from test_conformal import model_of
from test_groups import by_object, table_of, things

from graspsense.core.learn.confounding import confounded
from graspsense.sources.trial_source import load_trials

SPEEDS = np.array([10.0, 25.0, 15.0])


def drifting(numbers, slope, rng):
    """Grasps of these kinds, while the zero of every feature moves by so many standard deviations."""
    time = np.linspace(0.0, slope, len(numbers))[:, np.newaxis]
    values = things(numbers, rng) + time * [1.0, -1.0, 1.0, 1.0]
    return table_of(numbers, values, order=tuple(range(len(numbers))))


def test_a_setting_that_comes_with_the_label_leaves_no_certainty_as_a_feature_and_beside_the_features():
    rng = np.random.default_rng(1)
    numbers = rng.permutation(np.repeat(np.arange(3), 20))
    values = things(numbers, rng)
    tied, free = SPEEDS[numbers], rng.choice(SPEEDS, len(numbers))
    for speeds, is_tied in ((tied, True), (free, False), (np.where(np.arange(60) == 7, 99.0, tied), False)):
        as_feature = table_of(numbers, np.column_stack([values, speeds]))
        beside = table_of(numbers, values, recorded_with={"speed": tuple(map(str, speeds))})
        for trials in (as_feature, beside, beside.rows(np.arange(50))):
            made = model_of(trials, "tree").predictions(trials.table)
            assert all((prediction.certainty is None) == is_tied for prediction in made)
            assert all(("the same" in prediction.no_certainty) == is_tied for prediction in made)
            assert not is_tied or not any(prediction.prediction_set for prediction in made)
    assert not confounded(evolve(as_feature, labels=tuple(map(str, tied)), provenance={"simulated": True}))


@every_case(
    ("session", "instance", "known"), [("monday", None, True), (None, None, False), (None, "session", False)]
)
def test_a_column_of_sessions_that_each_have_one_label_leaves_no_certainty(
    tmp_path, session, instance, known
):
    rng = np.random.default_rng(2)
    numbers = rng.permutation(np.repeat(np.arange(2), 15))
    names = [f"day {k}" if session else f"day {row % 5}" for row, k in enumerate(numbers)]
    lines = [
        f"{k},{name},{a:.4f},{b:.4f}"
        for k, name, (a, b, *_) in zip(numbers, names, things(numbers, rng), strict=True)
    ]
    (tmp_path / "t.csv").write_text("\n".join(["label,session,stiffness,width", *lines]) + "\n")
    trials = load_trials(str(tmp_path / "t.csv"), label="label", instance=instance)
    assert bool(confounded(trials)) == known
    assert trials.sessions == (instance is not None)


def test_labels_in_one_stretch_each_and_features_that_drift_leave_no_certainty():
    told = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        stretches = np.repeat(np.arange(3), 50)
        named = tuple(f"bottle {k // 5}" for k in range(150))
        turns, drift, steady = (
            drifting(rng.permutation(stretches), 4.0, rng),
            drifting(stretches, 4.0, rng),
            drifting(stretches, 0.0, rng),
        )
        swept = drifting(rng.permutation(stretches), 0.0, rng)
        swept.table.values[:, 0] = np.repeat(SPEEDS, 50)
        # Several objects of each label show what a mounting of the gripper for each of them changes.
        trials = (turns, drift, steady, evolve(drift, instances=named), evolve(steady, instances=named))
        # A single object of each is a name for the label.
        single = evolve(steady, instances=tuple(map(str, stretches)))
        told.append([bool(confounded(t)) for t in (*trials, single, swept, evolve(swept, no_certainty="?"))])
    assert told == [[True, True, True, True, False, True, False, True]] * 20


@every_case(
    ("order", "in_turns"),
    [
        ([(0, 15), (1, 15)], False),
        ([(0, 15), (1, 15), (0, 1)], False),  # one grasp more of the first label at the end
        ([(0, 1), (1, 15), (0, 14)], False),
        ([(0, 15), (1, 15), (2, 15), (0, 15)], False),  # only one label was repeated
        ([(0, 8), (1, 8), (0, 8), (1, 8)], True),
        ([(0, 40), (1, 1), (0, 60)], True),  # nothing tells of a label with one trial
    ],
)
def test_a_few_grasps_apart_from_the_stretch_of_their_label_are_no_turns(order, in_turns):
    numbers = np.concatenate([np.repeat(kind, n) for kind, n in order])
    assert bool(confounded(drifting(numbers, 0.0, np.random.default_rng(0)))) != in_turns


def test_objects_that_were_grasped_one_after_the_other_are_no_drift():
    for seed in range(20):
        numbers, values = by_object(np.random.default_rng(seed), objects=8)
        named = tuple(f"bottle {k // 5}" for k in range(len(numbers)))
        assert not confounded(table_of(numbers, values, order=tuple(range(len(numbers))), instances=named))
