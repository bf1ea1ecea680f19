"""The cases that the keys of an experiment describe: pipelines, variants and swept keys, with all errors in them."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from attrs import evolve

from graspsense.core.components.registry import installed
from graspsense.core.components.setting import worded
from graspsense.core.components.strict import InvalidValue, ValidationFailed, plain, structured
from graspsense.core.files.toml_text import KeyPath
from graspsense.core.learn.copies import without_copies
from graspsense.core.settings.layers import Flag, Layer, Merged, dotted
from graspsense.core.settings.resolved import Settings, resolve
from graspsense.core.settings.selected import build
from graspsense.core.values.errors import ConfigError, GraspsenseError, counted, suggestion
from graspsense.core.values.limits import CASES
from graspsense.experiments.experiment import (
    PIPELINE_TABLES,
    Experiment,
    ExperimentCase,
    LearnerSpec,
    PipelineOf,
    Planned,
    Variant,
)
from graspsense.experiments.kinds import kind_of
from graspsense.sources.identified import IDENTIFIED, identified_scenes
from graspsense.sources.input_content import contents_of
from graspsense.sources.simulated import number_of_trials as number_of_simulated_trials
from graspsense.sources.simulated import simulated_objects
from graspsense.sources.trial_source import (
    NO_OBJECT,
    SIMULATED,
    TrialSource,
    groups_of,
    labelled_trials,
    names_no_object,
    without_effect,
)

SWEPT_TABLES: Final = (*PIPELINE_TABLES, "classifier", "data", "test", "judge")
DEFAULT_CLASSIFIER: Final = "c45"
_SEEDS: Final = "the seeds of an experiment are its key `seeds`"


class CasePlan:
    """Expands an experiment to its cases, and collects all errors."""

    def __init__(self, name: str, experiment: Experiment, layer: Layer, *, force: bool) -> None:
        self.name, self.experiment, self.layer, self.force = name, experiment, layer, force
        self.complaints: list[str] = []

    def planned(self) -> Planned:
        """Return the experiment with its cases. Raises ConfigError that lists all errors."""
        experiment = self.experiment
        kind_of(experiment.kind)
        seeds = experiment.listed_seeds
        pipelines = {}
        for asked in experiment.pipelines:
            pipeline_of = (
                asked if isinstance(asked, PipelineOf) else PipelineOf(name=Path(asked).stem, pipeline=asked)
            )
            if pipeline_of.name in pipelines:
                raise ConfigError(
                    f"{self.layer.where(('pipelines',))}: two pipelines are called {pipeline_of.name!r}: name one of "
                    'them, { name = "...", pipeline = "..." }'
                )
            pipelines[pipeline_of.name] = resolve(pipeline_of.pipeline, force=self.force)
        if not pipelines:
            raise ConfigError(f"{self.layer.where(('pipelines',))}: pipelines: name at least one")
        if ("run", "seed") in self.layer.options:
            self._complain(("run", "seed"), _SEEDS)
        if experiment.classifiers == () and ("classifiers",) in self.layer.options:
            self._complain(("classifiers",), "an empty list names no classifier: leave it out")
        sweep = self._sweep()
        self._check_cases(sweep, len(pipelines))
        cases = []
        for pipeline, settings in pipelines.items():
            for variant in experiment.variants or (Variant(name=""),):
                for point in _points(sweep, "classifier", within=False):
                    levels: dict[str, Any] = {}
                    if len(pipelines) > 1:
                        levels["pipeline"] = pipeline
                    if experiment.variants:
                        levels["variant"] = variant.name
                    levels.update((dotted(path), value) for path, value in point)
                    cases.append(self._case(settings, variant, point, sweep, levels))
        self._check_names(cases)
        self._check_effect(cases, sweep)
        if self.complaints:
            raise ConfigError("\n".join(dict.fromkeys(self.complaints)))
        return Planned(
            name=self.name, experiment=experiment, cases=tuple(cases), seeds=seeds, pipelines=pipelines
        )

    def _check_names(self, cases: Sequence[ExperimentCase]) -> None:
        """Add an error for each name that several cases have: their results are told apart by it."""
        key = "variants" if self.experiment.variants else "sweep"
        for name, number in Counter(case.name for case in cases).items():
            if number > 1:
                self.complaints.append(
                    f"{self.layer.where((key,))}: {number} cases are called {name!r}: take out a value that is given "
                    "twice; give values that differ too little to show it as [[variants]], each with its own `name`"
                )

    def _check_effect(
        self, cases: Sequence[ExperimentCase], sweep: Mapping[tuple[str, ...], Sequence[Any]]
    ) -> None:
        """Add an error for each swept key that the trials cannot depend on, and for cases that are therefore equal."""
        seen: dict[str, ExperimentCase] = {}
        for case in cases:
            sources = [source for source in (case.data, case.test) if source is not None]
            if self.complaints or not sources:
                return
            inert = set.intersection(*map(without_effect, sources))
            if case.test is not None:
                inert |= {f"judge.{key}" for key in getattr(case.judge, "of_folds", ())}
            named = " and ".join(source.source for source in sources)
            keys = [dotted(path) for path in sweep if {path[0], dotted(path[:2])} & inert]
            twin = seen.setdefault(_what_matters(case, inert), case)
            if not keys and twin is not case:
                keys = [key for key in case.levels if case.levels[key] != twin.levels[key]]
            for key in keys:
                if key == "run.seed":
                    why = _SEEDS
                elif key.startswith("judge."):
                    why = f"all trials of {named} are learned from or tested on, without folds and controls"
                else:
                    why = (
                        f"the trials of {named} do not depend on what differs. Vary a key of [classifier], [judge] or "
                        f'[data] that they depend on, or simulate the trials (data.source = "{SIMULATED}")'
                    )
                self.complaints.append(
                    f"{self.layer.where(('sweep', key))}: {key} makes no difference: {why}"
                )

    def _check_cases(self, sweep: Mapping[tuple[str, ...], Sequence[Any]], pipelines: int) -> None:
        """Raise ConfigError if there are too many cases, before any of them is made."""
        experiment = self.experiment
        cases = pipelines * max(len(experiment.variants), 1) * max(len(experiment.classifiers), 1)
        cases *= math.prod(len(values) for values in sweep.values())
        if too_many := CASES.exceeded(cases):
            raise ConfigError(f"{self.layer.label}: {too_many}")

    def _sweep(self) -> dict[tuple[str, ...], Sequence[Any]]:
        """Return the values of each swept key, by its path."""
        sweep: dict[tuple[str, ...], Sequence[Any]] = {}
        places: dict[KeyPath, KeyPath] = {}

        def take(path: tuple[str, ...], value: Any, where: tuple[str, ...]) -> None:
            if isinstance(value, Mapping):
                for key, inner in value.items():
                    take((*path, *key.split(".")), inner, (*where, key))
                return
            place = f"{self.layer.where(('sweep', *where))}: sweep.{dotted(path)}"
            if path[0] not in SWEPT_TABLES or len(path) < 2:
                near = suggestion(path[0], SWEPT_TABLES)
                self.complaints.append(
                    f"{place}: no such table.{near} A sweep can have keys of {', '.join(SWEPT_TABLES)}"
                )
            elif not isinstance(value, list) or not value:
                self.complaints.append(f"{place}: give a list of values, such as [17.0, 20.0, 23.0]")
            elif path in self.layer.options:
                typed = self.layer.options[path]
                self.complaints.append(
                    f"{typed}: this experiment varies it: set sweep.{dotted(path)}, a list"
                )
            else:
                sweep[path] = value
                places[path] = ("sweep", *where)

        for key, value in self.experiment.sweep.items():
            take(tuple(key.split(".")), value, (key,))
        typed = self.layer.options
        swept = {path: typed[place] for path, place in places.items() if place in typed}
        self.layer = evolve(self.layer, options={**typed, **swept})
        return sweep

    def _case(
        self,
        pipeline: Settings,
        variant: Variant,
        point: Sequence[tuple[tuple[str, ...], Any]],
        sweep: Mapping[tuple[str, ...], Sequence[Any]],
        levels: dict[str, Any],
    ) -> ExperimentCase:
        experiment = self.experiment
        merged = Merged()
        merged.add((), _tables(experiment), self.layer)
        merged.add((), _tables(variant), self.layer)
        for path, value in point:
            merged.add((), Flag("sweep", ".".join(path), value).layer().values, self.layer)
        values = merged.values
        data = self._keys(values.get("data", {}), TrialSource, "data")
        test = self._keys(values["test"], TrialSource, "test") if values.get("test") else None
        over = {table: values[table] for table in PIPELINE_TABLES if values.get(table)}
        fingertips = self._fingertips(data, test)
        if fingertips:
            # What the file says of the gripper stays: it may be what the experiment varies.
            over["gripper"] = {**fingertips, **over.get("gripper", {})}
        settings = resolve(
            pipeline.pipeline,
            experiment=evolve(self.layer, values=over),
            force=self.force,
        )
        name = ", ".join(in_a_name(key, value) for key, value in levels.items())
        if any(source is not None and source.kind == SIMULATED for source in (data, test)):
            simulated_objects(settings)
        kind = kind_of(experiment.kind)
        if data is not None and kind.declared.entry.simulates:
            if test is not None:
                self._complain(
                    ("test",), f"experiments of the kind {experiment.kind!r} test on trials of [data] alone"
                )
            try:
                groups_of(data)
            except ConfigError as error:
                raise ConfigError(f"{self.layer.where(('data', 'source'))}: {error}") from error
        judge = self._keys(values.get("judge", {}), kind.keys_class(), "judge")
        if test is None and data is not None and judge is not None:
            self._check_folds(settings, data, judge)
        return ExperimentCase(
            name=name,
            levels=levels,
            settings=settings,
            data=data,
            test=test,
            learners=tuple(self._learners(pipeline, values.get("classifier", {}), sweep)),
            judge=judge,
            kind=experiment.kind,
        )

    def _fingertips(self, data: TrialSource | None, test: TrialSource | None) -> dict[str, float]:
        """Return the settings of the fingertips that the scenes of `identified:` were recorded with."""
        variants: dict[str, dict[str, float]] = {}
        for table, source in (("data", data), ("test", test)):
            if source is None or not source.source.startswith(IDENTIFIED):
                continue
            try:
                variants[table] = dict(identified_scenes(source.source)[0].gripper)
            except GraspsenseError as error:
                self.complaints.append(f"{self.layer.where((table,))}: {error}")
        if len(variants) > 1 and variants["data"] != variants["test"]:
            self.complaints.append(
                f"{self.layer.where(('test',))}: the scenes of [data] and [test] were identified with different "
                "fingertips ([identified.gripper]): their squeezes cannot be compared"
            )
        return next(iter(variants.values()), {})

    def _check_folds(self, settings: Settings, data: TrialSource, judge: Any) -> None:
        """Add an error if there are more folds than trials, because every task of the case would fail.

        Forced, the data are not read: results are shown also where their data are not.
        """
        folds = getattr(judge, "folds", None)
        if folds is None or self.force:
            return
        try:
            trials = number_of_trials(settings, data)
        except GraspsenseError as error:
            self.complaints.append(f"{self.layer.where(('data',))}: {error}")
            return
        if trials is not None and folds > trials:
            text = (
                f"{folds} folds of {counted(trials, 'trial')}: give at most as many folds as there are trials"
            )
            self._complain(("judge", "folds"), text)

    def _complain(self, path: KeyPath, text: str) -> None:
        """Add an error in a key of the file."""
        self.complaints.append(self.layer.complain(InvalidValue(path, text)))

    def _keys(self, values: Mapping[str, Any], cls: type, table: str) -> Any:
        if cls is TrialSource and names_no_object(values):
            self._complain((table, "objects"), NO_OBJECT)
        try:
            return structured(values, cls, f"[{table}]")
        except ValidationFailed as misfit:
            self.complaints += [self.layer.complain(problem) for problem in misfit.under(table)]
            return None

    def _learners(
        self,
        pipeline: Settings,
        variant: Mapping[str, Any],
        sweep: Mapping[tuple[str, ...], Sequence[Any]],
    ) -> Iterator[LearnerSpec]:
        """Yield every classifier with every combination of its swept keys."""
        given = self.experiment.classifiers
        if not given:
            chosen = pipeline.classifier
            given = (
                (DEFAULT_CLASSIFIER,)
                if chosen is None
                else (
                    {
                        "name": chosen.component.name,
                        "type": chosen.component.qualified,
                        **_fresh(chosen.config),
                    },
                )
            )
        seen: set[str] = set()
        for index, spec in enumerate(given):
            table = {"type": spec} if isinstance(spec, str) else dict(spec)
            called = str(table.pop("name", table.get("type", "")).rpartition("/")[2])
            for point in _points(sweep, "classifier", within=True):
                merged = Merged({**table, **variant})
                for path, value in point:
                    merged.add((), Flag("sweep", ".".join(path[1:]), value).layer().values, self.layer)
                try:
                    component = installed().find("classifier", str(merged.values.pop("type")))
                    config = _fresh(build(component, merged.values, force=self.force))
                except (KeyError, GraspsenseError) as error:
                    missing = isinstance(error, KeyError)
                    self._complain(
                        ("classifiers", index), "a classifier needs a `type`" if missing else str(error)
                    )
                    return
                name = ", ".join([called, *(in_a_name(path[-1], value) for path, value in point)])
                if name in seen:
                    self._complain(
                        ("classifiers", index), f"two classifiers are called {name!r}: give one a `name`"
                    )
                seen.add(name)
                yield LearnerSpec(name=name, type=component.qualified, config=config)


def _what_matters(case: ExperimentCase, inert: set[str]) -> str:
    """Return everything that the result of a case depends on, as text."""
    params = case.params
    params["settings"]["run"].pop("seed", None)  # a task has the seed of the experiment
    params["settings"] = {table: keys for table, keys in params["settings"].items() if table not in inert}
    for name, table in (("data", "data"), ("test", "data"), ("judge", "judge")):
        keys = params[name] or {}
        params[name] = {key: value for key, value in keys.items() if f"{table}.{key}" not in inert}
    return repr(params)


_COUNTED: Final[dict[str, int]] = {}
"""Numbers of trials by table and content: every case of an experiment asks for that of the same table."""


def number_of_trials(settings: Settings, data: TrialSource) -> int | None:
    """Return the number of trials of a source, None for a data set, which would have to be read."""
    if data.kind == SIMULATED:
        return number_of_simulated_trials(settings, groups_of(data))
    if data.kind != "CSV":
        return None
    table = repr((data, contents_of([data.source], code=False)))
    if table not in _COUNTED:
        trials = labelled_trials(data, settings=lambda: settings, features=settings.features.create)
        _COUNTED[table] = len(without_copies(trials))
    return _COUNTED[table]


def in_a_name(key: str, value: Any) -> str:
    """Return a key with its value in words: `probing force 20 N`; what has a name of its own by that alone."""
    if key in ("part", "pipeline", "variant"):
        return str(value)
    return " ".join(
        worded(key.rpartition(".")[2], shown(value) if isinstance(value, list | tuple) else value)
    )


def shown(value: Any) -> str:
    """Return a value as text for the name of a case."""
    if isinstance(value, float):
        return repr(value).removesuffix(".0")
    if isinstance(value, list | tuple):
        return "+".join(map(shown, value))
    return str(value)


def _fresh(config: Any) -> dict[str, Any]:
    """Return the keys of a classifier that are set, without a trained model."""
    return {key: value for key, value in plain(config).items() if value is not None and key != "model"}


def _tables(experiment: Experiment | Variant) -> dict[str, Mapping[str, Any]]:
    return {
        table: dict(getattr(experiment, table)) for table in SWEPT_TABLES if getattr(experiment, table, None)
    }


def _points(
    sweep: Mapping[tuple[str, ...], Sequence[Any]], table: str, *, within: bool
) -> list[tuple[tuple[tuple[str, ...], Any], ...]]:
    """Return every combination of the swept keys of this table, or, if not `within`, of all other tables."""
    chosen = {path: values for path, values in sweep.items() if (path[0] == table) is within}
    return [tuple(zip(chosen, values, strict=True)) for values in itertools.product(*chosen.values())]
