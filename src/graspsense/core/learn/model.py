"""A trained model: a fitted classifier, its predictions, and a description of its training data."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from attrs import evolve, frozen

from graspsense.core.components.entries import TABLE_OF_ROLE
from graspsense.core.components.setting import CHANGES_NO_RESULT, NAMES_INPUT, settings_marked, worded
from graspsense.core.learn.answers import Answers, answers_of
from graspsense.core.learn.certainty import LABEL_UNITS, Certainty
from graspsense.core.learn.conformal import PredictionSets
from graspsense.core.learn.novelty import Novelty
from graspsense.core.values.errors import ConfigError, DataDamaged
from graspsense.core.values.features import (
    LARGEST_VALUE,
    UNKNOWN,
    Features,
    FeatureTable,
    Prediction,
    misfit,
    table_of,
)
from graspsense.core.values.json_values import json_ready
from graspsense.core.values.reasons import Reason

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from graspsense.core.components.roles import Classifier
    from graspsense.core.settings.resolved import Settings
    from graspsense.core.values.device import DeviceInfo


EQUAL: Final = 1e-6
"""Probabilities that differ by less differ by rounding."""

COMPARED_TABLES: Final = ("gripper", "controller", "features", "classifier")
"""The tables of settings in which a trial must agree with the training for the certainty to hold."""


@frozen(kw_only=True, eq=False)
class Model:
    """A fitted classifier with its features, the range of its training data, and their provenance.

    `component` is the qualified name of the classifier, `settings` the config that it was fitted with, `target` the
    part of a label that it predicts. `provenance` is empty if nothing is known about the trials.
    """

    name: str
    component: str
    settings: Mapping[str, Any]
    classifier: Classifier[Any]
    names: tuple[str, ...]
    units: tuple[str, ...]
    target: str
    novelty: Novelty
    provenance: Mapping[str, Any]
    sets: PredictionSets | None = None
    """Calibrated prediction sets; None in a model that was never calibrated."""
    certainty: Certainty | None = None
    """How often its answers are right, by their support; None in a model that is not calibrated."""
    learned_from: tuple[str, ...] = ()
    """The hashes (`learn.copies`) of the recorded trials that it was trained on."""
    checkpoints: tuple[tuple[float, Model], ...] = ()
    """The models for grasps that go on: each with the seconds after the contact up to which it knows them."""

    @property
    def simulated(self) -> bool:
        """Whether it was trained on simulated grasps."""
        return bool(self.provenance.get("simulated", False))

    @property
    def holds_for(self) -> str:
        """For which grasps alone its certainty holds, as far as is known; empty if it holds for all of its labels."""
        if self.certainty is None or self.sets is None:
            return ""
        lacking = ["objects"] * (self.sets.unit != "instances")
        lacking += ["sessions"] * (self.sets.unit != "sessions" and not self.simulated)
        return f"the same {' and '.join(lacking)}" if lacking else ""

    @property
    def in_a_line(self) -> str:
        """The classifier and its training data, in one line."""
        kind = "simulated grasps" if self.simulated else f"trials of {self.provenance.get('source', '?')}"
        if self.provenance.get("recorded_too"):
            kind = "simulated and recorded grasps"
        settings = self.provenance.get("settings", {}).get("controller") or {}
        grasp_settings = [
            worded(key, settings[key])[1]
            for key in ("probing_force_n", "closing_speed_m_s")
            if key in settings
        ]
        number = self.provenance.get("trials", "?")
        return (
            f"{self.name}: {self.component} trained on {number} {kind}"
            + (f" at {', '.join(grasp_settings)}" if grasp_settings else "")
            + (f", {self.after_s:g} s after the contact" if self.after_s is not None else "")
        )

    @property
    def after_s(self) -> float | None:
        """The time after the contact up to which it knows a grasp; None for whole grasps."""
        after_s = self.provenance.get("after_contact_s")
        return None if after_s is None else float(after_s)

    def predict(
        self,
        features: Features,
        settings: Settings | None = None,
        device: DeviceInfo | None = None,
        provenance: Mapping[str, Any] | None = None,
    ) -> Prediction:
        """Return the prediction for one trial, with warnings about its validity.

        `settings` and `device` are those of the grasp, if there was one, `provenance` what a source says of its trials.
        A trial under other settings than those of the training has no certainty and no set. One that lacks a feature of
        the model, or has it in another unit, is unknown, with that as the reason. Raises DataDamaged if the classifier
        gives no probabilities.
        """
        differences = tuple(differences_from(self.provenance, settings, device, provenance))
        warnings = (*self._kind_warnings(differences), *differences)
        probabilities: Mapping[str, float] = {}
        because: tuple[Reason | str, ...]
        misfit = self.misfit(features)
        if misfit:
            because = (misfit,)
        else:
            table = table_of([features]).columns(self.names)
            chosen, bounded = table.row(0), _bounded(table)
            explained = self.classifier.explain(bounded.row(0))
            classes = self.classifier.classes()
            shares = np.array([[explained.probabilities.get(name, 0.0) for name in classes]])
            with self._usable():
                refuse_improbable(shares, 1, len(classes))
            warnings = (*explained.warnings, *warnings)
            strange = self.novelty.unlike(chosen)
            columns = np.array([classes.index(explained.label)])
            answers = answers_of(self.novelty, table, classes, shares, columns, self.support(bounded))
            (prediction,) = self._calibrated(table, answers, bool(differences))
            if strange is None:
                return evolve(
                    prediction,
                    because=explained.because,
                    support=explained.support,
                    warnings=warnings,
                    model=self.in_a_line,
                    holds_for=self.holds_for,
                )
            probabilities = prediction.probabilities
            because = (strange,)
            if not all(math.isnan(value) for value in chosen.values):
                because = (strange, f"of the known labels, the nearest is {explained.label}")
        return Prediction(
            label=UNKNOWN,
            probabilities=probabilities,
            because=because,
            warnings=warnings,
            model=self.in_a_line,
        )

    def predictions(
        self, table: FeatureTable, provenance: Mapping[str, Any] | None = None
    ) -> list[Prediction]:
        """Return the predictions of many trials in one call, without reasons. Raises what `answers` raises."""
        differences = tuple(differences_from(self.provenance, provenance=provenance))
        warnings = (*self._kind_warnings(differences), *differences)
        made = self._calibrated(table.columns(self.names), self.answers(table), bool(differences))
        return [
            evolve(prediction, warnings=warnings, model=self.in_a_line, holds_for=self.holds_for)
            for prediction in made
        ]

    def _calibrated(self, table: FeatureTable, answers: Answers, elsewhere: bool) -> list[Prediction]:
        """Return predictions with certainty and sets, without reasons; those of unknown trials have no set.

        With `elsewhere`, the trials are not of the kind that the model was measured on, and nothing is calibrated; nor
        is a trial for which that does not hold.
        """
        classes, columns, shares = answers.classes, answers.columns, answers.probabilities
        unlike = answers.unlike
        known = ~unlike
        no_certainty = "it was not measured under these settings" if elsewhere else self.no_certainty
        unmeasured = self.novelty.unmeasured(
            table, math.inf if self.certainty is None else self.certainty.reach
        )
        probabilities, members = shares, np.zeros(shares.shape, dtype=np.bool_)
        intervals: list[tuple[float, float] | None] = [None] * len(table)
        if self.certainty is not None and not no_certainty:
            measured = np.array([not why for why in unmeasured])
            known &= measured
            calibrated = self.certainty.probabilities(answers)
            probabilities = np.where(measured[:, np.newaxis], calibrated, shares)
            # No answer counts as less certain than chance, however seldom such answers were right.
            own = calibrated[np.arange(len(table)), columns].tolist()
            intervals = [
                None if math.isnan(low) else (min(low, sure), max(high, sure))
                for (low, _, high), sure in zip(self.certainty.bounds(answers).tolist(), own, strict=True)
            ]
            if self.sets is not None and self.sets.thresholds:
                members[known] = self.sets.members(answers.rows(known), self.certainty)
        made = []
        for i, nearest in enumerate(answers.predicted):
            order = sorted(np.flatnonzero(members[i]), key=lambda k: (k != columns[i], -answers.scores[i, k]))
            without = no_certainty or unmeasured[i] or self._why_uncertain(nearest)
            made.append(
                Prediction(
                    label=UNKNOWN if unlike[i] else nearest,
                    probabilities=dict(zip(classes, probabilities[i].tolist(), strict=True)),
                    because=(),
                    prediction_set=tuple(classes[k] for k in order),
                    coverage=self.sets.coverage if self.sets is not None and order else None,
                    calibrated=not without,
                    certainty_interval=None if without else intervals[i],
                    no_certainty=without,
                )
            )
        return made

    def _why_uncertain(self, label: str) -> str:
        """Return why the certainty of answers with this label is not known; empty if it is."""
        if self.certainty is None or self.certainty.of_label is None or label in self.certainty.of_label:
            return ""
        unit = "trials" if self.sets is None else self.sets.unit
        return f"fewer than {LABEL_UNITS} held-out {unit} were called {label}: it needs more {unit}"

    def answers(self, table: FeatureTable) -> Answers:
        """Return the answers for the trials of a table, which are not calibrated.

        Their classes are in the order of the classifier. Raises ConfigError if the table does not have the features of
        the model, DataDamaged if the classifier gives no probabilities.
        """
        misfit = self.misfit(table)
        if misfit:
            raise ConfigError(misfit)
        chosen, classes = table.columns(self.names), self.classifier.classes()
        shares = self.classifier.probabilities(_bounded(chosen))
        with self._usable():
            refuse_improbable(shares, len(table), len(classes))
        # Probabilities that differ by rounding count as equal: the first of them is the answer.
        best = np.argmax(shares >= shares.max(axis=1, keepdims=True) - EQUAL, axis=1)
        return answers_of(self.novelty, chosen, classes, shares, best, self.support(_bounded(chosen)))

    @property
    def no_certainty(self) -> str:
        """Why its predictions have no certainty; empty if they have one."""
        if self.certainty is not None:
            return ""
        reason = self.sets.reason if self.sets is not None else "it was not measured"
        return f"the model is not calibrated ({reason})"

    def misfit(self, given: Features | FeatureTable) -> str:
        """Return why the model cannot be applied to these features; empty if it can."""
        return misfit(f"model {self.name!r}", self.names, self.units, given)

    def support(self, table: FeatureTable) -> NDArray[np.float64]:
        """Return the number of training trials behind each answer, NaN where there is none. Raises DataDamaged."""
        support = self.classifier.support(table)
        with self._usable():
            refuse_unsupported(support, len(table))
        return np.full(len(table), np.nan) if support is None else support

    @contextmanager
    def _usable(self) -> Iterator[None]:
        """Raise DataDamaged, which names the model, for a ValueError in this context."""
        try:
            yield
        except ValueError as error:
            raise DataDamaged(
                f"model {self.name!r} cannot be used: {error}. Train it again, with the defaults of {self.component}"
            ) from error

    def _kind_warnings(self, differences: Sequence[str]) -> Iterator[str]:
        """Yield what holds for all predictions of this model, unless a difference says more."""
        if self.holds_for and not differences:
            drift = ", and less once the forces have drifted" if self.holds_for.endswith("sessions") else ""
            yield (
                f"certainty and sets are for the trained labels and {self.holds_for}, since the training held out no "
                f"others: of these it knows less{drift}"
            )
        if self.sets is not None and self.sets.uncalibrated and not differences:
            names = ", ".join(self.sets.uncalibrated)
            yield f"in every set, because too few {self.sets.unit} calibrate it: {names}"
        if self.simulated and not any(
            difference.startswith("trained on simulated grasps, but") for difference in differences
        ):
            yield "trained on simulated grasps: valid for its labels in the simulator, untested on real objects"


def differences_from(
    trained_with: Mapping[str, Any],
    settings: Settings | None = None,
    device: DeviceInfo | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> Iterator[str]:
    """Yield, in words, how trials differ from those of the training, whose provenance is `trained_with`.

    Its certainty does not hold for them. The other arguments are those of `Model.predict`.
    """
    simulated = bool(trained_with.get("simulated", False))
    real = device is not None and device.clock == "device" and not device.simulated
    if simulated and real:
        yield (
            "trained on simulated grasps, but this gripper is real: expect wrong answers until a model is "
            "trained on grasps of its own"
        )
    elif simulated and provenance is not None and provenance.get("simulated") is False:
        yield "trained on simulated grasps, but these trials are real: expect wrong answers"
    recipes = int((provenance or {}).get("recipes", 1))
    if recipes > 1 and trained_with.get("recipes", 1) == 1:
        yield f"these trials were recorded with {recipes} different settings of gripper, controller or features"
    trained = dict(trained_with.get("settings", {}))
    kind = "simulated grasps" if simulated else "grasps"
    told: dict[str, None] = {}
    for table, now, ignored in _compared(settings, device, provenance):
        then = trained.get(table)
        if then is None:
            continue
        if then.get("type") != now.get("type"):
            told[
                f"trained on {kind} with {table} {then.get('type')}, this one was with {now.get('type')}"
            ] = None
            continue
        for key in sorted((then.keys() & now.keys()) - ignored):
            if json_ready(then[key]) != json_ready(now[key]):
                what, value = worded(key, then[key])
                other = worded(key, now[key])[1]
                told[f"trained on {kind} with {what} {value}, this one was with {other} ({table}.{key})"] = (
                    None
                )
    yield from told


def checkpoint_model(whole: Model, after_s: float, part: Model) -> Model:
    """Return the model of the checkpoint `after_s` (s), as a part of that of whole grasps."""
    own = {key: part.provenance[key] for key in ("trials", "by_label")}
    return evolve(
        part,
        name=whole.name,
        provenance={**whole.provenance, **own, "after_contact_s": after_s},
        checkpoints=(),
    )


def refuse_improbable(shares: Any, trials: int, classes: int) -> None:
    """Raise ValueError unless these are probabilities: shape (trials, classes), and each row sums to 1."""
    wanted = (trials, classes)
    if not isinstance(shares, np.ndarray) or shares.shape != wanted or shares.dtype != np.float64:
        raise ValueError(f"its probabilities are {_kind(shares)}, not float64 of shape {wanted}")
    if not ((shares >= 0.0).all() and (np.abs(shares.sum(axis=1) - 1.0) <= EQUAL).all()):
        raise ValueError("its probabilities are not finite, are below 0, or do not sum to 1 in each row")


def refuse_unsupported(support: Any, trials: int) -> None:
    """Raise ValueError unless this is the support of the answers: None, or numbers of 0 and more, shape (trials,)."""
    if support is None:
        return
    if not isinstance(support, np.ndarray) or support.shape != (trials,) or support.dtype != np.float64:
        raise ValueError(f"its support is {_kind(support)}, not float64 of shape {(trials,)}")
    if (support < 0.0).any():
        raise ValueError("its support has a number below 0")


def _kind(values: Any) -> str:
    array = isinstance(values, np.ndarray)
    return f"{values.dtype} of shape {values.shape}" if array else f"a value of type {type(values).__name__}"


def _compared(
    settings: Settings | None, device: DeviceInfo | None, provenance: Mapping[str, Any] | None
) -> Iterator[tuple[str, Mapping[str, Any], frozenset[str]]]:
    """Yield the tables of settings of a trial, with the keys that may differ between training and use.

    Of a recording, the gripper that made it counts, and the controller that did, besides the one that follows it now.
    """
    given = (provenance or {}).get("settings") or {} if settings is None else settings.values
    recorded_with = {} if device is None else device.recorded_with
    for table in COMPARED_TABLES:
        followed = {} if table == "gripper" and table in recorded_with else given
        for keys in (recorded_with.get(table), followed.get(table)):
            if keys is None:
                continue
            config_class = _config_class(table, keys.get("type"))
            unchanging = settings_marked(config_class, CHANGES_NO_RESULT)
            yield table, keys, unchanging | settings_marked(config_class, NAMES_INPUT) | {"type"}


def _config_class(table: str, name: Any) -> type:
    """Return the config class of an installed component; `object`, which has no settings, if there is none."""
    from graspsense.core.components.registry import installed

    role = next(role for role, known_table in TABLE_OF_ROLE.items() if known_table == table)
    try:
        return installed().find(role, str(name)).config_class()
    except ConfigError:
        return object


def _bounded(table: FeatureTable) -> FeatureTable:
    """Return the features for a classifier: one that is too large to compute with is as large as can be."""
    return evolve(table, values=np.clip(table.values, -LARGEST_VALUE, LARGEST_VALUE))
