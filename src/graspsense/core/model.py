"""A trained model: a fitted classifier and a description of its training data, in one JSON file without code.

The file names its classifier, which must be an installed component. Nothing in the file is imported, evaluated or
unpickled. Its `sha256` is the hash of the other content, which detects a damaged file.
"""

from __future__ import annotations

import hashlib
import json
import math
import platform
import shlex
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, cast

import numpy as np
from attrs import evolve, frozen

from graspsense import __version__
from graspsense.core.conformal import PredictionSets, scores_of, sets_from
from graspsense.core.errors import ConfigError, DataDamaged, UnknownName
from graspsense.core.features import UNKNOWN, Features, FeatureTable, Prediction, table_of
from graspsense.core.firstparty import MODELS
from graspsense.core.json_values import json_ready, settings_from_json
from graspsense.core.novelty import Novelty, novelty_from, novelty_of
from graspsense.core.reasons import Reason
from graspsense.core.setting import CHANGES_NO_RESULT, NAMES_INPUT, UNIT_OF_ENDING, settings_marked
from graspsense.core.temperature import at_temperature
from graspsense.core.units import display_unit, without_underscores
from graspsense.core.whole_file import write_whole

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from graspsense.core.config import SelectedComponent, Settings
    from graspsense.core.labelled import Labelled
    from graspsense.core.plugins import Component, Plugins
    from graspsense.core.roles import Classifier, DeviceInfo

FORMAT: Final = "graspsense model"
REGRESSION_FORMAT: Final = "graspsense regression model"
"""The `format` of a model that predicts a number (`graspsense.regression`)."""
VERSION: Final = 1
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
    """Calibrated prediction sets; None in a model of an earlier version."""
    temperature: float | None = None
    """The temperature at which its probabilities are calibrated (`graspsense.core.temperature`); None: they are not."""
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
        settings = self.provenance.get("settings", {}).get("controller", {})
        at = [
            worded(key, settings[key])[1]
            for key in ("probing_force_n", "closing_speed_m_s")
            if key in settings
        ]
        number = self.provenance.get("trials", "?")
        return (
            f"{self.name}: {self.component} trained on {number} {kind}"
            + (f" at {', '.join(at)}" if at else "")
            + (f", {self.after_s:g} s after the contact" if self.after_s is not None else "")
        )

    @property
    def after_s(self) -> float | None:
        """The time after the contact up to which it knows a grasp; None for whole grasps."""
        after_s = self.provenance.get("after_contact_s")
        return None if after_s is None else float(after_s)

    def predict(
        self, features: Features, settings: Settings | None = None, device: DeviceInfo | None = None
    ) -> Prediction:
        """Return the prediction for one trial, with warnings about its validity.

        `settings` and `device` are those of the grasp, if there was one. A trial that lacks a feature of the model, or
        has it in another unit, is unknown, with that as the reason.
        """
        warnings = tuple(self._warnings(settings, device))
        probabilities: Mapping[str, float] = {}
        because: tuple[Reason | str, ...]
        misfit = self.misfit(features)
        if misfit:
            because = (misfit,)
        else:
            chosen = _chosen(features, self.names)
            explained = self.classifier.explain(chosen)
            classes = self.classifier.classes()
            shares = np.array([[explained.probabilities.get(name, 0.0) for name in classes]])
            (calibrated,) = at_temperature(shares, self.temperature).tolist()
            prediction = evolve(
                explained,
                probabilities=dict(zip(classes, calibrated, strict=True)),
                calibrated=self.temperature is not None,
            )
            warnings = (*prediction.warnings, *warnings)
            strange = self.novelty.unlike(chosen)
            if strange is None:
                (members,) = self.prediction_sets(table_of([chosen]), [prediction.label], shares)
                return evolve(
                    prediction,
                    warnings=warnings,
                    model=self.in_a_line,
                    prediction_set=members,
                    coverage=self.sets.coverage if self.sets is not None and members else None,
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

    def answers(self, table: FeatureTable) -> tuple[list[str], NDArray[np.float64]]:
        """Return the label of `predict` for each trial of a table, and the probabilities that the classifier gives.

        The probabilities are not calibrated (`at_temperature` does that). Their shape is (trials, classes), in the
        order of the classes of the classifier; unknown trials have probabilities too. Raises ConfigError if the table
        does not have the features of the model.
        """
        misfit = self.misfit(table)
        if misfit:
            raise ConfigError(misfit)
        chosen = table.columns(self.names)
        shares = self.classifier.probabilities(chosen)
        unlike = self.novelty.unlike_rows(chosen).tolist()
        classes = self.classifier.classes()
        # Probabilities that differ by rounding count as equal: the first of them is the answer.
        best = np.argmax(shares >= shares.max(axis=1, keepdims=True) - _EQUAL, axis=1).tolist()
        labels = [UNKNOWN if strange else classes[k] for strange, k in zip(unlike, best, strict=True)]
        return labels, shares

    def prediction_sets(
        self, table: FeatureTable, labels: Sequence[str], shares: NDArray[np.float64]
    ) -> list[tuple[str, ...]]:
        """Return the prediction set of each trial, given the predicted labels and what the classifier gives.

        A set is empty if the trial is unknown, or if the model has no calibrated sets.
        """
        if self.sets is None or not self.sets.thresholds:
            return [()] * len(table)
        classes = self.classifier.classes()
        scores = scores_of(shares, self.novelty.closeness(table, classes))
        return [
            () if label == UNKNOWN else self.sets.of(dict(zip(classes, row, strict=True)), label)
            for label, row in zip(labels, scores.tolist(), strict=True)
        ]

    def misfit(self, given: Features | FeatureTable) -> str:
        """Return why the model cannot be applied to these features; empty if it can."""
        lacking = [name for name in self.names if name not in given.names]
        if lacking:
            return (
                f"model {self.name!r} takes the features {', '.join(self.names)}; there is no "
                f"{', '.join(lacking)} here (there are: {', '.join(given.names)})"
            )
        units = dict(zip(given.names, given.units, strict=True))
        for name, unit in zip(self.names, self.units, strict=True):
            if unit and units[name] and unit != units[name]:
                return f"model {self.name!r} takes {name} in {unit}; here it is in {units[name]}"
        return ""

    def _warnings(self, settings: Settings | None, device: DeviceInfo | None) -> Iterator[str]:
        kind = "simulated grasps" if self.simulated else "grasps"
        if self.simulated:
            if device is not None and device.clock == "device" and not device.simulated:
                yield (
                    "trained on simulated grasps, but this gripper is real: expect wrong answers until a model is "
                    "trained on grasps of its own"
                )
            else:
                yield "trained on simulated grasps: valid for the simulator, untested on real objects"
        if settings is None:
            return
        trained = dict(self.provenance.get("settings", {}))
        for table in _COMPARED_TABLES:
            then, now = trained.get(table), settings.values.get(table)
            if then is None or now is None:
                continue
            if then.get("type") != now.get("type"):
                yield f"trained on {kind} with {table} {then.get('type')}, this one was with {now.get('type')}"
                continue
            for key in sorted((then.keys() & now.keys()) - _not_compared(getattr(settings, table))):
                if json_ready(then[key]) != json_ready(now[key]):
                    what, value = worded(key, then[key])
                    yield (
                        f"trained on {kind} with {what} {value}, this one was with {worded(key, now[key])[1]} "
                        f"({table}.{key})"
                    )

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
            **({} if self.temperature is None else {"temperature": self.temperature}),
            "model": self.classifier.to_json(),
            **(
                {}
                if not self.checkpoints
                else {"checkpoints": [_part_as_json(*one) for one in self.checkpoints]}
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


def _part_from_json(whole: Model, component: Component, config: Any, kept: Mapping[str, Any]) -> Model:
    """Return the model of a checkpoint. Raises KeyError, TypeError, ValueError or DataDamaged."""
    classifier = component.create(config)
    classifier.from_json(kept["model"])
    sets = kept["sets"]
    part = evolve(
        whole,
        classifier=classifier,
        novelty=novelty_from(whole.names, whole.units, kept["unknown"]),
        sets=None if sets is None else sets_from(sets, classifier.classes()),
        temperature=_temperature_from(kept),
        provenance={"trials": int(kept["trials"]), "by_label": dict(kept["by_label"])},
    )
    return checkpoint_model(whole, float(kept["after_contact_s"]), part)


def _temperature_from(kept: Mapping[str, Any]) -> float | None:
    """Return the stored temperature; None in a model of an earlier version. Raises TypeError or ValueError."""
    temperature = kept.get("temperature")
    if temperature is None:
        return None
    if not 0.0 < float(temperature) < math.inf:
        raise ValueError(f"its temperature is {temperature}, not a positive number")
    return float(temperature)


def _not_compared(chosen: SelectedComponent) -> frozenset[str]:
    """Return the settings of a component that may differ between training and use without a warning."""
    config_class = type(chosen.config)
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
    from graspsense.core.strict import plain

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


def load_model(name: str, plugins: Plugins, component: Component | None = None) -> Model:
    """Return a model from a `.json` file, or by the name of a model that a plugin ships.

    `component` is the classifier that the pipeline selects, if any. Raises ConfigError if the file is missing or
    another classifier made it, DataDamaged if its content is not a model.
    """
    return _model_from(_text(name, plugins), name, plugins, component)


@lru_cache(maxsize=MODELS_KEPT)
def _kept_model(text: bytes, name: str, plugins: Plugins, component: Component) -> Model:
    """Return the model in this text; one that a pipeline used before is not read again."""
    return _model_from(text, name, plugins, component)


def _model_from(text: bytes, name: str, plugins: Plugins, component: Component | None) -> Model:
    content = _content(name, text)
    made_by = content["classifier"]
    if component is None:
        component = plugins.find("classifier", made_by)
    elif component.qualified != made_by:
        raise ConfigError(
            f"model {name!r} was made by {made_by}, but the classifier here is {component.qualified}. "
            f'Write classifier.type = "{made_by}", or train a model: graspsense train --help'
        )
    from graspsense.core.config import build

    settings = settings_from_json(content["settings"], component.config_class())
    config = build(component, settings)
    classifier = component.create(config)
    try:
        names = tuple(str(one[0]) for one in content["features"])
        units = tuple(str(one[1]) for one in content["features"])
        classifier.from_json(content["model"])
        model = Model(
            name=name,
            component=made_by,
            settings=settings,
            classifier=classifier,
            names=names,
            units=units,
            target=str(content["target"]),
            novelty=novelty_from(names, units, content["unknown"]),
            provenance=content["provenance"],
            sets=sets_from(content["sets"], classifier.classes()) if "sets" in content else None,
            temperature=_temperature_from(content),
        )
        parts = [_part_from_json(model, component, config, kept) for kept in content.get("checkpoints", ())]
        return evolve(model, checkpoints=tuple((float(part.after_s or 0.0), part) for part in parts))
    except (KeyError, IndexError, TypeError, ValueError) as error:
        raise DataDamaged(f"model {name!r} is damaged: {type(error).__name__}: {error}") from error


def model_for(settings: Settings, plugins: Plugins) -> Model | None:
    """Return the model of the classifier of a pipeline; None if the pipeline has no classifier.

    The same content gives the same model, which must not be changed. Raises ConfigError if the pipeline names no model,
    and what `load_model` raises.
    """
    chosen = settings.classifier
    if chosen is None:
        return None
    name = getattr(chosen.config, "model", None)
    if name is None:
        raise ConfigError(
            f"classifier {chosen.component.qualified} has no model (classifier.model is not given).\n"
            + _how_to_train(settings, "model.json")
            + "\n  then use it: -o classifier.model=model.json     or do without: -o classifier.type=none"
        )
    if name.endswith(".json") and not Path(name).expanduser().exists():
        raise ConfigError(
            f"there is no model {name} yet (classifier.model).\n"
            + _how_to_train(settings, name)
            + "\n  or do without: -o classifier.type=none"
        )
    return _kept_model(_text(name, plugins), name, plugins, chosen.component)


def _how_to_train(settings: Settings, out: str) -> str:
    """Return the commands that make a model for these settings: of simulated trials where the gripper is simulated."""
    assert settings.classifier is not None
    name = settings.classifier.component.name
    of = f"--gripper {settings.gripper.component.name}"
    if settings.pipeline.endswith(".toml"):
        of = f"--pipeline {shlex.quote(settings.pipeline)}"
    if settings.gripper.create().objects():
        return f"  train one: graspsense train simulated {of} --classifier {name} --out {out}"
    return (
        f"  collect trials of this gripper: graspsense collect {of} --labels can:full,can:empty --save trials\n"
        f"  then train: graspsense train store:trials --classifier {name} --out {out}"
    )


def _text(name: str, plugins: Plugins) -> bytes:
    if not name.endswith(".json"):
        try:
            return plugins.model(name).file().read_bytes()
        except UnknownName as error:
            shipped = MODELS.get(name)
            hint = f"\n  It comes with {shipped.distribution}:\n  {shipped.hint}" if shipped else ""
            raise UnknownName(
                f"{error}{hint}\n  A model of your own is a file: write its name with .json"
            ) from error
    try:
        return Path(name).expanduser().read_bytes()
    except OSError as error:
        raise ConfigError(f"model {name} cannot be read: {error.strerror}") from error


def _content(name: str, text: bytes) -> dict[str, Any]:
    try:
        content = json.loads(text)
    except (UnicodeDecodeError, ValueError) as error:
        raise DataDamaged(f"model {name!r} is not JSON: {error}") from error
    if isinstance(content, dict) and content.get("format") == REGRESSION_FORMAT:
        raise ConfigError(
            f"model {name!r} predicts a number, not a label: use it with graspsense predict {name} SOURCE"
        )
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise DataDamaged(f'{name!r} is not a model of graspsense: it lacks "format": "{FORMAT}"')
    if content.get("version") != VERSION:
        raise DataDamaged(
            f"model {name!r} has version {content.get('version')!r}; this graspsense ({__version__}) reads {VERSION}"
        )
    rest = {key: value for key, value in content.items() if key != "sha256"}
    if content.get("sha256") != digest(rest):
        raise DataDamaged(f"model {name!r} was changed or damaged: its sha256 does not match")
    expected = {"classifier": str, "settings": dict, "features": list, "provenance": dict, "unknown": dict}
    for key, kind in expected.items():
        if not isinstance(content.get(key), kind):
            raise DataDamaged(f"model {name!r} is damaged: {key!r} is missing or not a {kind.__name__}")
    return cast("dict[str, Any]", content)


def _json(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def digest(content: Mapping[str, Any]) -> str:
    """Return the hash of the content of a model."""
    text = json.dumps(content, sort_keys=True, ensure_ascii=False, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def _chosen(features: Features, names: Sequence[str]) -> Features:
    if features.names == tuple(names):
        return features
    at = [features.names.index(name) for name in names]
    return Features(
        names=tuple(names),
        values=tuple(features.values[i] for i in at),
        units=tuple(features.units[i] for i in at),
        reasons={name: why for name, why in features.reasons.items() if name in names},
    )


def worded(key: str, value: Any) -> tuple[str, str]:
    """Return a key and its value in words: `probing_force_n`, 20 as `probing force`, `20 N`."""
    ending = next((one for one in UNIT_OF_ENDING if key.endswith(one)), "")
    if not ending or isinstance(value, bool) or not isinstance(value, int | float):
        return without_underscores(key), str(value)
    unit, factor = display_unit(UNIT_OF_ENDING[ending])
    return without_underscores(key.removesuffix(ending)), f"{value * factor:g} {unit}"
