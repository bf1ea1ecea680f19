"""The common part of the classifiers of scikit-learn, which is imported when one is fitted or loaded.

Features are filled and brought to mean 0 and standard deviation 1 over the training trials (`core.learn.scaling`),
unless the classifier says otherwise. A model is kept as its training trials, settings and seed, and made again from
them when it is loaded, or as the fitted estimator itself through skops: nothing is unpickled, and with the same version
of scikit-learn it is the same model.
"""

from __future__ import annotations

import math
import warnings
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Final, Literal, TypeVar

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.classifier_api import (
    LARGEST_SEED,
    FeatureValue,
    Reason,
    Scaling,
    contribution_reasons,
    feature_values,
    in_words,
    json_ready,
    mean_and_deviation,
    missing_feature,
    one_thread,
    scaling_of,
)
from graspsense.plugin_api import (
    Classifier,
    ClassifierConfig,
    Features,
    FeatureTable,
    Prediction,
    StoredValues,
    setting,
)
from graspsense.plugins.classifiers.shapley import shapley_values

MOST_STEPS: Final = 3e9
"""The most elementary steps of a training, each about 10 ns. A model that is kept as trials is trained when read."""

ScikitConfigT = TypeVar("ScikitConfigT", bound=ClassifierConfig)


@frozen(kw_only=True)
class KeptConfig(ClassifierConfig):
    """Settings of classifiers whose model can be stored in two ways."""

    kept_as: Literal["trials", "skops"] = setting(
        default="trials",
        meaning="What a model file holds: the training trials, or the fitted estimator (needs the extra skops).",
    )


@frozen(kw_only=True, eq=False)
class FittedEstimator:
    """A fitted estimator, its training data, and the preprocessing of a trial."""

    estimator: Any
    table: FeatureTable
    labels: tuple[str, ...]
    seed: int
    scaling: Scaling


@frozen(kw_only=True, eq=False)
class ExplainedTrial:
    """A trial whose answer is explained.

    `row` is the preprocessed trial, of shape (1, features), `given` its features before that; `shares` are its
    probabilities, the most probable label first.
    """

    fitted: FittedEstimator
    row: NDArray[np.float64]
    given: Sequence[FeatureValue]
    shares: Mapping[str, float]

    @property
    def label(self) -> str:
        """The most probable label."""
        return next(iter(self.shares))

    def contributions(
        self,
        parts: Sequence[float],
        start: float,
        scale: Literal["probability", "log-odds"] = "probability",
        against: str = "",
    ) -> tuple[Reason, ...]:
        """Return as reasons what each feature contributes to the label, beside what holds before any feature."""
        each = [((feature,), value) for feature, value in zip(self.given, parts, strict=True)]
        return contribution_reasons(each, start, scale=scale, label=self.label, against=against)

    def most_likely(self, what: str) -> Reason:
        """Return the labels of the three largest shares; `what` says what the shares are.

        The shares themselves say nothing of how often such an answer is right.
        """
        return Reason(words=f"{what}, the largest first: {', '.join(list(self.shares)[:3])}")


class ScikitClassifier(Classifier[ScikitConfigT]):
    """A classifier of scikit-learn, which subclasses specify."""

    shares_are: ClassVar[str] = ""
    """What the probabilities are, for the reasons of an answer."""
    _fitted: FittedEstimator | None = None
    _made_with = ""

    @abstractmethod
    def estimator(self, seed: int, trials: int) -> Any:
        """Return the unfitted estimator for this number of training trials."""

    def training_steps(self, trials: int, features: int, labels: int) -> float:
        """Return about how many elementary steps of 10 ns a training takes; 0 where settings cannot make it long."""
        return 0.0

    def reasons(self, trial: ExplainedTrial) -> Sequence[Reason]:
        """Return the reasons for the most probable label: contributions of the features, largest labels."""
        return (*self.shapley_reasons(trial), trial.most_likely(self.shares_are))

    def shapley_reasons(self, trial: ExplainedTrial) -> tuple[Reason, ...]:
        """Return the contributions of the features to the probability of the label, as Shapley values."""
        column, medians = self.classes().index(trial.label), np.full(len(trial.given), np.nan)
        start, parts = shapley_values(
            lambda rows: self.shares(trial.fitted, rows)[:, column],
            trial.row[0],
            trial.fitted.scaling.ready(medians),
        )
        return trial.contributions(parts, start)

    def counted(self, fitted: FittedEstimator, row: NDArray[np.float64]) -> tuple[float, float] | None:
        """Return the training trials that the largest probability was counted from: with the label, and in all.

        None where the probabilities are not a share of training trials.
        """
        return None

    def shares(self, fitted: FittedEstimator, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the probabilities of preprocessed trials, in the order of the classes of the estimator."""
        return np.asarray(fitted.estimator.predict_proba(rows), dtype=np.float64)

    def origin_and_scale(
        self, values: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the value of each feature that becomes 0, and the difference that becomes 1."""
        return mean_and_deviation(values)

    def fit(self, table: FeatureTable, labels: Sequence[str], seed: int) -> None:
        """Fill missing values, scale, and fit.

        Raises ValueError for fewer than two labels, and for settings with which the training would not end soon.
        """

        if len(set(labels)) < 2:
            raise ValueError(f"all {len(labels)} trials have one label: there is nothing to tell apart")
        steps = self.training_steps(len(labels), len(table.names), len(set(labels)))
        if steps > MOST_STEPS:
            raise ValueError(
                f"with these settings a training on {len(labels)} trials takes {steps:.1g} steps, of at most "
                f"{MOST_STEPS:.1g} (about half a minute): choose smaller ones (see graspsense config classifier)"
            )
        fitted = FittedEstimator(
            estimator=self.estimator(seed, len(labels)),
            table=table,
            labels=tuple(labels),
            seed=seed,
            scaling=scaling_of(table.values, self.origin_and_scale),
        )
        # A training that diverges is told by what it gives, and not by warnings of numpy.
        with one_thread(), np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            fitted.estimator.fit(fitted.scaling.ready(table.values), np.array(labels))
        self._fitted = fitted

    def classes(self) -> tuple[str, ...]:
        """Return the labels in the order of the columns of `probabilities`."""
        return tuple(str(label) for label in self._model().estimator.classes_)

    def probabilities(self, table: FeatureTable) -> NDArray[np.float64]:
        """Return the probabilities, shape (trials, classes)."""
        fitted = self._model()
        return self.shares(fitted, fitted.scaling.ready(table.columns(fitted.table.names).values))

    def explain(self, features: Features) -> Prediction:
        """Return the prediction with its reasons, and the values that replaced missing features."""
        fitted = self._model()
        values = [features[name] for name in fitted.table.names]
        row = fitted.scaling.ready(np.array([values]))
        probabilities = self.shares(fitted, row)[0].tolist()
        shares = dict(zip(self.classes(), probabilities, strict=True))
        ranked = dict(sorted(shares.items(), key=lambda item: -item[1]))
        given = feature_values(fitted.table.names, fitted.table.units, values)
        trial = ExplainedTrial(fitted=fitted, row=row, given=given, shares=ranked)
        filled = [
            missing_feature(
                feature.name,
                feature.unit,
                f" ({features.reasons.get(feature.name, 'no reason given')}): the median in training, "
                f"{in_words(float(fill), feature.unit)}, stands for it",
            )
            for feature, fill in zip(given, fitted.scaling.fill, strict=True)
            if feature.value is None
        ]
        return Prediction(
            label=self.classes()[int(np.argmax(probabilities))],
            probabilities=shares,
            because=(*filled, *self.reasons(trial)),
            warnings=self._version_warnings(),
            support=self.counted(fitted, row),
        )

    def to_json(self) -> dict[str, Any]:
        """Return the training trials with the seed, or the estimator, from which the model can be restored."""
        import sklearn

        fitted = self._model()
        kept: dict[str, Any] = {
            "made_with": self._made_with or f"scikit-learn {sklearn.__version__}",
            "seed": fitted.seed,
            "features": list(zip(fitted.table.names, fitted.table.units, strict=True)),
        }
        if getattr(self.config, "kept_as", "trials") != "trials":
            scaling = fitted.scaling
            return {
                **kept,
                "fill": scaling.fill.tolist(),
                "mean": scaling.origin.tolist(),
                "scale": [None if math.isinf(scale) else scale for scale in scaling.scale.tolist()],
                **self.estimator_as_json(fitted.estimator),
            }
        return {
            **kept,
            "labels": list(fitted.labels),
            "trials": json_ready(fitted.table.values.tolist()),
        }

    def estimator_as_json(self, estimator: Any) -> dict[str, Any]:
        """Return the fitted estimator itself, as the setting `kept_as` asks for it."""
        from graspsense.plugins.classifiers.skops_text import as_text

        return {"skops": as_text(estimator)}

    def from_json(self, model: Mapping[str, Any]) -> None:
        """Restore the model. Raises DataDamaged or ValueError."""
        from sklearn.exceptions import ConvergenceWarning

        stored = StoredValues(model)
        names, units = stored.features("features")
        self._made_with = stored.text("made_with")
        if "skops" in stored:
            self._fitted = self._from_skops(stored, names, units)
            return
        labels = stored.texts("labels")
        values = stored.numbers("trials", (len(labels), len(names)), missing=True)
        with warnings.catch_warnings():
            # The training told of a network that has not converged.
            warnings.simplefilter("ignore", ConvergenceWarning)
            self.fit(
                FeatureTable(names=names, units=units, values=values),
                labels,
                stored.whole("seed", most=LARGEST_SEED),
            )

    def _from_skops(
        self, stored: StoredValues, names: tuple[str, ...], units: tuple[str, ...]
    ) -> FittedEstimator:
        from graspsense.plugins.classifiers.skops_text import from_text

        seed = stored.whole("seed", most=LARGEST_SEED)
        try:
            estimator = from_text(stored.text("skops"), self.estimator(seed, 2), len(names))
        except ValueError as error:
            raise stored.refusal("skops", str(error)) from error
        return restored(stored, names, units, estimator)

    def _model(self) -> FittedEstimator:
        if self._fitted is None:
            raise ValueError("the classifier is neither fitted nor loaded yet")
        return self._fitted

    def _version_warnings(self) -> tuple[str, ...]:
        import sklearn

        here = f"scikit-learn {sklearn.__version__}"
        if self._made_with in ("", here):
            return ()
        return (
            f"this model was made with {self._made_with} and made again, or read, with {here}: it may differ",
        )


def restored(
    stored: StoredValues, names: tuple[str, ...], units: tuple[str, ...], estimator: Any
) -> FittedEstimator:
    """Return an estimator that was stored with its preprocessing, without training trials. Raises DataDamaged."""
    fill, mean = (stored.numbers(name, (len(names),)) for name in ("fill", "mean"))
    scale = stored.numbers("scale", (len(names),), missing=True)
    if (scale <= 0.0).any():
        raise stored.refusal("scale", "a feature has the scale 0, or a negative one")
    return FittedEstimator(
        estimator=estimator,
        table=FeatureTable(names=names, units=units, values=np.empty((0, len(names)))),
        labels=(),
        seed=stored.whole("seed", most=LARGEST_SEED),
        # A feature that was constant in training has none.
        scaling=Scaling(fill=fill, origin=mean, scale=np.where(np.isnan(scale), np.inf, scale)),
    )
