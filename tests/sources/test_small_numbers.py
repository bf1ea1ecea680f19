"""Numbers are small in SI units: every classifier tells apart what it tells apart in a smaller unit."""

import numpy as np
import pytest

from graspsense.core.learn.labelled import Labelled
from graspsense.core.settings.selected import select_component
from graspsense.core.values.features import FeatureTable
from graspsense.evaluation.evaluate import evaluate
from graspsense.sources.trial_table.features_csv import read_labelled


def measured(factor, base=0.0):
    rng = np.random.default_rng(2)
    values = np.array([[rng.normal((6.0, 11.0)[i % 2], 0.6)] for i in range(40)]) * factor + base
    table = FeatureTable(names=("compliance",), units=("m/N",), values=values)
    return Labelled(source="made here", table=table, labels=("stiff", "soft") * 20)


@pytest.mark.parametrize(
    ("classifier", "base", "options"),
    [
        *((name, 0.0, {}) for name in ("c45", "tree", "knn", "svm")),
        ("forest", 0.0, {"trees": 10}),
        ("c45", 1.0, {}),  # a small share of itself
        pytest.param("ebm", 0.0, {}, marks=pytest.mark.slow),
    ],
)
def test_a_classifier_recognises_what_differs_by_less_than_micrometres(classifier, base, options):
    learner = select_component("classifier", classifier, **options)
    quick = {"folds": 4, "controls": False, "learning_curve": False}
    measurement = evaluate(learner, measured(1e-12 if base else 1e-200, base), classifier=classifier, **quick)
    assert measurement.headline.rate >= 0.9 > 0.1 > measurement.unknown.rate


def test_a_column_that_differs_by_rounding_alone_is_no_feature(tmp_path):
    path = tmp_path / "t.csv"
    lines = [f"{'ab'[k % 2]},{1.0 + 2.0**-52 * (k * 7 % 5)!r},{k * 7 % 11}" for k in range(40)]
    path.write_text("\n".join(["what,k [m],force", *lines]))
    assert read_labelled(path, "what").table.names == ("force",)
