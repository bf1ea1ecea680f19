"""A trained model: a fitted classifier and a description of its training data, in one JSON file without code.

The file names its classifier, which must be an installed component. Nothing in the file is imported, evaluated or
unpickled. Its `sha256` is the hash of the other content, which detects a damaged file.
"""

from __future__ import annotations

import json
import math
import platform
import shlex
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from attrs import evolve, frozen

from graspsense import __version__
from graspsense.core.components.caller import set_option
from graspsense.core.components.entries import TABLE_OF_ROLE, ModelEntry
from graspsense.core.components.firstparty import MODELS
from graspsense.core.components.setting import CHANGES_NO_RESULT, NAMES_INPUT, UNIT_OF_ENDING, settings_marked
from graspsense.core.files.whole_file import write_whole
from graspsense.core.learn.certainty import Certainty, certainty_from, with_certainty
from graspsense.core.learn.conformal import COVERAGES, Answers, PredictionSets, scores_of, sets_from
from graspsense.core.learn.copies import row_hashes
from graspsense.core.learn.model_content import digest, model_bytes, parsed, sealed_content
from graspsense.core.learn.novelty import Novelty, novelty_from, novelty_of
from graspsense.core.learn.stored_values import StoredValueError, StoredValues
from graspsense.core.learn.temperature import RANGE as TEMPERATURES
from graspsense.core.learn.temperature import at_temperature
from graspsense.core.values.errors import (
    ConfigError,
    DataDamaged,
    PluginUnavailable,
    UnknownName,
    WiringError,
    listed,
    named,
)
from graspsense.core.values.features import (
    LARGEST_VALUE,
    UNKNOWN,
    Features,
    FeatureTable,
    Prediction,
    misfit,
    table_of,
)
from graspsense.core.values.json_values import json_ready, settings_from_json
from graspsense.core.values.reasons import Reason
from graspsense.core.values.units import display_unit, without_underscores

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from graspsense.core.components.config import Settings
    from graspsense.core.components.registry import Component, Plugins
    from graspsense.core.components.roles import Classifier
    from graspsense.core.learn.labelled import Labelled
    from graspsense.core.values.device import DeviceInfo

FORMAT: Final = "graspsense model"
REGRESSION_FORMAT: Final = "graspsense regression model"
"""The `format` of a model that predicts a number (`graspsense.regression`)."""
VERSION: Final = 2
_READ: Final = (1, VERSION)
"""The versions that are read. Sets of the first one do not hold for answers from few trials, and are left out."""
MODELS_KEPT: Final = 4
"""How many models of pipelines stay in memory."""

_EQUAL: Final = 1e-6

_COMPARED_TABLES: Final = ("gripper", "controller", "features", "classifier")


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
    temperature: float | None = None
    """The temperature (`learn.temperature`) of the probabilities of the labels that are not predicted."""
    learned_from: tuple[str, ...] = ()
    """The hashes (`learn.copies`) of the recorded trials that it was trained on."""
    checkpoints: tuple[tuple[float, Model], ...] = ()
    """The models for grasps that go on: each with the seconds after the contact up to which it knows them."""

    @property
    def simulated(self) -> bool:
        """Whether it was trained on simulated grasps."""
        return bool(self.provenance.get("simulated", False))

    @property
    def in_a_line(self) -> str:
        """The classifier and its training data, in one line."""
        kind = "simulated grasps" if self.simulated else f"trials of {self.provenance.get('source', '?')}"
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
        differences = tuple(self.differences(settings, device, provenance))
        warnings = (*self._kind_warnings(differences), *differences)
        probabilities: Mapping[str, float] = {}
        because: tuple[Reason | str, ...]
        misfit = self.misfit(features)
        if misfit:
            because = (misfit,)
        else:
            chosen = _chosen(features, self.names)
            bounded = _bounded(chosen)
            explained = self.classifier.explain(bounded)
            classes = self.classifier.classes()
            shares = np.array([[explained.probabilities.get(name, 0.0) for name in classes]])
            self._refuse_improbable(shares)
            warnings = (*explained.warnings, *warnings)
            strange = self.novelty.unlike(chosen)
            table = table_of([bounded])
            (prediction,) = self._calibrated(table, [explained.label], shares, bool(differences))
            if strange is None:
                return evolve(
                    prediction,
                    because=explained.because,
                    support=explained.support,
                    warnings=warnings,
                    model=self.in_a_line,
                )
            probabilities = prediction.probabilities
            because = (strange,)
            if not all(math.isnan(value) for value in chosen.values):
                because = (strange, f"of the known labels, the nearest is {prediction.label}")
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
        differences = tuple(self.differences(provenance=provenance))
        warnings = (*self._kind_warnings(differences), *differences)
        labels, shares = self.answers(table)
        made = self._calibrated(table.columns(self.names), labels, shares, bool(differences))
        return [evolve(prediction, warnings=warnings, model=self.in_a_line) for prediction in made]

    def _calibrated(
        self, table: FeatureTable, labels: Sequence[str], shares: NDArray[np.float64], elsewhere: bool
    ) -> list[Prediction]:
        """Return predictions with certainty and sets, without reasons; those of unknown trials have no set.

        `shares` are the probabilities that the classifier gives. With `elsewhere`, the trials are not of the kind that
        the model was measured on, and nothing is calibrated; nor is a trial that lacks what all training trials had.
        """
        classes = self.classifier.classes()
        known = np.array([label != UNKNOWN for label in labels])
        predicted = shares.argmax(axis=1)
        predicted[known] = [classes.index(label) for label in labels if label != UNKNOWN]
        no_certainty = "it was not measured under these settings" if elsewhere else self.no_certainty
        lacking = self.novelty.lacking(table)
        probabilities, members = shares, np.zeros(shares.shape, dtype=np.bool_)
        if self.certainty is not None and not no_certainty:
            support = self.classifier.support(table)
            if support is None:
                support = np.full(len(table), np.nan)
            certainty = self.certainty.rate(shares[np.arange(len(table)), predicted], support)
            measured = np.array([not names for names in lacking])
            known &= measured
            calibrated = with_certainty(at_temperature(shares, self.temperature), predicted, certainty)
            probabilities = np.where(measured[:, np.newaxis], calibrated, shares)
            if self.sets is not None and self.sets.thresholds:
                scores = scores_of(shares, self.novelty.closeness(table, classes))
                answers = Answers(
                    scores=scores,
                    predicted=predicted,
                    certainty=certainty,
                    support_class=self.certainty.class_of(support),
                )
                members[known] = self.sets.members(answers, classes)[known]
        made = []
        for i, label in enumerate(labels):
            order = sorted(np.flatnonzero(members[i]), key=lambda k: (k != predicted[i], -scores[i, k]))
            without = no_certainty or (lacking[i] and f"it was measured with trials that have {lacking[i]}")
            made.append(
                Prediction(
                    label=label,
                    probabilities=dict(zip(classes, probabilities[i].tolist(), strict=True)),
                    because=(),
                    prediction_set=tuple(classes[k] for k in order),
                    coverage=self.sets.coverage if self.sets is not None and order else None,
                    calibrated=not without,
                    no_certainty=without,
                )
            )
        return made

    def answers(self, table: FeatureTable) -> tuple[list[str], NDArray[np.float64]]:
        """Return the label of `predict` for each trial of a table, and the probabilities that the classifier gives.

        The probabilities are not calibrated. Their shape is (trials, classes), in the order of the classes of the
        classifier; unknown trials have probabilities too. Raises ConfigError if the table does not have the features of
        the model, DataDamaged if the classifier gives no probabilities.
        """
        misfit = self.misfit(table)
        if misfit:
            raise ConfigError(misfit)
        chosen = table.columns(self.names)
        bounded = evolve(chosen, values=np.clip(chosen.values, -LARGEST_VALUE, LARGEST_VALUE))
        shares = self.classifier.probabilities(bounded)
        self._refuse_improbable(shares)
        unlike = self.novelty.unlike_rows(chosen).tolist()
        classes = self.classifier.classes()
        # Probabilities that differ by rounding count as equal: the first of them is the answer.
        best = np.argmax(shares >= shares.max(axis=1, keepdims=True) - _EQUAL, axis=1).tolist()
        labels = [UNKNOWN if strange else classes[k] for strange, k in zip(unlike, best, strict=True)]
        return labels, shares

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

    def _refuse_improbable(self, shares: NDArray[np.float64]) -> None:
        try:
            refuse_improbable(shares, len(shares), len(self.classifier.classes()))
        except ValueError as error:
            raise DataDamaged(
                f"model {self.name!r} cannot be used: {error}. Train it again, with the defaults of {self.component}"
            ) from error

    def differences(
        self,
        settings: Settings | None = None,
        device: DeviceInfo | None = None,
        provenance: Mapping[str, Any] | None = None,
    ) -> Iterator[str]:
        """Yield, in words, how trials differ from those of the training, so that its certainty does not hold for them.

        The arguments are those of `predict`.
        """
        real = device is not None and device.clock == "device" and not device.simulated
        if self.simulated and real:
            yield (
                "trained on simulated grasps, but this gripper is real: expect wrong answers until a model is "
                "trained on grasps of its own"
            )
        elif self.simulated and provenance is not None and provenance.get("simulated") is False:
            yield "trained on simulated grasps, but these trials are real: expect wrong answers"
        recipes = int((provenance or {}).get("recipes", 1))
        if recipes > 1 and self.provenance.get("recipes", 1) == 1:
            yield f"these trials were recorded with {recipes} different settings of gripper, controller or features"
        trained = dict(self.provenance.get("settings", {}))
        kind = "simulated grasps" if self.simulated else "grasps"
        for table, now, ignored in _compared(settings, provenance):
            then = trained.get(table)
            if then is None:
                continue
            if then.get("type") != now.get("type"):
                yield f"trained on {kind} with {table} {then.get('type')}, this one was with {now.get('type')}"
                continue
            for key in sorted((then.keys() & now.keys()) - ignored):
                if json_ready(then[key]) != json_ready(now[key]):
                    what, value = worded(key, then[key])
                    yield (
                        f"trained on {kind} with {what} {value}, this one was with {worded(key, now[key])[1]} "
                        f"({table}.{key})"
                    )

    def _kind_warnings(self, differences: Sequence[str]) -> Iterator[str]:
        """Yield what holds for all predictions of this model, unless a difference says more."""
        if (
            self.certainty is not None
            and self.sets is not None
            and self.sets.unit == "trials"
            and not differences
        ):
            yield (
                "certainty and sets were measured with grasps of the objects that it was trained on: of other objects "
                "it knows less"
            )
        if self.sets is not None and self.sets.uncalibrated and not differences:
            names = ", ".join(self.sets.uncalibrated)
            yield f"in every set, because too few {self.sets.unit} calibrate it: {names}"
        if self.simulated and not any(
            difference.startswith("trained on simulated grasps, but") for difference in differences
        ):
            yield "trained on simulated grasps: valid for the simulator, untested on real objects"

    def as_json(self) -> dict[str, Any]:
        """Return the content of the file of the model."""
        content = {
            "format": FORMAT,
            "version": VERSION,
            "classifier": self.component,
            "settings": json_ready(self.settings),
            "target": self.target,
            "features": [[name, unit] for name, unit in zip(self.names, self.units, strict=True)],
            "provenance": json_ready(self.provenance),
            "unknown": self.novelty.to_json(),
            **({} if self.sets is None else {"sets": self.sets.to_json()}),
            "certainty": None if self.certainty is None else self.certainty.to_json(),
            **({} if self.temperature is None else {"temperature": self.temperature}),
            "model": self.classifier.to_json(),
            **({} if not self.learned_from else {"learned_from": list(self.learned_from)}),
            **(
                {}
                if not self.checkpoints
                else {"checkpoints": [_part_as_json(*checkpoint) for checkpoint in self.checkpoints]}
            ),
        }
        return {**content, "sha256": digest(content)}


def _part_as_json(after_s: float, part: Model) -> dict[str, Any]:
    """Return what the model of a checkpoint has of its own; the rest is that of the model of whole grasps."""
    return {
        "after_contact_s": after_s,
        "trials": part.provenance["trials"],
        "by_label": json_ready(part.provenance["by_label"]),
        "unknown": part.novelty.to_json(),
        "sets": None if part.sets is None else part.sets.to_json(),
        "certainty": None if part.certainty is None else part.certainty.to_json(),
        "temperature": part.temperature,
        "model": part.classifier.to_json(),
    }


def checkpoint_model(whole: Model, after_s: float, part: Model) -> Model:
    """Return the model of the checkpoint `after_s` (s), as a part of that of whole grasps."""
    own = {key: part.provenance[key] for key in ("trials", "by_label")}
    return evolve(
        part,
        name=whole.name,
        provenance={**whole.provenance, **own, "after_contact_s": after_s},
        checkpoints=(),
    )


def _part_from_json(whole: Model, component: Component, config: Any, kept: StoredValues) -> Model:
    """Return the model of a checkpoint. Raises DataDamaged."""
    classifier = classifier_from(kept, component, config, whole.names, whole.units)
    if others := sorted({*classifier.classes()} - {*whole.classifier.classes()}):
        raise kept.refusal(
            "model", f"it knows labels that the model of whole grasps does not: {listed(others)}"
        )
    by_label = kept.table("by_label")
    part = evolve(
        whole,
        classifier=classifier,
        novelty=_novelty_from(kept, classifier, whole.names, whole.units),
        sets=_sets_from(kept, classifier),
        certainty=_certainty_from(kept),
        temperature=_temperature_from(kept),
        provenance={
            "trials": kept.whole("trials"),
            "by_label": {label: by_label.whole(label) for label in by_label},
        },
    )
    return checkpoint_model(whole, kept.number("after_contact_s", least=0.0), part)


def _checkpoints_from(
    stored: StoredValues, whole: Model, component: Component, config: Any
) -> tuple[tuple[float, Model], ...]:
    """Return the models of the checkpoints, with their times. Raises DataDamaged."""
    if "checkpoints" not in stored:
        return ()
    parts = [_part_from_json(whole, component, config, kept) for kept in stored.tables("checkpoints")]
    times = [float(part.after_s or 0.0) for part in parts]
    if any(later <= earlier for earlier, later in pairwise([0.0, *times])):
        raise stored.refusal("checkpoints", "their times do not increase from above 0 s")
    return tuple(zip(times, parts, strict=True))


def classifier_from(
    stored: StoredValues, component: Component, config: Any, names: tuple[str, ...], units: tuple[str, ...]
) -> Classifier[Any]:
    """Return the classifier in `model`, which answers a trial with these features. Raises DataDamaged.

    Whatever a classifier raises on values that it cannot read is an error of the file.
    """
    classifier: Classifier[Any] = component.create(config)
    try:
        classifier.from_json(stored.table("model").as_dict())
        classes = classifier.classes()
        if (
            len(classes) < 1
            or len(set(classes)) < len(classes)
            or not all(type(name) is str for name in classes)
        ):
            raise ValueError("its labels are not different texts")
        empty = FeatureTable(names=names, units=units, values=np.full((1, len(names)), np.nan))
        refuse_improbable(classifier.probabilities(empty), 1, len(classes))
    except PluginUnavailable:
        raise
    except DataDamaged as error:
        raise StoredValueError(f"{stored.field('model')}.{error}") from error
    except Exception as error:
        raise stored.refusal("model", named(error)) from error
    return classifier


def _novelty_from(
    stored: StoredValues, classifier: Classifier[Any], names: tuple[str, ...], units: tuple[str, ...]
) -> Novelty:
    """Return the ranges of the training trials, which have the labels of the classifier. Raises DataDamaged."""
    novelty = novelty_from(names, units, stored.value("unknown"), stored.field("unknown"))
    if sorted(novelty.classes) != sorted(classifier.classes()):
        raise stored.refusal("unknown.ranges", "they are not those of the labels of the classifier")
    return novelty


def _certainty_from(stored: StoredValues) -> Certainty | None:
    """Return the certainty; None in a model without calibration, or of an earlier version. Raises DataDamaged."""
    if "certainty" not in stored or stored.value("certainty") is None:
        return None
    return certainty_from(stored.tables("certainty"))


def _sets_from(stored: StoredValues, classifier: Classifier[Any]) -> PredictionSets | None:
    """Return the prediction sets, if there are any. Raises DataDamaged."""
    if "sets" not in stored or stored.value("sets") is None:
        return None
    if "certainty" not in stored:
        old = stored.table("sets")
        reason = "its file was written by an earlier version of graspsense: train it again"
        return PredictionSets(
            coverage=old.number("coverage", *COVERAGES), unit=old.text("unit"), thresholds={}, reason=reason
        )
    certainty = _certainty_from(stored)
    return sets_from(
        stored.table("sets"), classifier.classes(), 0 if certainty is None else len(certainty.classes)
    )


def _temperature_from(stored: StoredValues) -> float | None:
    """Return the stored temperature; None in a model of an earlier version. Raises DataDamaged."""
    if "temperature" not in stored or stored.value("temperature") is None:
        return None
    least, most = TEMPERATURES
    return stored.number("temperature", least * (1.0 - _EQUAL), most * (1.0 + _EQUAL))


def _provenance_from(stored: StoredValues) -> dict[str, Any]:
    """Return what is known of the training, of which predictions use a part. Raises DataDamaged."""
    kept = stored.table("provenance")
    if "simulated" in kept:
        kept.flag("simulated")
    if "settings" in kept:
        tables = kept.table("settings")
        for name in set(_COMPARED_TABLES) & set(tables):
            if tables.value(name) is not None:
                tables.table(name)
    if "after_contact_s" in kept:
        raise kept.refusal("after_contact_s", "only the model of a checkpoint has one")
    return kept.as_dict()


def refuse_improbable(shares: Any, trials: int, classes: int) -> None:
    """Raise ValueError unless these are probabilities: shape (trials, classes), and each row sums to 1."""
    if not isinstance(shares, np.ndarray) or shares.shape != (trials, classes) or shares.dtype != np.float64:
        raise ValueError(f"its probabilities do not have the shape {(trials, classes)}")
    if not ((shares >= 0.0).all() and (np.abs(shares.sum(axis=1) - 1.0) <= _EQUAL).all()):
        raise ValueError("it gives no probabilities: they are not finite, are below 0, or do not sum to 1")


def _compared(
    settings: Settings | None, provenance: Mapping[str, Any] | None
) -> Iterator[tuple[str, Mapping[str, Any], frozenset[str]]]:
    """Yield the tables of settings of a trial, with the keys that may differ between training and use."""
    stated = (provenance or {}).get("settings") or {}
    for table in _COMPARED_TABLES:
        if settings is not None and settings.values.get(table) is not None:
            yield table, settings.values[table], _not_compared(type(getattr(settings, table).config))
        elif settings is None and stated.get(table) is not None:
            yield table, stated[table], _not_compared(_config_class(table, stated[table].get("type")))


def _config_class(table: str, name: Any) -> type:
    """Return the config class of an installed component; `object`, which has no settings, if there is none."""
    from graspsense.core.components.registry import installed

    role = next(role for role, known_table in TABLE_OF_ROLE.items() if known_table == table)
    try:
        return installed().find(role, str(name)).config_class()
    except ConfigError:
        return object


def _not_compared(config_class: type) -> frozenset[str]:
    """Return the settings of a component that may differ between training and use without a warning."""
    unchanging = settings_marked(config_class, CHANGES_NO_RESULT)
    return unchanging | settings_marked(config_class, NAMES_INPUT) | {"type"}


def train(
    component: Component,
    config: Any,
    labelled: Labelled,
    *,
    name: str,
    seed: int = 0,
    target: str = "both",
    provenance: Mapping[str, Any] | None = None,
) -> Model:
    """Return the model of a classifier with this config, fitted to these trials.

    Raises ConfigError if nothing can be learned from them.
    """
    from graspsense.core.components.strict import plain

    classifier = component.create(config)
    try:
        classifier.fit(labelled.table, labelled.labels, seed)
    except ValueError as error:
        raise ConfigError(f"{component.qualified} cannot learn from {labelled.source}: {error}") from error
    settings = {key: value for key, value in plain(config).items() if key != "model"}
    return Model(
        name=name,
        component=component.qualified,
        settings=settings,
        classifier=classifier,
        names=labelled.table.names,
        units=labelled.table.units,
        target=target,
        novelty=novelty_of(labelled.table, labelled.labels),
        learned_from=() if labelled.provenance.get("simulated") else row_hashes(labelled.table),
        provenance={
            "source": labelled.source,
            "trials": len(labelled),
            "by_label": dict(sorted(Counter(labelled.labels).items())),
            "seed": seed,
            "versions": {
                "graspsense": __version__,
                component.distribution: component.version,
                "numpy": np.__version__,
                "python": platform.python_version(),
            },
            **labelled.provenance,
            **(provenance or {}),
        },
    )


def write_model(path: Path, model: Model) -> None:
    """Write the file of a model atomically. Raises OSError."""
    write_json_lines(path, model.as_json())


def write_json_lines(path: Path, content: Mapping[str, Any]) -> None:
    """Write the content of a model atomically, one line for each key. Raises OSError."""
    # Readable, and much shorter than one line for each number.
    lines = (f"{json.dumps(key)}: {_json(value)}" for key, value in content.items())
    write_whole(path, ("{\n" + ",\n".join(lines) + "\n}\n").encode())


def load_model(name: str, plugins: Plugins) -> Model:
    """Return a model from a `.json` file, or by the name of a model that a plugin ships.

    Raises ConfigError if the file is missing, DataDamaged if its content is not a model.
    """
    return _model_from(_text(name, plugins), name, plugins, None)


@lru_cache(maxsize=MODELS_KEPT)
def _kept_model(text: bytes, name: str, plugins: Plugins, component: Component) -> Model:
    """Return the model in this text; one that a pipeline used before is not read again."""
    return _model_from(text, name, plugins, component)


def _model_from(text: bytes, name: str, plugins: Plugins, component: Component | None) -> Model:
    try:
        return _restored(StoredValues(_content(name, text)), name, plugins, component)
    except StoredValueError as error:
        raise DataDamaged(f"model {name!r} is damaged: {error}") from error


def _restored(stored: StoredValues, name: str, plugins: Plugins, component: Component | None) -> Model:
    """Return the model with these values. Raises DataDamaged, and ConfigError for another classifier."""
    made_by = stored.text("classifier")
    if component is None:
        component = plugins.find("classifier", made_by)
    elif component.qualified != made_by:
        raise ConfigError(
            f"model {name!r} was made by {made_by}, but the classifier here is {component.qualified}. "
            f'Write classifier.type = "{made_by}", or train a model: graspsense train --help'
        )
    settings, config = _settings_from(stored, component)
    names, units = stored.features("features")
    classifier = classifier_from(stored, component, config, names, units)
    model = Model(
        name=name,
        component=made_by,
        settings=settings,
        classifier=classifier,
        names=names,
        units=units,
        target=stored.text("target"),
        novelty=_novelty_from(stored, classifier, names, units),
        provenance=_provenance_from(stored),
        sets=_sets_from(stored, classifier),
        certainty=_certainty_from(stored),
        temperature=_temperature_from(stored),
        learned_from=stored.texts("learned_from") if "learned_from" in stored else (),
    )
    return evolve(model, checkpoints=_checkpoints_from(stored, model, component, config))


def _settings_from(stored: StoredValues, component: Component) -> tuple[dict[str, Any], Any]:
    """Return the settings that the classifier was fitted with, and its config. Raises DataDamaged."""
    from graspsense.core.components.strict import ValidationFailed, structured

    kept = stored.table("settings")
    if "model" in kept:
        raise kept.refusal("model", "the settings of a model do not name a model")
    config_class = component.config_class()
    settings = settings_from_json(kept.as_dict(), config_class)
    try:
        return settings, structured(settings, config_class, component.qualified)
    except ValidationFailed as misfit:
        problem = misfit.problems[0]
        raise stored.refusal(".".join(map(str, ("settings", *problem.path))), problem.text) from None


def model_for(settings: Settings, plugins: Plugins) -> Model | None:
    """Return the model of the classifier of a pipeline; None if the pipeline has no classifier.

    The same content gives the same model, which must not be changed. Raises ConfigError if the pipeline names no model,
    WiringError if the model takes other features than those of the pipeline, and what `load_model` raises.
    """
    chosen = settings.classifier
    if chosen is None:
        return None
    name = getattr(chosen.config, "model", None)
    if name is None:
        raise ConfigError(
            f"classifier {chosen.component.qualified} has no model (classifier.model is not given).\n"
            + _how_to_train(settings, "model.json")
            + f"\n  then use it: {set_option('classifier.model=model.json')}     or do without: "
            f"{set_option('classifier.type=none')}"
        )
    if name.endswith(".json") and not Path(name).expanduser().exists():
        raise ConfigError(
            f"there is no model {name} yet (classifier.model).\n"
            + _how_to_train(settings, name)
            + f"\n  or do without: {set_option('classifier.type=none')}"
        )
    model = _kept_model(_text(name, plugins), name, plugins, chosen.component)
    given = settings.features.declared.features
    misfit = model.misfit(
        FeatureTable(
            names=tuple(feature.name for feature in given),
            units=tuple(feature.unit for feature in given),
            values=np.empty((0, len(given))),
        )
    )
    if misfit:
        raise WiringError(
            f"{misfit}. It could not answer: choose its features, features.type = "
            f"{_features_of(model)}; train a model of these features:\n{_how_to_train(settings, 'model.json')}\n"
            f"  or do without: {set_option('classifier.type=none')}"
        )
    return model


def _features_of(model: Model) -> str:
    """Return the feature set that a model was trained with, as far as it is known."""
    table = dict(model.provenance.get("settings", {})).get("features") or {}
    return str(table.get("type", "those of its training"))


def _how_to_train(settings: Settings, out: str) -> str:
    """Return the commands that make a model for these settings: of simulated trials where the gripper is simulated."""
    assert settings.classifier is not None
    name = settings.classifier.component.name
    selection = f"--gripper {settings.gripper.component.name}"
    if settings.pipeline.endswith(".toml"):
        selection = f"--pipeline {shlex.quote(settings.pipeline)}"
    if settings.origins.get("features.type", "").startswith("-o"):
        selection += f" -o features.type={settings.features.component.name}"
    if settings.gripper.create().objects():
        return f"  train one: graspsense train simulated {selection} --classifier {name} --out {out}"
    return (
        f"  collect trials of this gripper: graspsense collect {selection} --labels can:full,can:empty --save trials\n"
        f"  then train: graspsense train store:trials --classifier {name} --out {out}"
    )


def _text(name: str, plugins: Plugins) -> bytes:
    if not name.endswith(".json"):
        try:
            return plugins.resource(ModelEntry, name).file().read_bytes()
        except UnknownName as error:
            shipped = MODELS.get(name)
            hint = f"\n  It comes with {shipped.distribution}:\n  {shipped.hint}" if shipped else ""
            raise UnknownName(
                f"{error}{hint}\n  A model of your own is a file: write its name with .json"
            ) from error
    return model_bytes(name)


def _content(name: str, text: bytes) -> dict[str, Any]:
    content = parsed(name, text)
    if isinstance(content, dict) and content.get("format") == REGRESSION_FORMAT:
        raise ConfigError(
            f"model {name!r} predicts a number, not a label: use it with graspsense predict {name} SOURCE"
        )
    return sealed_content(name, content, FORMAT, _READ, "model of graspsense")


def _json(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def _chosen(features: Features, names: Sequence[str]) -> Features:
    if features.names == tuple(names):
        return features
    places = [features.names.index(name) for name in names]
    return Features(
        names=tuple(names),
        values=tuple(features.values[i] for i in places),
        units=tuple(features.units[i] for i in places),
        reasons={name: why for name, why in features.reasons.items() if name in names},
    )


def _bounded(features: Features) -> Features:
    """Return the features for a classifier: one that is too large to compute with is as large as can be."""
    if all(not abs(value) > LARGEST_VALUE for value in features.values):
        return features
    values = tuple(min(max(value, -LARGEST_VALUE), LARGEST_VALUE) for value in features.values)
    return evolve(features, values=values)


def worded(key: str, value: Any) -> tuple[str, str]:
    """Return a key and its value in words: `probing_force_n`, 20 as `probing force`, `20 N`."""
    ending = next((ending for ending in UNIT_OF_ENDING if key.endswith(ending)), "")
    if not ending or isinstance(value, bool) or not isinstance(value, int | float):
        return without_underscores(key), str(value)
    unit, factor = display_unit(UNIT_OF_ENDING[ending])
    return without_underscores(key.removesuffix(ending)), f"{value * factor:g} {unit}"
