"""The file of an experiment, and the cases and tasks that it describes (docs/experiments.md)."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from attrs import evolve, field, frozen

from graspsense.core.components.config import Settings, build_plausible, default_paths, resolve
from graspsense.core.components.entries import TABLE_OF_ROLE, ExperimentEntry
from graspsense.core.components.layers import Layer, Merged, dotted, option_layers, read_toml, typed_path
from graspsense.core.components.nearest_key import key_paths
from graspsense.core.components.registry import Resource, installed
from graspsense.core.components.setting import worded
from graspsense.core.components.strict import InvalidValue, ValidationFailed, keys_of, plain, structured
from graspsense.core.learn.copies import without_copies
from graspsense.core.values.errors import ConfigError, GraspsenseError, UnknownName, counted, suggestion
from graspsense.core.values.limits import CASES
from graspsense.experiments.kinds import kind_of
from graspsense.experiments.task import Task
from graspsense.sources.identified import IDENTIFIED, identified_scenes
from graspsense.sources.input_content import contents_of, input_names, located_text
from graspsense.sources.simulated import LARGEST_SEED, simulated_objects
from graspsense.sources.simulated import number_of_trials as number_of_simulated_trials
from graspsense.sources.trial_source import (
    SIMULATED,
    TrialSource,
    groups_of,
    keys_without_effect,
    labelled_trials,
    tables_without_effect,
)

PIPELINE_TABLES: Final = (*(table for table in TABLE_OF_ROLE.values() if table != "classifier"), "run")
SWEPT_TABLES: Final = (*PIPELINE_TABLES, "classifier", "data", "test", "judge")
DEFAULT_CLASSIFIER: Final = "c45"
MOST_SEEDS: Final = 10_000
"""Largest number of seeds; intervals hardly narrow with more."""


def _seeds(experiment: object, attribute: object, value: int | tuple[int, ...]) -> None:
    if isinstance(value, int) and value < 1:
        raise ValueError(f"{value} seeds: give at least 1, or a list of seeds")
    number = value if isinstance(value, int) else len(value)
    if number > MOST_SEEDS:
        raise ValueError(f"{number} seeds: give at most {MOST_SEEDS}; every case has one task for each seed")
    if not isinstance(value, int) and value and max(value) > LARGEST_SEED:
        raise ValueError(f"{max(value)} as a seed: give at most {LARGEST_SEED}")
    if not isinstance(value, int) and (not value or len(set(value)) < len(value) or min(value) < 0):
        raise ValueError("seeds: give their number, or a list of different integers from 0 on")


@frozen(kw_only=True)
class PipelineOf:
    """A pipeline with a name to show."""

    name: str
    pipeline: str
    """The name or the file of a pipeline."""


@frozen(kw_only=True)
class Variant:
    """A case that differs from the others in several keys at once."""

    name: str
    gripper: Mapping[str, Any] = field(factory=dict)
    controller: Mapping[str, Any] = field(factory=dict)
    features: Mapping[str, Any] = field(factory=dict)
    run: Mapping[str, Any] = field(factory=dict)
    classifier: Mapping[str, Any] = field(factory=dict)
    data: Mapping[str, Any] = field(factory=dict)
    test: Mapping[str, Any] = field(factory=dict)
    judge: Mapping[str, Any] = field(factory=dict)


@frozen(kw_only=True)
class Experiment:
    """The keys of an experiment file."""

    title: str
    question: str = ""
    kind: str = "recognise"
    parts: tuple[str, ...] = ()
    """Names or files of the experiments that this one consists of. Its seeds apply to all; it has no cases itself."""
    seeds: int | tuple[int, ...] = field(default=1, validator=_seeds)
    """Number of seeds, or a list of them. Each seed has its own simulated trials and its own folds."""
    pipelines: tuple[str | PipelineOf, ...] = ("default",)
    gripper: Mapping[str, Any] = field(factory=dict)
    """Keys that override those of all pipelines. Likewise `controller`, `features` and `run`."""
    controller: Mapping[str, Any] = field(factory=dict)
    features: Mapping[str, Any] = field(factory=dict)
    run: Mapping[str, Any] = field(factory=dict)
    classifiers: tuple[str | Mapping[str, Any], ...] = ()
    """Names, or tables with a `type`, a `name` to show, and keys. Default: that of the pipeline, or c45."""
    variants: tuple[Variant, ...] = ()
    sweep: Mapping[str, Any] = field(factory=dict)
    """Keys such as `controller.probing_force_n`, each with a list of values; every combination is a case."""
    data: Mapping[str, Any] = field(factory=dict)
    """Keys of `graspsense.sources.trial_source.TrialSource`."""
    test: Mapping[str, Any] = field(factory=dict)
    """Other trials to test on, instead of cross-validation."""
    judge: Mapping[str, Any] = field(factory=dict)
    """Keys that the kind of the experiment defines, such as `graspsense.experiments.recognise.EvaluationSettings`."""


@frozen(kw_only=True, eq=False)
class LearnerSpec:
    """A classifier to evaluate: its name in results, its qualified name, and its keys."""

    name: str
    type: str
    config: Mapping[str, Any]


@frozen(kw_only=True, eq=False)
class ExperimentCase:
    """One of the cases that are compared: its name, its differences from the others, and all that defines its tasks."""

    name: str
    levels: Mapping[str, Any]
    """The values of `pipeline`, `variant` and the swept keys (except those of the classifier) in this case."""
    settings: Settings
    data: TrialSource
    test: TrialSource | None
    learners: tuple[LearnerSpec, ...]
    judge: Any
    kind: str = "recognise"
    part: str = ""
    """Name of the part of the experiment that the case belongs to, if the experiment has parts."""


@frozen(kw_only=True, eq=False)
class Planned:
    """An experiment whose file was read and checked, with its cases.

    `pipelines` are the resolved pipelines by the names that the experiment gives them. `inputs` are the hashes of all
    that the tasks read, by the texts that name it (`contents_of`): a task with another input is another task.
    """

    name: str
    experiment: Experiment
    cases: tuple[ExperimentCase, ...]
    seeds: tuple[int, ...]
    pipelines: Mapping[str, Settings]
    parts: tuple[Planned, ...] = ()
    inputs: Mapping[str, str] = field(factory=dict)

    def tasks(self) -> list[Task]:
        """Return every task: all cases with the first seed, then all with the second, and so on."""
        return [self.task(case, seed) for seed in self.seeds for case in self.cases]

    def task(self, case: ExperimentCase, seed: int) -> Task:
        """Return the task for a case and a seed."""
        params = self._params(case, is_first=seed == self.seeds[0])
        own = {text: self.inputs[text] for text in input_names(params) if text in self.inputs}
        params = {**params, "inputs": own} if own else params
        return Task(kind=case.kind, params=params, seed=seed, name=f"{case.name}, seed {seed}".lstrip(", "))

    def with_inputs(self) -> Planned:
        """Return the experiment with the present content of its inputs."""
        return evolve(self, inputs=contents_of([self._params(case, is_first=True) for case in self.cases]))

    def _params(self, case: ExperimentCase, *, is_first: bool) -> dict[str, Any]:
        return {
            "settings": {
                table: {key: value for key, value in case.settings.values[table].items() if value is not None}
                for table in PIPELINE_TABLES
            },
            "data": plain(case.data),
            "test": None if case.test is None else plain(case.test),
            "learners": [
                {"name": learner.name, "type": learner.type, "config": dict(learner.config)}
                for learner in case.learners
            ],
            "judge": plain(case.judge),
            "first": is_first,
        }


def shipped() -> dict[str, Resource[ExperimentEntry]]:
    """Return the experiments that graspsense and plugins ship by their names, qualified where two share a name."""
    known = installed().resources(ExperimentEntry)
    times = Counter(resource.name for resource in known)
    return {
        resource.name if times[resource.name] == 1 else resource.qualified: resource for resource in known
    }


def read_experiment(
    asked: str, options: Sequence[str] = (), within: Sequence[str] = (), *, force: bool = False
) -> Planned:
    """Read an experiment of graspsense by name, or a `.toml` file; `options` override its keys as `-o` does.

    `within` names the experiments that this one is a part of. `force` accepts settings outside of their plausible
    ranges. Raises ConfigError that lists all errors with their files and lines.
    """
    layer, base, name = _found(asked)
    identity = asked if base is None else str(Path(asked).expanduser().resolve())
    if identity in within:
        chain = " > ".join(Path(path).name for path in (*within, identity))
        raise ConfigError(f"{layer.label}: an experiment cannot be a part of itself: {chain}")
    within = (*within, identity)
    layers, complaints = option_layers(options)
    merged = Merged()
    merged.add((), _located(layer.values, base), layer)
    for option in layers:
        merged.add((), option.values, option)
    values = merged.values
    try:
        experiment = structured(values, Experiment, "an experiment")
    except ValidationFailed as misfit:
        known = _known_paths(values)
        for problem in misfit.problems:
            owner = merged.owner_of(problem.path) or layer
            if owner.typed and problem.known is not None:
                problem = evolve(problem, path=typed_path(owner))
            complaints.append(owner.complain(problem, known))
        experiment = None
    if experiment is None or complaints:
        raise ConfigError("\n".join(complaints))
    if experiment.parts:
        planned = _of_parts(name, experiment, layer, within, force=force)
    else:
        planned = _Plan(name, experiment, layer, force=force).planned()
    return planned.with_inputs() if len(within) == 1 else planned


def _known_paths(values: Mapping[str, Any]) -> list[str]:
    """Return the paths of the keys that the tables of an experiment can have, for one that is misspelt."""
    paths = [*key_paths(keys_of(TrialSource), "data"), *key_paths(keys_of(TrialSource), "test")]
    with suppress(GraspsenseError):
        kind = kind_of(str(values.get("kind", "recognise")))
        paths += key_paths(keys_of(kind.keys_class()), "judge")
    return [*paths, *default_paths(PIPELINE_TABLES)]


def _of_parts(
    name: str, experiment: Experiment, layer: Layer, within: Sequence[str], *, force: bool
) -> Planned:
    """Return the experiment with the cases of all parts; the name of a case starts with that of its part."""
    kind_of(experiment.kind)
    if len(set(experiment.parts)) < len(experiment.parts):
        raise ConfigError(f"{layer.where(('parts',))}: a part is named twice")
    seeds = _listed(experiment.seeds)
    parts: list[Planned] = []
    for asked in experiment.parts:
        parts.append(read_experiment(asked, [f"seeds={list(seeds)}"], within, force=force))
        if too_many := CASES.exceeded(sum(len(part.cases) for part in parts)):
            raise ConfigError(f"{layer.where(('parts',))}: {too_many}")
    pipelines: dict[str, Settings] = {}
    cases: list[ExperimentCase] = []
    for part in parts:
        for called, settings in part.pipelines.items():
            if called in pipelines and pipelines[called].values != settings.values:
                raise ConfigError(
                    f"{layer.where(('parts',))}: two parts have different pipelines called {called!r}: rename one"
                )
            pipelines[called] = settings
        for case in part.cases:
            where = f"{part.name}: {case.name}" if case.name else part.name
            cases.append(evolve(case, name=where, levels={"part": part.name, **case.levels}, part=part.name))
    if len({part.name for part in parts}) < len(parts):
        raise ConfigError(
            f"{layer.where(('parts',))}: two parts have the same name: {', '.join(experiment.parts)}"
        )
    return Planned(
        name=name,
        experiment=experiment,
        cases=tuple(cases),
        seeds=seeds,
        pipelines=pipelines,
        parts=tuple(parts),
    )


def _listed(seeds: int | tuple[int, ...]) -> tuple[int, ...]:
    return tuple(range(seeds)) if isinstance(seeds, int) else seeds


class _Plan:
    """Expands an experiment to its cases, and collects all errors."""

    def __init__(self, name: str, experiment: Experiment, layer: Layer, *, force: bool) -> None:
        self.name, self.experiment, self.layer, self.force = name, experiment, layer, force
        self.complaints: list[str] = []

    def planned(self) -> Planned:
        """Return the experiment with its cases. Raises ConfigError that lists all errors."""
        experiment = self.experiment
        kind_of(experiment.kind)
        seeds = _listed(experiment.seeds)
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
        self._check_effect(cases, sweep)
        if self.complaints:
            raise ConfigError("\n".join(dict.fromkeys(self.complaints)))
        return Planned(
            name=self.name, experiment=experiment, cases=tuple(cases), seeds=seeds, pipelines=pipelines
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
            inert = set.intersection(*(set(_without_effect(source)) for source in sources))
            named = " and ".join(source.source for source in sources)
            keys = [dotted(path) for path in sweep if {path[0], dotted(path[:2])} & inert]
            twin = seen.setdefault(_what_matters(case, inert), case)
            if not keys and twin is not case:
                keys = [key for key in case.levels if case.levels[key] != twin.levels[key]]
            for key in keys:
                self.complaints.append(
                    f"{self.layer.where(('sweep', key))}: {key} makes no difference: the trials of {named} do not "
                    "depend on what differs. Vary a key of [classifier], [judge] or [data] that they depend on, or "
                    f'simulate the trials (data.source = "{SIMULATED}")'
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
            else:
                sweep[path] = value

        for key, value in self.experiment.sweep.items():
            take(tuple(key.split(".")), value, (key,))
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
        values = merged.values
        for path, value in point:
            _put(values, path, value)
        data = self._keys(values.get("data", {}), TrialSource, "data")
        test = self._keys(values["test"], TrialSource, "test") if values.get("test") else None
        over = {table: values[table] for table in PIPELINE_TABLES if values.get(table)}
        fingertips = self._fingertips(data, test)
        if fingertips:
            # What the file says of the gripper stays: it may be what the experiment varies.
            over["gripper"] = {**fingertips, **over.get("gripper", {})}
        settings = resolve(
            pipeline.pipeline,
            experiment=Layer(label=self.layer.label, values=over, lines=self.layer.lines),
            force=self.force,
        )
        name = ", ".join(
            str(value) if key in ("pipeline", "variant") else in_a_name(key, value)
            for key, value in levels.items()
        )
        if any(source is not None and source.kind == SIMULATED for source in (data, test)):
            simulated_objects(settings)
        judge = self._keys(values.get("judge", {}), kind_of(experiment.kind).keys_class(), "judge")
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
        """Add an error if there are more folds than trials, because every task of the case would fail."""
        folds = getattr(judge, "folds", None)
        if folds is None:
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
            self.complaints.append(self.layer.complain(InvalidValue(("judge", "folds"), text)))

    def _keys(self, values: Mapping[str, Any], cls: type, table: str) -> Any:
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
                keys = {**table, **variant}
                for path, value in point:
                    _put(keys, path[1:], value)
                try:
                    component = installed().find("classifier", str(keys.pop("type")))
                    config = _fresh(build_plausible(component, keys, force=self.force))
                except KeyError:
                    self.complaints.append(
                        self.layer.complain(
                            InvalidValue(("classifiers", index), "a classifier needs a `type`")
                        )
                    )
                    return
                except GraspsenseError as error:
                    self.complaints.append(
                        self.layer.complain(InvalidValue(("classifiers", index), str(error)))
                    )
                    return
                name = ", ".join([called, *(in_a_name(path[-1], value) for path, value in point)])
                if name in seen:
                    text = f"two classifiers are called {name!r}: give one a `name`"
                    self.complaints.append(self.layer.complain(InvalidValue(("classifiers", index), text)))
                seen.add(name)
                yield LearnerSpec(name=name, type=component.qualified, config=config)


def _without_effect(source: TrialSource) -> list[str]:
    """Return the tables, and the keys of [data], that the trials of a source do not depend on."""
    return [*tables_without_effect(source), *(f"data.{key}" for key in keys_without_effect(source))]


def _what_matters(case: ExperimentCase, inert: set[str]) -> str:
    """Return everything that the result of a case depends on, as text."""
    tables = {table: case.settings.values[table] for table in PIPELINE_TABLES if table not in inert}
    sources = [
        {key: value for key, value in plain(source).items() if f"data.{key}" not in inert}
        for source in (case.data, case.test)
        if source is not None
    ]
    learners = [(learner.name, learner.type, dict(learner.config)) for learner in case.learners]
    return repr((tables, sources, learners, plain(case.judge)))


def number_of_trials(settings: Settings, data: TrialSource) -> int | None:
    """Return the number of trials of a source, None for a data set, which would have to be read."""
    if data.kind == SIMULATED:
        return number_of_simulated_trials(settings, groups_of(data))
    if data.kind == "CSV":
        trials = labelled_trials(data, settings=lambda: settings, features=settings.features.create)
        return len(without_copies(trials))
    return None


def in_a_name(key: str, value: Any) -> str:
    """Return a key with its value in words: `probing force 20 N`."""
    return " ".join(
        worded(key.rpartition(".")[2], shown(value) if isinstance(value, list | tuple) else value)
    )


def shown(value: Any) -> str:
    """Return a value as text for the name of a case."""
    if isinstance(value, float):
        return f"{value:g}"
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


def _put(values: dict[str, Any], path: Sequence[str], value: Any) -> None:
    for part in path[:-1]:
        inner = values.get(part)
        values[part] = dict(inner) if isinstance(inner, Mapping) else {}
        values = values[part]
    values[path[-1]] = value


def _found(asked: str) -> tuple[Layer, Path | None, str]:
    """Return the content of the file of an experiment, the folder that its paths are relative to, and its name."""
    if asked.endswith(".toml"):
        path = Path(asked).expanduser()
        return read_toml(path, asked, "experiment"), path.parent, path.stem
    try:
        resource = installed().resource(ExperimentEntry, asked)
    except UnknownName as error:
        hint = (
            f"; there is a file {asked}.toml: write the name with .toml"
            if Path(f"{asked}.toml").is_file()
            else ""
        )
        raise UnknownName(
            f"{error}\n  An experiment of your own is a file: write its name with .toml{hint}"
        ) from error
    return read_toml(resource.file(), f"experiment {asked}", "experiment"), None, resource.name


def _located(values: Mapping[str, Any], base: Path | None) -> dict[str, Any]:
    """Return the values with absolute paths instead of paths that are relative to the folder `base`."""
    if base is None:
        return dict(values)

    def inside(value: Any) -> Any:
        if isinstance(value, Mapping):
            return {key: inside(inner) for key, inner in value.items()}
        if isinstance(value, list):
            return [inside(inner) for inner in value]
        return located_text(value, base) if isinstance(value, str) else value

    located = {
        key: inside(inner)
        for key, inner in values.items()
        if key in ("parts", "pipelines", "gripper", "variants", "sweep", "data", "test")
    }
    return {**values, **located}
