"""Conformance checks of a classifier."""

from __future__ import annotations

import json
import math
import random
from collections.abc import Sequence
from contextlib import suppress
from typing import Any, Final

import numpy as np
from attrs import evolve
from numpy.typing import NDArray

from graspsense.core.components.roles import ClassifierConfig
from graspsense.core.learn.model import refuse_improbable, refuse_unsupported
from graspsense.core.values.errors import DataDamaged
from graspsense.core.values.features import FeatureTable, Prediction
from graspsense.core.values.reasons import TreeNode
from graspsense.testing.checks import CheckFailed, demand, leaving_no_thread, raises_nothing
from graspsense.testing.component import RUNS_CODE, config_name, watched
from graspsense.testing.damage import damaged_at, paths
from graspsense.testing.samples import sample_table
from graspsense.testing.subject import Subject, elsewhere

SEED: Final = 11
LEAST_RIGHT: Final = 0.9
LEAST_RIGHT_OF_SOME: Final = 0.7
"""The same where one value in seven is missing, and of many labels with few trials each."""
MANY: Final = 12
"""Labels that are not in the order of their numbers when they are sorted as text."""
FAR: Final = 1e6
MOST_PLACES: Final = 40
"""Number of values of a model that are changed, chosen at random."""
DAMAGES_EACH: Final = 4
REFUSALS: Final = (KeyError, TypeError, ValueError, DataDamaged)
"""What `from_json` raises for values that are no model."""


OTHER_LABELS: Final = {
    "bottle:full_open": "7",
    "bottle:empty_open": "07",
    "can:full": " Große Dose, halb voll (zweite Messung)",
}
"""Labels of another text for those of `sample_table`, as a user's table may have."""
COMPLIANCE: Final = 1e-6
"""Factor from the forces of `sample_table` to the compliances (m/N) of objects as stiff as a full can."""


def _fitted(subject: Subject, table: FeatureTable, labels: Sequence[str]) -> Any:
    classifier = subject.create()
    trials = f" on {len(labels)} trials of {len(set(labels))} labels"
    with raises_nothing("fit", f"{trials}: learn from them; a NaN in the table is missing"):
        classifier.fit(table, labels, SEED)
    return classifier


def _learned(subject: Subject) -> tuple[Any, FeatureTable, list[str]]:
    table, labels = sample_table()
    return _fitted(subject, table, labels), table, labels


def _json(fitted: Any) -> Any:
    model = fitted.to_json()
    advice = ": give lists, dicts, text, numbers, true, false, None; a NaN as None"
    with raises_nothing("to_json gives what JSON cannot hold: it", advice):
        return json.loads(json.dumps(model, allow_nan=False))


def _again(subject: Subject, fitted: Any) -> Any:
    other = subject.create()
    other.from_json(_json(fitted))
    return other


def a_classifier_has_a_model_key(subject: Subject) -> None:
    """The config of a classifier extends ClassifierConfig, which holds the key `model`."""
    cls = subject.component.config_class()
    demand(
        issubclass(cls, ClassifierConfig),
        f"{config_name(subject)} has no key 'model': let it extend graspsense.plugin_api.ClassifierConfig",
    )


def classes_are_the_labels(subject: Subject) -> None:
    """`classes` returns the labels of the training trials, each once, as text, whatever text they are."""
    table, sampled = sample_table()
    for labels in (sampled, [OTHER_LABELS[label] for label in sampled]):
        classes = _again(subject, _fitted(subject, table, labels)).classes()
        demand(
            isinstance(classes, tuple) and all(type(name) is str for name in classes),
            f"classes gives {classes!r}: return a tuple of str (convert text of numpy by str(...))",
        )
        _demand_classes(classes, labels, "keep labels as they are, which can be any text")


def _demand_classes(classes: Sequence[str], labels: Sequence[str], advice: str) -> None:
    """Raise CheckFailed unless the classes are the labels of the training."""
    demand(
        sorted(classes) == sorted(set(labels)),
        f"classes gives {', '.join(classes)}; it was trained on {', '.join(sorted(set(labels)))}: {advice}",
    )


def probabilities_are_valid(subject: Subject) -> None:
    """`probabilities` has a row for each trial and a column for each class, from 0 to 1; each row sums to 1.

    This holds for trials far from those of the training, too.
    """
    fitted, table, _ = _learned(subject)
    _shares(fitted, table)
    far = evolve(table, values=FAR * table.values)
    _shares(fitted, far, f"of numbers {FAR:g} times as large as in training, ")


def _shares(fitted: Any, table: FeatureTable, trained: str = "", advice: str = "") -> NDArray[Any]:
    """Return the probabilities. Raises CheckFailed unless they and the support are such that graspsense takes them."""
    advice = (
        advice
        or "give a row for each trial and a column for each of `classes`, and divide each row by its sum"
    )
    with raises_nothing(f"{trained}probabilities or support", f": {advice}"):
        shares, support = fitted.probabilities(table), fitted.support(table)
    try:
        refuse_improbable(shares, len(table), len(fitted.classes()))
        refuse_unsupported(support, len(table))
    except ValueError as error:
        cause = "its probabilities are of another shape" if np.shape(shares)[:1] != (len(table),) else ""
        raise CheckFailed(f"{trained}{error}: {advice}", cause) from error
    given: NDArray[Any] = shares
    return given


def separates_separable_trials(subject: Subject) -> None:
    """Most separable training trials are predicted right, of two or many labels, by large or small numbers."""
    table, labels = sample_table()
    small = FeatureTable(names=("compliance",), units=("m/N",), values=COMPLIANCE * table.values[:, 2:3])
    two = np.array([i for i, label in enumerate(labels) if label.startswith("bottle")])
    for trials, given, least, advice in (
        (table, labels, LEAST_RIGHT, "is the order of `classes` that of the columns?"),
        (table.rows(two), [labels[i] for i in two], LEAST_RIGHT, "give both of two labels their own column"),
        (
            *_many(),
            LEAST_RIGHT_OF_SOME,
            "learn from all features, with their signs, and give each label its column",
        ),
        (
            small,
            labels,
            LEAST_RIGHT,
            "compare numbers with the spread of their column, not with a number of your own",
        ),
        (sample_table(missing=True)[0], labels, LEAST_RIGHT_OF_SOME, "learn from the values that are there"),
    ):
        fitted = _fitted(subject, trials, given)
        classes = fitted.classes()
        said = [classes[int(i)] for i in np.argmax(_shares(fitted, trials), axis=1)]
        right = sum(a == b for a, b in zip(said, given, strict=True)) / len(given)
        demand(
            right >= least,
            f"{100 * right:.0f} % of {len(given)} training trials of {len(classes)} labels are right, by "
            f"{', '.join(trials.names)}: {advice}",
        )


def _many() -> tuple[FeatureTable, list[str]]:
    """Return trials of a dozen labels, each with a feature of its own that is positive, where the others are not."""
    labels = [str(1 + i % MANY) for i in range(6 * MANY)]
    sign = 2.0 * (np.array(labels)[:, np.newaxis] == np.arange(1, 1 + MANY).astype(str)) - 1.0
    values = sign * np.random.default_rng(SEED).uniform(0.3, 0.5, sign.shape)
    return FeatureTable(
        names=tuple(f"speed_{i}" for i in range(MANY)), units=("m/s",) * MANY, values=values
    ), labels


def same_seed_same_model(subject: Subject) -> None:
    """The same trials and seed give the same model, bit for bit, whatever it was fitted to before."""
    fitted, table, labels = _learned(subject)
    again = _fitted(subject, *sample_table(30, missing=True))
    shares, model = fitted.probabilities(table), _json(fitted)
    with leaving_no_thread("it is fitted"):
        again.fit(table, labels, SEED)
    demand(
        model == _json(again) and bool((shares == again.probabilities(table)).all()),
        "two models of one seed differ: draw everything from the seed that fit is given, keep nothing of what it was "
        "fitted to before, and nothing in the class, which others share",
    )


def same_model_elsewhere(subject: Subject) -> None:
    """Another interpreter learns the same, at another time of the day and with its sets in another order."""
    fitted, table, _ = _learned(subject)
    there = json.loads(elsewhere(subject, _learned_after_others))
    demand(
        there["classes"] == list(fitted.classes())
        and bool(np.allclose(there["probabilities"], fitted.probabilities(table), rtol=1e-6, atol=1e-9)),
        "in another interpreter, with another time zone and order of sets, it learns another model: read no clock, "
        "sort what comes out of a set, and keep no state in the class or the module",
    )


def _learned_after_others(subject: Subject) -> str:
    _fitted(subject, *sample_table(30, missing=True))
    fitted, table, _ = _learned(subject)
    return json.dumps(
        {"classes": list(fitted.classes()), "probabilities": fitted.probabilities(table).tolist()}
    )


def survives_json(subject: Subject) -> None:
    """A model read from its JSON gives the same probabilities, bit for bit, and reasons, and runs nothing in it."""
    fitted, table, _ = _learned(subject)
    _again(subject, fitted)  # which may import what it needs
    with watched(RUNS_CODE) as seen:
        again = _again(subject, fitted)
    demand(
        not seen,
        f"from_json makes the interpreter {', '.join(dict.fromkeys(seen))}, and a model file comes from anywhere: "
        "store numbers and text, and read them by graspsense.plugin_api.StoredValues",
    )
    demand(
        again.classes() == fitted.classes()
        and bool((again.probabilities(table) == fitted.probabilities(table)).all()),
        "read back from its JSON it gives other probabilities: keep every number in full (float, not text of it)",
    )
    row = table.row(0)
    demand(
        repr(again.explain(row)) == repr(fitted.explain(row)),
        "read back from its JSON it gives other reasons: store what they depend on",
    )


def single_trials_agree(subject: Subject) -> None:
    """Trials predicted one by one have the same probabilities and support as all at once."""
    fitted, table, _ = _learned(subject)
    rows = [table.rows(np.array([i])) for i in range(len(table))]
    for what, answer in (("probabilities", fitted.probabilities), ("support", fitted.support)):
        whole, single = answer(table), [answer(row) for row in rows]
        demand(
            whole is None
            or bool(np.allclose(whole, np.concatenate(single), rtol=1e-9, atol=1e-12, equal_nan=True)),
            f"single trials have other {what} than all at once: predict each trial independently",
        )


def finds_features_by_their_names(subject: Subject) -> None:
    """Trials whose features are in another order have the same probabilities."""
    fitted, table, _ = _learned(subject)
    whole, turned = _shares(fitted, table), _shares(fitted, table.columns(table.names[::-1]))
    demand(
        bool(np.allclose(whole, turned, rtol=1e-9, atol=1e-12)),
        "with the features in another order it gives other probabilities: keep the names that it was fitted to, and "
        "take the features by them (`table.columns(names)`)",
    )


def handles_missing_values(subject: Subject) -> None:
    """It handles NaN in training and prediction, a feature without values or with one alone, a trial without values."""
    table, labels = sample_table(missing=True)
    bare, constant = table.values.copy(), table.values.copy()
    bare[:, 1], constant[:, 1] = math.nan, 0.05
    lacking = np.where(np.array([label == labels[0] for label in labels])[:, np.newaxis], bare, table.values)
    for what, values in (
        ("some values missing", table.values),
        ("a whole feature missing", bare),
        ("a feature that is the same in all trials", constant),
        ("a feature missing in all trials of a label", lacking),
    ):
        fitted = _fitted(subject, evolve(table, values=values), labels)
        _demand_classes(fitted.classes(), labels, f"with {what}, learn from the values that are there")
        nothing = evolve(table, values=np.full((1, len(table.names)), math.nan))
        for asked in (table, nothing):
            _shares(fitted, asked, f"with {what} in training, ", "fill or skip missing values")
        fitted.explain(nothing.row(0))


def _fitted_or_refused(subject: Subject, what: str, table: FeatureTable, labels: Sequence[str]) -> Any:
    """Return a classifier that was fitted to these trials; None if it refuses them by a ValueError that says why."""
    classifier = subject.create()
    with raises_nothing(f"fit on {what}", ": raise ValueError, or learn from them"):
        try:
            classifier.fit(table, labels, SEED)
        except ValueError as error:
            demand(
                bool(str(error)), f"fit on {what} raised ValueError without a message: say what is lacking"
            )
            return None
    return classifier


def few_trials_are_refused_or_learned(subject: Subject) -> None:
    """With few training trials, of all labels or one, `fit` raises ValueError, or the model knows every label."""
    table, labels = sample_table()
    few = {
        "two trials of two labels": [0, 1],
        "one trial of each label": [0, 1, 2],
        "two trials of one label and one of another": [0, 1, 3],
        "two trials of each label": [0, 1, 2, 3, 4, 5],
    }
    cases = [(what, table.rows(np.array(rows)), [labels[i] for i in rows]) for what, rows in few.items()]
    for i in range(
        0, len(labels), 15
    ):  # a model that leaves trials out, anywhere, lacks the label of one of these
        cases.append(("one trial of a label", table, [*labels[:i], "rare", *labels[i + 1 :]]))
    cases.append(("one label", table, ["can:full"] * len(labels)))
    for what, trials, given in cases:
        classifier = _fitted_or_refused(subject, what, trials, given)
        if classifier is None:
            continue
        shares = _shares(classifier, table, f"trained on {what}, ", "raise ValueError in fit, or answer")
        demand(
            what != "one label" or bool((shares == 1.0).all()),
            f"trained on one label it gives it the probability {shares.min():g}: refuse it, or give 1",
        )
        _demand_classes(classifier.classes(), given, "raise ValueError in fit, or learn from every trial")


def explains_its_predictions(subject: Subject) -> None:
    """`explain` returns the most probable class, with floats as probabilities and reasons in words."""
    fitted, table, _ = _learned(subject)
    for i in range(6):
        said = fitted.explain(table.row(i))
        demand(
            isinstance(said, Prediction),
            f"explain returned {said!r}: return graspsense.plugin_api.Prediction",
        )
        shares = dict(zip(fitted.classes(), _shares(fitted, table)[i].tolist(), strict=True))
        demand(
            said.label in shares and shares[said.label] >= max(shares.values()) - 1e-9,
            f"explain says {said.label!r} where the probabilities are {shares}: say the most probable label",
        )
        for label in sorted({*shares, *said.probabilities}):
            share = said.probabilities.get(label, "none")
            demand(
                type(share) is float and abs(share - shares.get(label, math.nan)) <= 1e-9,
                f"explain gives {label!r} the probability {share!r} of type {type(share).__name__}; "
                f"probabilities gives {shares.get(label)}: give each label of `classes` the same, as float(...)",
            )
        demand(
            len(said.because) > 0 and all(reason.words for reason in said.because),
            f"explain gives the reasons {said.because!r}: give each reason in words and units",
        )
    nodes = fitted.tree() or ()
    for i, node in enumerate(nodes):
        demand(
            isinstance(node, TreeNode) and (node.parent is None if i == 0 else node.parent in range(i)),
            f"node {i} of tree() is {node!r}: return TreeNode objects, the root first and each parent before its "
            "children; or None for what is no tree",
        )


def does_not_change_the_table(subject: Subject) -> None:
    """Neither fit nor probabilities changes the table, nor fit the labels."""
    table, labels = sample_table(missing=True)
    original, named = table.values.copy(), labels.copy()
    fitted = _fitted(subject, table, labels)
    fitted.probabilities(table)
    demand(
        bool(np.array_equal(original, table.values, equal_nan=True)) and labels == named,
        "fit or probabilities changed the table, or fit the labels: work on a copy (`table.values.copy()`)",
    )


def refuses_an_invalid_model(subject: Subject) -> None:
    """`from_json` raises KeyError, TypeError, ValueError or DataDamaged for values that are not its model."""
    good = _json(_learned(subject)[0])
    demand(isinstance(good, dict) and bool(good), f"to_json gives {good!r:.80}: a dict")
    largest = max(good, key=lambda key: len(json.dumps(good[key])))
    for model in ({}, {"nonsense": 1}, {key: value for key, value in good.items() if key != largest}):
        what = f"a model with the keys {', '.join(model) or 'none'}"
        with raises_nothing("from_json", f" on {what}: raise ValueError"):
            try:
                subject.create().from_json(model)
            except REFUSALS:
                continue
        raise CheckFailed(
            f"from_json takes {what}: look at what is given, and raise ValueError if it is no model"
        )


def a_damaged_model_raises_a_documented_error(subject: Subject) -> None:
    """`from_json` raises nothing but KeyError, TypeError, ValueError or DataDamaged on values that were changed."""
    good = _json(_learned(subject)[0])
    rng = random.Random(SEED)
    places = list(paths(good))
    for place in rng.sample(places, min(len(places), MOST_PLACES)):
        for damaged in rng.sample(list(damaged_at(good, place)), DAMAGES_EACH):
            if not isinstance(damaged, dict):
                continue
            advice = (
                f" on a model that was changed at {'.'.join(map(str, place))}: read it by "
                "graspsense.plugin_api.StoredValues, which checks types, ranges and sizes before anything is made of "
                "them"
            )
            with raises_nothing("from_json", advice), suppress(*REFUSALS):
                subject.create().from_json(damaged)
