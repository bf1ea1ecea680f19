"""A trained model of a number, in one JSON file without code.

The file holds the training trials, the name of the estimator and the seed, and the estimator is fitted again when it is
loaded: nothing is imported, evaluated or unpickled. Its `sha256` is the hash of the other content.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from attrs import frozen

from graspsense.core.learn.labelled import Labelled
from graspsense.core.learn.model import differences_from
from graspsense.core.learn.model_content import (
    REGRESSION_FORMAT,
    digest,
    model_bytes,
    parsed,
    sealed_content,
    write_json_lines,
)
from graspsense.core.learn.novelty import Novelty, novelty_of
from graspsense.core.learn.stored_values import LARGEST_SEED, StoredValues
from graspsense.core.learn.target_value import TargetValue
from graspsense.core.learn.training import training_provenance
from graspsense.core.values.errors import ConfigError, DataDamaged, counted
from graspsense.core.values.features import FeatureTable, misfit
from graspsense.core.values.json_values import json_ready
from graspsense.evaluation.folds import held_out, splits
from graspsense.regression.estimators import ESTIMATORS, FittedRegression, target_of
from graspsense.regression.evaluate import held_out_predictions
from graspsense.regression.intervals import PredictionIntervals, intervals_from, intervals_of

VERSION: Final = 2
FOLDS: Final = 10


@frozen(kw_only=True)
class PredictedValue:
    """A predicted number with its interval, of which both ends are None where nothing was measured that holds for it.

    `no_interval` then says why. `unlike` says why the trial is unlike all training trials; empty if it is like them.
    """

    value: float
    low: float | None
    high: float | None
    no_interval: str = ""
    unlike: str = ""


@frozen(kw_only=True, eq=False)
class RegressionModel:
    """A fitted estimator with its training trials, and the prediction intervals that held-out trials calibrate."""

    name: str
    estimator: str
    fitted: FittedRegression
    table: FeatureTable
    target: TargetValue
    seed: int
    novelty: Novelty
    intervals: PredictionIntervals
    made_with: str
    provenance: Mapping[str, Any]

    @property
    def in_a_line(self) -> str:
        """The estimator and its training data, in one line."""
        unit = f" [{self.target.unit}]" if self.target.unit else ""
        return (
            f"{self.name}: {self.estimator} predicts {self.target.name}{unit}, trained on "
            f"{counted(len(self.table), 'trial')} of {self.provenance.get('source', '?')}"
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """A warning if another version of scikit-learn fitted the estimator."""
        if self.made_with == _sklearn():
            return ()
        return (f"this model was made with {self.made_with} and made again with {_sklearn()}: it may differ",)

    def differences(self, provenance: Mapping[str, Any] | None) -> tuple[str, ...]:
        """Return, in words, how trials with this provenance differ from those of the training."""
        return tuple(differences_from(self.provenance, provenance=provenance))

    def predict(
        self, table: FeatureTable, provenance: Mapping[str, Any] | None = None
    ) -> list[PredictedValue]:
        """Return the prediction of each trial. Raises ConfigError if a feature is missing, or has another unit.

        Trials under other settings than those of the training have no interval; `provenance` says how they were made.
        """
        if why := misfit(f"model {self.name!r}", self.table.names, self.table.units, table):
            raise ConfigError(why)
        chosen = table.columns(self.table.names)
        values = self.fitted.predict(chosen.values)
        halves = self.intervals.half_width(values)
        unmeasured = self.novelty.unmeasured(chosen, self.intervals.reach)
        elsewhere = "it was not measured under these settings" if self.differences(provenance) else ""
        made = []
        for i, (value, half) in enumerate(zip(values.tolist(), halves.tolist(), strict=True)):
            unlike = str(getattr(self.novelty.unlike(chosen.row(i)), "words", ""))
            why = self.intervals.reason or unlike or elsewhere or unmeasured[i]
            made.append(
                PredictedValue(
                    value=value,
                    low=None if why else value - half,
                    high=None if why else value + half,
                    no_interval=why,
                    unlike=unlike,
                )
            )
        return made

    def as_json(self) -> dict[str, Any]:
        """Return the content of the file of the model."""
        content = {
            "format": REGRESSION_FORMAT,
            "version": VERSION,
            "estimator": self.estimator,
            "target_value": [self.target.name, self.target.unit],
            "features": list(zip(self.table.names, self.table.units, strict=True)),
            "provenance": json_ready(self.provenance),
            "interval": self.intervals.to_json(),
            "made_with": self.made_with,
            "seed": self.seed,
            "values": list(self.target.values),
            "trials": json_ready(self.table.values.tolist()),
        }
        return {**content, "sha256": digest(content)}


def train_regression(
    estimator: str,
    labelled: Labelled,
    *,
    name: str,
    seed: int = 0,
    provenance: Mapping[str, Any] | None = None,
) -> RegressionModel:
    """Return an estimator that is fitted to these trials, with a prediction interval from held-out instances.

    Raises ConfigError if nothing can be learned from them.
    """
    target = target_of(labelled)
    values = np.array(target.values)
    try:
        several = labelled.instances if len(set(labelled.instances or ())) > 1 else None
        folds = held_out([""] * len(values), several, FOLDS, seed)
        predicted = held_out_predictions(estimator, labelled.table.values, values, folds, seed)
        outside = np.empty(len(values))
        for test, others in splits(folds):
            outside[test] = _novelty(labelled.table.rows(others)).outside(labelled.table.rows(test))
        intervals = intervals_of(predicted, predicted - values, labelled.instances, outside)
    except ConfigError as error:
        intervals = PredictionIntervals(reason=str(error))
    return RegressionModel(
        name=name,
        estimator=estimator,
        fitted=FittedRegression(estimator, labelled.table.values, values, seed),
        table=labelled.table,
        target=target,
        seed=seed,
        novelty=_novelty(labelled.table),
        intervals=intervals,
        made_with=_sklearn(),
        provenance={**training_provenance(labelled, seed, {}), **(provenance or {})},
    )


def write_regression(path: Path, model: RegressionModel) -> None:
    """Write the file of a model atomically. Raises OSError."""
    write_json_lines(path, model.as_json())


def is_regression(name: str) -> bool:
    """Return whether this file is a model of a number."""
    try:
        content = parsed(name, model_bytes(name)) if name.endswith(".json") else None
    except (ConfigError, DataDamaged):
        return False
    return isinstance(content, dict) and content.get("format") == REGRESSION_FORMAT


def load_regression(name: str) -> RegressionModel:
    """Return the model in a file. Raises ConfigError if it cannot be read, DataDamaged if it is not such a model."""
    content = sealed_content(
        name, parsed(name, model_bytes(name)), REGRESSION_FORMAT, (VERSION,), "model of a number"
    )
    try:
        return _restored(Path(name).stem, StoredValues(content))
    except ValueError as error:
        raise DataDamaged(f"model {name!r} is damaged: {error}") from error


def _restored(name: str, stored: StoredValues) -> RegressionModel:
    """Return the model with these values. Raises ValueError, which names the field that is wrong."""
    names, units = stored.features("features")
    values = stored.numbers("values", (None,))
    trials = stored.numbers("trials", (len(values), len(names)), missing=True)
    table = FeatureTable(names=names, units=units, values=trials)
    estimator, seed = stored.choice("estimator", tuple(ESTIMATORS)), stored.whole("seed", most=LARGEST_SEED)
    target = stored.texts("target_value")
    if len(target) != 2:
        raise stored.refusal("target_value", "expected a name and a unit")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # The training told of them.
        fitted = FittedRegression(estimator, trials, values, seed)
    return RegressionModel(
        name=name,
        estimator=estimator,
        fitted=fitted,
        table=table,
        target=TargetValue(name=target[0], unit=target[1], values=tuple(values.tolist())),
        seed=seed,
        novelty=_novelty(table),
        intervals=intervals_from(stored.table("interval")),
        made_with=stored.text("made_with"),
        provenance=stored.table("provenance").as_dict(),
    )


def _novelty(table: FeatureTable) -> Novelty:
    """Return the range of all training trials: they are of one kind."""
    return novelty_of(table, ["the training trials"] * len(table))


def _sklearn() -> str:
    import sklearn

    return f"scikit-learn {sklearn.__version__}"
