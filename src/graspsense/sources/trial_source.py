"""Sources of labelled trials: a CSV of features, a data set that a plugin reads, or simulation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, Final, Literal

from attrs import evolve, field, fields_dict, frozen

from graspsense.core.components.roles import FeatureSet
from graspsense.core.components.strict import ValidationFailed, structured
from graspsense.core.learn.checkpoints import with_checkpoints
from graspsense.core.learn.labelled import Labelled, rows_of_class
from graspsense.core.settings.layers import KINDS, read_toml, toml_kind
from graspsense.core.settings.resolved import Settings
from graspsense.core.values.errors import ConfigError, PluginUnavailable, suggestion
from graspsense.core.values.label_text import alike_words, spelled_alike
from graspsense.core.values.trace import Trace
from graspsense.sources.identified import IDENTIFIED, gripper_flags, identified_scenes
from graspsense.sources.simulated import Group, plan_trials, simulated
from graspsense.store.opening import STORE, as_source

SIMULATED: Final = "simulated"
_OF_TOML: Final = {
    "pipeline": "Trials are simulated with it by the source `simulated` and this pipeline",
    "scene": "Trials of it are simulated by the source `simulated` and this file among the objects",
    "experiment": "Run it: graspsense experiment FILE",
    "manifest": "Its recordings are the source manifest:FILE",
}
Kind = Literal["CSV", "data set", "simulated"]


@frozen(kw_only=True)
class TrialSource(Group):
    """Labelled trials, as a user describes them.

    `source` is `simulated`, scenes of `graspsense identify` (`identified:cup.toml,mug.toml`), the name of a CSV, or a
    data set with its folder (`icub:FOLDER`, `store:DIR`).
    """

    source: str = field(default=SIMULATED, converter=as_source)
    only: str | None = None
    """Use the trials of this class only."""
    groups: tuple[Group, ...] = ()
    """simulated: several groups of trials, in place of the one that the keys of this table describe."""
    label: str | None = None
    """CSV: the column with the label. Likewise `instance` and `order`."""
    instance: str | None = None
    order: str | None = None
    columns: tuple[str, ...] = ()
    """CSV: the columns to learn from; empty for all columns of numbers."""
    known_before: tuple[str, ...] = field(default=(), alias="before")
    """CSV: columns that are known before contact."""
    value: str | None = None
    """CSV, store: the column, or the number among the labels, that is to be predicted in place of the label."""
    unreliable: bool = False
    """Data set: whether to include trials that its author calls unreliable."""
    checkpoints_s: tuple[float, ...] = ()
    """Times after the contact at which the features are extracted as well, as by `CheckpointFeatures`."""

    @property
    def kind(self) -> Kind:
        """The kind of source. Raises ConfigError if the text names no source."""
        return kind_of(self.source)


KEYS_OF_KIND: Final[Mapping[Kind, tuple[str, ...]]] = {
    "simulated": (*fields_dict(Group), "groups"),
    "CSV": ("label", "instance", "order", "columns", "before"),
    "data set": ("unreliable",),
}
"""The keys of a source that are for one kind of it."""


def without_effect(source: TrialSource) -> set[str]:
    """Return the tables of a pipeline, and the keys of a source as `data.KEY`, that its trials do not depend on."""
    inert = {"simulated": (), "CSV": ("gripper", "controller", "features", "run", "data.checkpoints_s")}.get(
        source.kind, ("gripper", "controller", "run")
    )
    others = (key for kind, keys in KEYS_OF_KIND.items() if kind != source.kind for key in keys)
    return {*inert, *(f"data.{key}" for key in others)}


NO_OBJECT: Final = "an empty list names no object: leave it out for the default ones, or name some"


def names_no_object(keys: Mapping[str, Any]) -> bool:
    """Return whether these keys of a source, or those of a group in it, have an empty list of objects."""
    tables = (keys, *(group for group in keys.get("groups", ()) if isinstance(group, Mapping)))
    return any(table.get("objects") in ([], ()) and not table.get("named") for table in tables)


def described_trials(source: str, keys: Mapping[str, Any], called: Callable[[Any], str]) -> TrialSource:
    """Return the source with these keys. Raises ConfigError, which calls a wrong key as its user does."""
    try:
        return structured({**keys, "source": source}, TrialSource, source)
    except ValidationFailed as misfit:
        problems = [f"{called(problem.path[0])}: {problem.words()}" for problem in misfit.problems]
        raise ConfigError("\n".join(problems)) from None


def load_trials(
    source: str = SIMULATED,
    *,
    pipeline: str = "default",
    options: Sequence[str] = (),
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
    **keys: Any,
) -> Labelled:
    """Return labelled trials, each once: `simulated`, a CSV of features, or a data set as `store:FOLDER`.

    `pipeline` and `options` (`"features.type=chitta"`) select the components that simulate trials, or compute their
    features; `keys` are the further fields of `TrialSource`, such as `label` or `objects`. Raises ConfigError,
    DataDamaged.
    """
    from graspsense.core.learn.copies import without_copies
    from graspsense.core.settings.resolved import resolve

    if names_no_object(keys):
        raise ConfigError(f"objects: {NO_OBJECT}")
    described = described_trials(source, keys, str)
    settings = cache(lambda: resolve(pipeline, options=options, flags=gripper_flags(source)))
    return without_copies(
        labelled_trials(
            described,
            settings=settings,
            features=lambda: settings().features.create(),
            options=options,
            seed=seed,
            progress=progress,
        )
    )


_NO_SOURCES: Final = {
    ".npz .parquet .pq .json": "is not read as a table of trials: write the table as FILE.csv. If it is of a store, "
    "name the store as store:DIR",
    ".mcap .bag .db3 .npy .mat .h5 .hdf5": "is a recording, not a source of labelled trials: graspsense import "
    "{source} --save DIR --label CLASS:STATE makes a trial of it",
}
"""Endings of files that are no source of trials, and what to do with them."""


def kind_of(source: str) -> Kind:
    """Return the kind of source that this text names. Raises ConfigError if it names none."""
    if source == SIMULATED or source.startswith(IDENTIFIED):
        return "simulated"
    for endings, why in _NO_SOURCES.items():
        if source.lower().endswith(tuple(endings.split())) and Path(source).is_file():
            raise ConfigError(f"{source} {why.format(source=source)}")
    if source.lower().endswith(".toml") and Path(source).is_file():
        kind = toml_kind(read_toml(Path(source), source, "TOML").values)
        called = KINDS[kind].called if kind else "a TOML file"
        raise ConfigError(f"{source} is {called}, not a source of trials. {_OF_TOML.get(kind, '')}".rstrip())
    if source.lower().endswith((".csv", ".tsv", ".txt", ".arff")) or Path(source).is_file():
        return "CSV"
    if ":" in source:
        return "data set"
    raise ConfigError(
        f"{source!r} is not a source of trials: name a FILE.csv, recordings as manifest:FILE.toml, a data set as "
        f"icub:FOLDER, a store as store:DIR, `{SIMULATED}`, or scenes of `graspsense identify` as "
        f"{IDENTIFIED}cup.toml,mug.toml.{suggestion(source, [SIMULATED])}"
    )


def labelled_trials(
    source: TrialSource,
    *,
    settings: Callable[[], Settings],
    features: Callable[[], FeatureSet[Any]],
    options: Sequence[str] = (),
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
    on_trace: Callable[[int, str, Trace], None] | None = None,
) -> Labelled:
    """Return the trials that a source describes, with copies of a trial: `without_copies` is for what learns from them.

    `settings` is called if trials are simulated, `features` if a data set extracts features from recordings. With
    `options` as after `-o`, except those of the classifier, the features of a store are extracted again. `seed` and
    `on_trace` are for the simulator. Raises ConfigError, DataDamaged.
    """
    changed = [option for option in options if option.partition(".")[0].strip() != "classifier"]
    if source.value is not None and source.kind != "CSV" and not source.source.startswith(STORE):
        raise ConfigError(f"{source.source} has no numbers to predict: they are in a CSV file or in a store")
    if source.kind == "simulated":
        pipeline, groups = settings(), groups_of(source)
        if source.only:
            rows_of_class(plan_trials(pipeline, groups, seed).labels, source.only, source.source)
        trials = simulated(
            pipeline,
            groups=groups,
            seed=seed,
            progress=progress,
            on_trace=on_trace,
            checkpoints_s=source.checkpoints_s,
        )
    elif source.kind == "CSV":
        from graspsense.sources.trial_table.features_csv import read_labelled

        trials = read_labelled(
            Path(source.source),
            source.label,
            instance=source.instance,
            order=source.order,
            features=source.columns,
            known_before=source.known_before,
            value=source.value,
        )
    elif source.source.startswith(STORE) and (changed or source.value is not None or source.checkpoints_s):
        from graspsense.store.dataset import labelled_store

        folder = source.source.removeprefix(STORE)
        trials = labelled_store(
            folder, changed, value=source.value, checkpoints_s=source.checkpoints_s, progress=progress
        )
    else:
        trials = _data_set(source, features())
    if pairs := spelled_alike(trials.labels):
        said = f"labels that differ in spelling only count as two: {alike_words(pairs)}"
        trials = evolve(trials, notes=(*trials.notes, said))
    return trials.of_class(source.only) if source.only else trials


def groups_of(source: TrialSource) -> tuple[Group, ...]:
    """Return the groups of simulated trials that a source describes. Raises ConfigError, also for recorded trials."""
    if source.kind != "simulated":
        raise ConfigError(
            f"{source.source} has recorded trials, and here they are simulated: leave the source out"
        )
    keys: Mapping[str, Any] = {name: getattr(source, name) for name in fields_dict(Group)}
    own = Group(**keys)
    if source.source.startswith(IDENTIFIED):
        if own.objects or own.named or source.groups:
            raise ConfigError(
                f"{source.source} names the objects itself: leave out objects, named and groups"
            )
        return (evolve(own, named={scene.label: scene.path for scene in identified_scenes(source.source)}),)
    if source.groups and evolve(own, states_per_instance="all") != Group():
        raise ConfigError("trials are described both by keys of [data] and by [[data.groups]]: leave one out")
    groups = source.groups or (own,)
    if source.states_per_instance == "all":
        return groups
    return tuple(evolve(group, states_per_instance=source.states_per_instance) for group in groups)


def _data_set(source: TrialSource, features: FeatureSet[Any]) -> Labelled:
    from graspsense.core.components.entries import DatasetEntry
    from graspsense.core.components.registry import installed

    name, _, folder = source.source.partition(":")
    if not folder:
        raise ConfigError(f"{source.source!r} names no folder: write it after the colon")
    dataset = installed().resource(DatasetEntry, name)
    if not dataset.entry.target:
        from graspsense.sources.recordings.labelled_recordings import labelled_recordings

        return labelled_recordings(name, folder, features, source.checkpoints_s)
    trials = dataset.load()(
        folder, with_checkpoints(features, source.checkpoints_s), unreliable=source.unreliable
    )
    if not isinstance(trials, Labelled):
        raise PluginUnavailable(
            f"data set {name!r} cannot be used here: its reader gave {type(trials).__name__}, not Labelled"
        )
    return trials
