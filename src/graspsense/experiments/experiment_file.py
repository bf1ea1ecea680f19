"""Reading the file of an experiment, or one that graspsense or a plugin ships, with the experiments it consists of."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from attrs import evolve

from graspsense.core.components.entries import ExperimentEntry
from graspsense.core.components.registry import Resource, installed
from graspsense.core.components.strict import InvalidValue, ValidationFailed, all_keys, keys_of, structured
from graspsense.core.settings.layers import Layer, Merged, option_layers, read_toml, typed_path
from graspsense.core.settings.resolved import Settings, default_paths
from graspsense.core.values.errors import ConfigError, GraspsenseError, UnknownName
from graspsense.core.values.limits import CASES
from graspsense.core.values.printable import in_one_line
from graspsense.experiments.cases import CasePlan
from graspsense.experiments.experiment import PIPELINE_TABLES, Experiment, ExperimentCase, Planned
from graspsense.experiments.kinds import kind_of
from graspsense.sources.input_content import located_text
from graspsense.sources.trial_source import TrialSource


def shipped() -> dict[str, Resource[ExperimentEntry]]:
    """Return the experiments that graspsense and plugins ship by their names, qualified where two share a name."""
    known = installed().resources(ExperimentEntry)
    times = Counter(resource.name for resource in known)
    return {
        resource.name if times[resource.name] == 1 else resource.qualified: resource for resource in known
    }


OF_CASES: Final = ("classifiers", "variants", "sweep", "data", "test", *PIPELINE_TABLES)
"""Keys that describe the cases of an experiment, which one that consists of parts does not have.

The pipelines of the parts stand in the file that a folder of results keeps.
"""


def read_experiment(asked: str, options: Sequence[str] = (), *, force: bool = False) -> Planned:
    """Read an experiment of graspsense by name, or a `.toml` file; `options` override its keys as `-o` does.

    `force` accepts settings outside of their plausible ranges. Raises ConfigError that lists all errors with their
    files and lines.
    """
    return read_plan(asked, options, force=force).with_inputs()


def read_plan(
    asked: str, options: Sequence[str] = (), within: Sequence[str] = (), *, force: bool = False
) -> Planned:
    """Read an experiment as `read_experiment` does, but not the content of its inputs, which can be many files.

    `within` names the experiments that this one is a part of.
    """
    layer, base, name = _found(asked)
    identity = asked if base is None else str(Path(os.path.expanduser(asked)).resolve())
    if identity in within:
        chain = " > ".join(Path(path).name for path in (*within, identity))
        raise ConfigError(f"{layer.label}: an experiment cannot be a part of itself: {chain}")
    within = (*within, identity)
    layers, complaints = option_layers(options)
    merged = Merged()
    merged.add((), _located(layer.values, base), layer)
    for option in layers:
        merged.add((), _located(option.values, Path()), option)
    values = merged.values
    layer = evolve(layer, options={typed_path(option): option.typed for option in layers})
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
    without = Experiment(title="")
    for key in OF_CASES if experiment is not None and experiment.parts else ():
        if getattr(experiment, key) != getattr(without, key):
            text = "an experiment of parts has no cases of its own: set it in the parts"
            complaints.append(layer.complain(InvalidValue((key,), text)))
    if experiment is None or complaints:
        raise ConfigError("\n".join(complaints))
    if experiment.parts:
        return _of_parts(name, experiment, layer, within, force=force)
    return CasePlan(name, experiment, layer, force=force).planned()


def _known_paths(values: Mapping[str, Any]) -> list[str]:
    """Return the paths of the keys that the tables of an experiment can have, for one that is misspelt."""
    paths = [*all_keys(keys_of(TrialSource), "data"), *all_keys(keys_of(TrialSource), "test")]
    with suppress(GraspsenseError):
        kind = kind_of(str(values.get("kind", "recognise")))
        paths += all_keys(keys_of(kind.keys_class()), "judge")
    return [*paths, *default_paths(PIPELINE_TABLES)]


def _of_parts(
    name: str, experiment: Experiment, layer: Layer, within: Sequence[str], *, force: bool
) -> Planned:
    """Return the experiment with the cases of all parts; the name of a case starts with that of its part."""
    kind_of(experiment.kind)
    seeds = experiment.listed_seeds
    parts: list[Planned] = []
    for asked in experiment.parts:
        parts.append(read_plan(asked, [f"seeds={list(seeds)}"], within, force=force))
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


def _found(asked: str) -> tuple[Layer, Path | None, str]:
    """Return the content of the file of an experiment, the folder that its paths are relative to, and its name."""
    if asked.endswith(".toml"):
        path = Path(os.path.expanduser(asked))
        return read_toml(path, asked, "experiment"), path.parent, in_one_line(path.stem)
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
