"""`graspsense train --choose`: which classifier and which features, and the pipeline that has them."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from attrs import evolve, frozen

from graspsense.cli.options import sets_key
from graspsense.cli.progress import ProgressLine
from graspsense.cli.sources import is_csv, learner_of, trials_of
from graspsense.cli.terminal import echo_as_it_is, echo_entries, echo_entry
from graspsense.core.components.registry import Component, installed
from graspsense.core.components.strict import keys_of, plain
from graspsense.core.files.toml_text import toml_lines
from graspsense.core.settings.layers import read_toml, refuse_other_kind
from graspsense.core.settings.selected import SelectedComponent, build
from graspsense.core.values.errors import ConfigError, GraspsenseError, PluginUnavailable, counted
from graspsense.core.values.features import FeatureTable
from graspsense.evaluation.json_codec import to_json
from graspsense.recording.provenance import recipe

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from graspsense.core.learn.labelled import Labelled
    from graspsense.evaluation.choosing import ChosenPipeline

CLASSIFIERS: Final = ("c45", "knn", "svm", "forest", "extra-trees", "mlp")
"""The classifiers to choose from, unless one is given."""
UNION: Final = "graspsense/union"
MANY: Final = 500
"""Number of features from which on only `QUICK` classifiers are tried: others take minutes on some hundred trials."""
QUICK: Final = ("svm", "extra-trees")
SUITED: Final = 0.5
"""Least share of the trials in which a feature set finds a feature; else the recordings lack what it needs."""


@frozen(kw_only=True, eq=False)
class Chosen:
    """What was chosen, and the trials with the features of it."""

    choice: ChosenPipeline
    learner: SelectedComponent
    labelled: Labelled

    def as_values(self) -> dict[str, Any]:
        """Return the choice as plain values."""
        best = self.choice.best
        shown = ("rate", "right", "chosen_in", "ranking")
        values = {name: to_json(getattr(self.choice, name)) for name in shown}
        return {"classifier": best.classifier, "features": best.features, **values}


def pipeline_beside(model: str) -> str:
    """Return the file of the pipeline beside a model. Raises ConfigError if it is a TOML file of another kind."""
    path = Path(model).with_suffix(".toml")
    if path.is_file():
        refuse_other_kind(read_toml(path, str(path), "pipeline").values, "pipeline", str(path))
    return str(path)


def chosen(
    source: str,
    classifier: str | None,
    given: Mapping[str, Any],
    aimed: Callable[[Labelled], Labelled],
) -> Chosen:
    """Choose among the classifiers with the feature sets that suit the trials; `aimed` gives these their labels.

    Raises ConfigError.
    """
    from graspsense.evaluation.choosing import choose

    names = (
        (classifier or "given",)
        if classifier or sets_key(given["options"], "classifier.type")
        else CLASSIFIERS
    )
    learners = {name: learner_of(source, None if name == "given" else name, given) for name in names}
    learners = {learner.component.name: learner for learner in learners.values()}
    notes: list[str] = []
    with ProgressLine() as progress:
        trials = {name: aimed(table) for name, table in _tables(source, progress, given, notes).items()}
        pairs = _pairs(learners, trials, notes)
        choice = choose(learners, trials, pairs, seed=given["seed"], notes=notes, progress=progress)
    return Chosen(
        choice=choice,
        learner=learners[choice.best.classifier],
        labelled=trials[choice.best.features],
    )


def _pairs(
    learners: Collection[str], trials: Mapping[str, Labelled], notes: list[str]
) -> list[tuple[str, str]]:
    """Return the pairs of classifier and features to try; `notes` gets what would take too long.

    Where nothing else is left, because classifier or features are given, they are tried however long they take.
    """
    every = [(learner, name) for name in trials for learner in learners]
    quick = [
        (learner, name)
        for learner, name in every
        if learner in QUICK or len(trials[name].table.names) <= MANY
    ]
    if not quick:
        return every
    for name in trials:
        slow = [learner for learner in learners if (learner, name) not in quick]
        if slow:
            count = len(trials[name].table.names)
            notes.append(
                f"features {name} are {count}: not tried with {', '.join(slow)}, which would take long"
            )
    return quick


def _tables(
    source: str, progress: ProgressLine, given: Mapping[str, Any], notes: list[str]
) -> dict[str, Labelled]:
    """Return the trials with each feature set that suits them, and with the unions of these; `notes` has the others.

    There is a union of the sets without many features, in which these are not outnumbered, and one of all. The
    recordings are read once, for all sets together.
    """
    import numpy as np

    if is_csv(source):
        return {"columns": trials_of(source, progress, given)}
    if sets_key(given["options"], "features.type"):
        trials = trials_of(source, progress, given)
        features = trials.provenance.get("settings", {}).get("features", {})
        return {str(features.get("type", "given")).rpartition("/")[2]: trials}
    known = [component for component in installed().components("feature-set") if component.qualified != UNION]
    available = []
    for component in known:
        try:
            component.declared()
            available.append(component)
        except PluginUnavailable as error:
            notes.append(f"features {component.name} are left out: {str(error).splitlines()[0]}")
    # Of equal rates the first candidate is chosen: that with the fewest features.
    available.sort(key=lambda component: (len(component.declared().features), component.qualified))
    try:
        united = _with_union(source, progress, given, available)
    except GraspsenseError as error:
        own = [component for component in available if component.distribution == "graspsense"]
        if len(own) == len(available):
            raise
        notes.append(f"only the features of graspsense are used: {error}")
        available = own
        united = _with_union(source, progress, given, available)
    suited: dict[str, NDArray[np.int64]] = {}
    tables: dict[str, Labelled] = {}
    end = 0
    for component in available:
        columns = np.arange(end, end + len(component.declared(_config(united, component)).features))
        end += len(columns)
        part = _part(united, component, columns)
        having = int((~np.isnan(part.table.values)).any(axis=1).sum())
        if having >= SUITED * len(part):
            # Sets of two distributions can have the same name.
            name = component.name if component.distribution == "graspsense" else component.qualified
            tables[name], suited[component.qualified] = part, columns
        else:
            notes.append(
                f"features {component.name} are left out: {having} of {counted(len(part), 'trial')} have one of them"
            )
    if not suited:
        raise ConfigError(f"no feature set suits the trials of {source}:\n" + "\n".join(notes))
    union = installed().find("feature-set", UNION)
    small = {name: columns for name, columns in suited.items() if len(columns) <= MANY}
    for name, sets in (("union", small), ("union of all", suited)):
        if len(sets) > 1 and (name == "union" or len(sets) > len(small)):
            tables[name] = _part(united, union, np.concatenate(list(sets.values())), sets=tuple(sets))
    return tables


def _with_union(
    source: str, progress: ProgressLine, given: Mapping[str, Any], sets: Sequence[Component]
) -> Labelled:
    """Return the trials with the features of these sets together."""
    names = ", ".join(f'"{feature_set.qualified}"' for feature_set in sets)
    options = (*given["options"], f'features.type="{UNION}"', f"features.sets=[{names}]")
    return trials_of(source, progress, {**given, "options": options})


def _config(united: Labelled, component: Component, **keys: Any) -> Any:
    """Return the config that a feature set has in the union; `keys` replace some of it."""
    known = keys_of(component.config_class())
    given = {**united.provenance.get("settings", {}).get("features", {}), **keys}
    return build(component, {key: value for key, value in given.items() if key in known})


def _part(united: Labelled, component: Component, columns: NDArray[np.int64], **keys: Any) -> Labelled:
    """Return the trials with the features of one set, which are these columns of the union."""
    config = _config(united, component, **keys)
    table = FeatureTable(
        names=tuple(feature.name for feature in component.declared(config).features),
        units=tuple(united.table.units[k] for k in columns.tolist()),
        values=united.table.values[:, columns],
    )
    settings = {
        **united.provenance.get("settings", {}),
        "features": {"type": component.qualified, **plain(config)},
    }
    return evolve(united, table=table, provenance={**united.provenance, "settings": settings})


def pipeline_text(chosen: Chosen, model: str) -> str:
    """Return a pipeline file with what was chosen, and with the gripper and the controller of the trials."""
    settings = recipe(chosen.labelled.provenance.get("settings") or {})
    if settings.get("gripper", {}).get("type", "replay").endswith("replay"):
        settings.pop("gripper", None)  # that of the recordings is not known
    learner = chosen.learner
    settings["classifier"] = {
        "type": learner.component.qualified,
        **plain(learner.config),
        "model": os.path.realpath(model),
    }
    lines = [
        f"# Chosen by graspsense train --choose from {chosen.labelled.source}.".replace("\n", " "),
        f"# The rate of the whole procedure is {chosen.choice.rate.words}.",
        *toml_lines({"extends": "default", **settings}),
    ]
    return "\n".join(lines) + "\n"


def say_chosen(chosen: Chosen, use: str) -> None:
    """Print what was chosen, the rate of the procedure, what is as good, and the command that uses it."""
    choice = chosen.choice
    folds, same = sum(choice.chosen_in.values()), choice.chosen_in.get(choice.best.name, 0)
    stable = f"also in {same} of {folds} folds" if same else f"in each of {folds} folds another one"
    echo_entry("chosen", f"{choice.best.name}, of {len(choice.ranking.candidates)} candidates; {stable}")
    echo_entry(
        "rate",
        f"{choice.rate.words}, of the whole procedure by {choice.ranking.protocol}: no trial takes part in the choice "
        "that it is predicted by",
    )
    echo_entry("as good", choice.ranking.equals)
    echo_entries("note", choice.ranking.notes)
    echo_as_it_is(f"use it      graspsense {use}")
