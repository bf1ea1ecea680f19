"""The file of a model: what it holds, and how a model is restored from it.

It is one JSON file without code. It names its classifier, which must be an installed component: nothing in it is
imported, evaluated or unpickled. Its `sha256` is the hash of the other content, which detects a damaged file.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from attrs import evolve

from graspsense.core.components.entries import ModelEntry
from graspsense.core.learn.certainty import Certainty, certainty_from
from graspsense.core.learn.conformal import COVERAGES, PredictionSets, sets_from
from graspsense.core.learn.model import COMPARED_TABLES, Model, checkpoint_model, refuse_improbable
from graspsense.core.learn.model_content import (
    REGRESSION_FORMAT,
    digest,
    model_bytes,
    parsed,
    sealed_content,
    write_json_lines,
)
from graspsense.core.learn.novelty import novelty_from
from graspsense.core.learn.stored_values import StoredValueError, StoredValues
from graspsense.core.values.errors import (
    ComponentFailed,
    ConfigError,
    DataDamaged,
    PluginUnavailable,
    UnknownName,
    listed,
    named,
    place_of,
)
from graspsense.core.values.features import FeatureTable
from graspsense.core.values.json_values import json_ready, settings_from_json

if TYPE_CHECKING:
    from graspsense.core.components.registry import Component, Plugins
    from graspsense.core.components.roles import Classifier


FORMAT: Final = "graspsense model"
VERSION: Final = 2
_READ: Final = (1, VERSION)
"""The versions that are read. Sets of the first one do not hold for answers from few trials, and are left out."""


def write_model(path: Path, model: Model) -> None:
    """Write the file of a model atomically. Raises OSError, and ComponentFailed if its classifier gives no JSON."""
    try:
        write_json_lines(path, as_json(model))
    except (TypeError, ValueError) as error:
        raise ComponentFailed(
            f"the model of {model.component} cannot be stored: {named(error)}. Its to_json gives lists, tables, texts "
            "and finite numbers"
        ) from error


def as_json(model: Model) -> dict[str, Any]:
    """Return the content of the file of a model."""
    content = {
        "format": FORMAT,
        "version": VERSION,
        "classifier": model.component,
        "settings": json_ready(model.settings),
        "target": model.target,
        "features": list(zip(model.names, model.units, strict=True)),
        "provenance": json_ready(model.provenance),
        **_learned_as_json(model),
        **({"learned_from": list(model.learned_from)} if model.learned_from else {}),
        **({"checkpoints": list(map(_part_as_json, model.checkpoints))} if model.checkpoints else {}),
    }
    return {**content, "sha256": digest(content)}


def _part_as_json(checkpoint: tuple[float, Model]) -> dict[str, Any]:
    """Return what the model of a checkpoint has of its own; the rest is that of the model of whole grasps."""
    after_s, part = checkpoint
    return {
        "after_contact_s": after_s,
        "trials": part.provenance["trials"],
        "by_label": json_ready(part.provenance["by_label"]),
        **_learned_as_json(part),
    }


def _learned_as_json(model: Model) -> dict[str, Any]:
    """Return what was learned from trials, of whole grasps or up to a checkpoint."""
    return {
        "unknown": model.novelty.to_json(),
        "sets": None if model.sets is None else model.sets.to_json(),
        **({"certainty": None} if model.certainty is None else model.certainty.to_json()),
        "model": model.classifier.to_json(),
    }


def load_model(name: str, plugins: Plugins) -> Model:
    """Return a model from a `.json` file, or by the name of a model that a plugin ships.

    Raises ConfigError if the file is missing, DataDamaged if its content is not a model.
    """
    return model_in(model_text(name, plugins), name, plugins, None)


def model_in(text: bytes, name: str, plugins: Plugins, component: Component | None) -> Model:
    """Return the model in this text, of this classifier unless it is None. Raises what `load_model` raises."""
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
    model = Model(
        name=name,
        component=made_by,
        settings=settings,
        names=names,
        units=units,
        target=stored.text("target"),
        provenance=_provenance_from(stored),
        learned_from=stored.texts("learned_from") if "learned_from" in stored else (),
        **_learned_from(stored, component, config, names, units),
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
        raise stored.refusal(".".join(map(str, ("settings", *problem.path))), problem.words()) from None


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
        # What `from_json` may raise is about the file; anything else is a mistake of the classifier.
        place = "" if isinstance(error, KeyError | TypeError | ValueError) else place_of(error)
        reader = f"{component.qualified} {component.version}"
        raise stored.refusal("model", f"{named(error)}{place}, by {reader}, which reads it") from error
    return classifier


def _learned_from(
    stored: StoredValues, component: Component, config: Any, names: tuple[str, ...], units: tuple[str, ...]
) -> dict[str, Any]:
    """Return what a model of these features learned, as its fields. Raises DataDamaged.

    What it was not calibrated for is None, and so is what its version did not have.
    """
    classifier = classifier_from(stored, component, config, names, units)
    novelty = novelty_from(names, units, stored.table("unknown"))
    if sorted(novelty.classes) != sorted(classifier.classes()):
        raise stored.refusal("unknown.ranges", "they are not those of the labels of the classifier")
    certainty = certainty_from(stored)
    return {
        "classifier": classifier,
        "novelty": novelty,
        "certainty": certainty,
        "sets": _sets_from(stored, classifier, certainty) if stored.has("sets") else None,
    }


def _sets_from(
    stored: StoredValues, classifier: Classifier[Any], certainty: Certainty | None
) -> PredictionSets:
    """Return the prediction sets. Raises DataDamaged."""
    kept = stored.table("sets")
    if "certainty" not in stored:
        reason = "its file was written by an earlier version of graspsense: train it again"
        return PredictionSets(
            coverage=kept.number("coverage", *COVERAGES), unit=kept.text("unit"), thresholds={}, reason=reason
        )
    return sets_from(kept, classifier.classes(), 0 if certainty is None else len(certainty.classes))


def _provenance_from(stored: StoredValues) -> dict[str, Any]:
    """Return what is known of the training, of which predictions use a part. Raises DataDamaged."""
    kept = stored.table("provenance")
    if "simulated" in kept:
        kept.flag("simulated")
    if "settings" in kept:
        tables = kept.table("settings")
        for name in set(COMPARED_TABLES) & set(tables):
            if tables.value(name) is not None:
                tables.table(name)
    if "after_contact_s" in kept:
        raise kept.refusal("after_contact_s", "only the model of a checkpoint has one")
    return kept.as_dict()


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


def _part_from_json(whole: Model, component: Component, config: Any, kept: StoredValues) -> Model:
    """Return the model of a checkpoint. Raises DataDamaged."""
    learned = _learned_from(kept, component, config, whole.names, whole.units)
    if others := sorted({*learned["classifier"].classes()} - {*whole.classifier.classes()}):
        raise kept.refusal(
            "model", f"it knows labels that the model of whole grasps does not: {listed(others)}"
        )
    by_label = kept.table("by_label")
    own = {
        "trials": kept.whole("trials"),
        "by_label": {label: by_label.whole(label) for label in by_label},
    }
    part = evolve(whole, provenance=own, **learned)
    return checkpoint_model(whole, kept.number("after_contact_s", least=0.0), part)


def model_text(name: str, plugins: Plugins) -> bytes:
    """Return the text of a model from a `.json` file, or of one that a plugin ships.

    Raises ConfigError if the file cannot be read or is too large, UnknownName if no plugin ships it.
    """
    if not name.endswith(".json"):
        try:
            return plugins.resource(ModelEntry, name).file().read_bytes()
        except UnknownName as error:
            raise UnknownName(
                f"{error}\n  A model of your own is a file: write its name with .json"
            ) from error
    return model_bytes(name)


def _content(name: str, text: bytes) -> dict[str, Any]:
    content = parsed(name, text)
    if isinstance(content, dict) and content.get("format") == REGRESSION_FORMAT:
        raise ConfigError(
            f"model {name!r} predicts a number, not a label: use it with graspsense predict {name} SOURCE"
        )
    return sealed_content(name, content, FORMAT, _READ, "model of graspsense")
