"""Explainable boosting: an additive model of single features and of pairs (the extra `ebm`).

The log-odds of a label are a sum of functions of one feature, and of functions of two. Each function is a table of
scores over intervals of the feature, which interpret fits by boosting (Y. Lou, R. Caruana, J. Gehrke and G. Hooker, KDD
2013). A model holds the bounds of the intervals and the scores. Prediction needs numpy only; interpret is imported for
training.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.classifier_api import contribution_reasons, feature_values, missing_feature
from graspsense.plugin_api import (
    Classifier,
    ClassifierConfig,
    Features,
    FeatureTable,
    PluginUnavailable,
    Prediction,
    StoredValues,
    setting,
)

HINT: Final = (
    'training an ebm needs interpret-core.\n  in a clone: pip install -e ".[ebm]"     published: '
    'pip install "graspsense[ebm]"'
)

MOST_PAIRED: Final = 200
"""With more features no pairs are sought: their number grows with the square, and a fit would take minutes."""
MAX_ROUNDS: Final = 500
"""Largest number of steps of each function. Held-out trials end the boosting earlier, unless these are too few."""


@frozen(kw_only=True)
class EbmConfig(ClassifierConfig):
    """Settings of the boosting."""

    pairs: int = setting(
        default=10,
        minimum=0,
        plausible=(0, 1000),
        meaning=f"Largest number of pairs of features with a function; none with more than {MOST_PAIRED} features.",
    )
    bags: int = setting(
        default=8, minimum=1, plausible=(1, 1000), meaning="Number of fits, whose scores are averaged."
    )
    bins: int = setting(
        default=64, minimum=4, plausible=(4, 4096), meaning="Largest number of intervals of a feature."
    )
    pair_bins: int = setting(
        default=16,
        minimum=4,
        plausible=(4, 256),
        meaning="Largest number of intervals of a feature in a pair.",
    )
    learning_rate: float = setting(
        default=0.05, above=0.0, plausible=(0.001, 1.0), meaning="Factor of each boosting step."
    )
    min_leaf: int = setting(
        default=4, minimum=1, meaning="Smallest number of training trials on a side of a boosting step."
    )


def _pairs_of(config: EbmConfig, features: int) -> int:
    """Return how many pairs of so many features get a function."""
    return min(config.pairs, math.comb(features, 2)) if features <= MOST_PAIRED else 0


@frozen(eq=False)
class EbmTerm:
    """A function of one feature or of two: `scores` has a shape (intervals of each feature ..., labels).

    The first interval of a feature is that of a missing value; `cuts` are the bounds between the others, and a value
    on a bound belongs to the interval above it.
    """

    features: tuple[int, ...]
    cuts: tuple[NDArray[np.float64], ...]
    scores: NDArray[np.float64]

    def scores_of(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the scores of trials, shape (trials, labels)."""
        where = []
        for k, cuts in zip(self.features, self.cuts, strict=True):
            column = values[:, k]
            where.append(np.where(np.isnan(column), 0, np.searchsorted(cuts, column, side="right") + 1))
        scores: NDArray[np.float64] = self.scores[tuple(where)]
        return scores


@frozen(eq=False)
class AdditiveModel:
    """The fitted functions, and the log-odds of each label before any feature."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    labels: tuple[str, ...]
    start: NDArray[np.float64]
    terms: tuple[EbmTerm, ...]

    def log_odds(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the log-odds of each label up to a constant, shape (trials, labels)."""
        total = np.tile(self.start, (len(values), 1))
        for term in self.terms:
            total += term.scores_of(values)
        return total


class Ebm(Classifier[EbmConfig]):
    """An explainable boosting machine. A missing value has a score of its own."""

    _fitted: AdditiveModel | None = None

    def fit(self, table: FeatureTable, labels: Sequence[str], seed: int) -> None:
        """Fit the functions. Raises ValueError for fewer than two labels, PluginUnavailable without interpret."""

        if len(set(labels)) < 2:
            raise ValueError(f"all {len(labels)} trials have one label: there is nothing to tell apart")
        boosting = _interpret().ExplainableBoostingClassifier(
            feature_names=list(table.names),
            feature_types=["continuous"] * len(table.names),
            interactions=_pairs_of(self.config, len(table.names)),
            outer_bags=self.config.bags,
            max_bins=self.config.bins,
            max_interaction_bins=self.config.pair_bins,
            learning_rate=self.config.learning_rate,
            min_samples_leaf=self.config.min_leaf,
            max_rounds=MAX_ROUNDS,
            # Smoothing takes most of the time of a fit, and gained nothing on grasps.
            smoothing_rounds=0,
            interaction_smoothing_rounds=0,
            n_jobs=1,
            random_state=seed,
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about its own pictures, which are not used
            boosting.fit(table.values, np.array(labels))
        self._fitted = _model_of(boosting, table)

    def classes(self) -> tuple[str, ...]:
        """Return the labels in the order of the columns of `probabilities`."""
        return self._model().labels

    def probabilities(self, table: FeatureTable) -> NDArray[np.float64]:
        """Return the softmax of the log-odds, shape (trials, classes)."""
        from scipy.special import softmax

        model = self._model()
        return np.asarray(softmax(model.log_odds(table.columns(model.names).values), axis=1))

    def explain(self, features: Features) -> Prediction:
        """Return the prediction with the contributions to the odds against the next most probable label."""
        from scipy.special import softmax

        model = self._model()
        values = [features[name] for name in model.names]
        row = np.array([values])
        total = model.log_odds(row)[0]
        shares = dict(zip(model.labels, softmax(total).tolist(), strict=True))
        likeliest, runner_up = np.argsort(-total, kind="stable")[:2].tolist()
        given = feature_values(model.names, model.units, values)
        parts = []
        for term in model.terms:
            scores = term.scores_of(row)[0]
            parts.append(
                (tuple(given[k] for k in term.features), float(scores[likeliest] - scores[runner_up]))
            )
        missing = [
            missing_feature(
                feature.name, feature.unit, f": {features.reasons.get(feature.name, 'no reason given')}"
            )
            for feature in given
            if feature.value is None
        ]
        return Prediction(
            label=model.labels[likeliest],
            probabilities=shares,
            because=(
                *missing,
                *contribution_reasons(
                    parts,
                    float(model.start[likeliest] - model.start[runner_up]),
                    scale="log-odds",
                    label=model.labels[likeliest],
                    against=model.labels[runner_up],
                ),
            ),
        )

    def to_json(self) -> dict[str, Any]:
        """Return the bounds and the scores."""
        model = self._model()
        return {
            "features": list(zip(model.names, model.units, strict=True)),
            "labels": list(model.labels),
            "start": model.start.tolist(),
            "terms": [
                {
                    "features": list(term.features),
                    "cuts": [cuts.tolist() for cuts in term.cuts],
                    "scores": term.scores.tolist(),
                }
                for term in model.terms
            ],
        }

    def from_json(self, model: Mapping[str, Any]) -> None:
        """Restore the model. Raises DataDamaged."""
        stored = StoredValues(model)
        names, units = stored.features("features")
        labels = stored.texts("labels", distinct=True)
        if len(labels) < 2:
            raise stored.refusal("labels", "at least two are needed")
        start = stored.numbers("start", (len(labels),))
        terms = tuple(_term_from(term, len(names), len(labels)) for term in stored.tables("terms"))
        if len({term.features for term in terms}) < len(terms):
            raise stored.refusal("terms", "two of them are functions of the same features")
        self._fitted = AdditiveModel(names, units, labels, start, terms)

    def _model(self) -> AdditiveModel:
        if self._fitted is None:
            raise ValueError("the classifier is neither fitted nor loaded yet")
        return self._fitted


def _model_of(boosting: Any, table: FeatureTable) -> AdditiveModel:
    """Return the functions of a fitted machine of interpret.

    Its intervals of a feature are coarser in a pair than alone. It has one more interval than are needed here, the
    last, for names of categories that training did not have; and for two labels it has the scores of the second only.
    """

    def columns(scores: Any) -> NDArray[np.float64]:
        given = np.asarray(scores, dtype=np.float64)
        return given if len(boosting.classes_) > 2 else np.stack((np.zeros_like(given), given), axis=-1)

    terms = []
    for features, scores in zip(boosting.term_features_, boosting.term_scores_, strict=True):
        levels = [boosting.bins_[k] for k in features]
        cuts = tuple(
            np.asarray(level[min(len(features), len(level)) - 1], dtype=np.float64).copy() for level in levels
        )
        known = columns(scores)[(slice(-1),) * len(features)].copy()
        terms.append(EbmTerm(tuple(int(k) for k in features), cuts, known))
    start = columns(boosting.intercept_)
    return AdditiveModel(
        names=table.names,
        units=table.units,
        labels=tuple(str(label) for label in boosting.classes_),
        start=start.reshape(len(boosting.classes_)),
        terms=tuple(terms),
    )


def _term_from(kept: StoredValues, features: int, labels: int) -> EbmTerm:
    tested = tuple(kept.wholes("features"))
    if any(k >= features for k in tested):
        raise kept.refusal("features", f"it does not fit: the model has {features} features")
    if not 1 <= len(tested) <= 2 or len(set(tested)) < len(tested):
        raise kept.refusal("features", "expected one feature, or two different ones")
    given = kept.items("cuts")
    if len(given) != len(tested):
        raise kept.refusal(
            "cuts", f"it does not fit: {len(given)} lists of bounds for {len(tested)} features"
        )
    each = StoredValues({str(k): cuts for k, cuts in enumerate(given)}, kept.field("cuts"))
    cuts = tuple(each.numbers(key, (None,)) for key in each)
    if not all((np.diff(bounds) > 0).all() for bounds in cuts):
        raise kept.refusal("cuts", "they do not increase")
    scores = kept.numbers("scores", (*(len(bounds) + 2 for bounds in cuts), labels))
    return EbmTerm(tested, cuts, scores)


def _interpret() -> Any:
    try:
        import interpret.glassbox
    except ImportError as error:
        raise PluginUnavailable(HINT) from error
    return interpret.glassbox
