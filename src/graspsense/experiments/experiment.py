"""An experiment: the keys of its file, its cases, and their tasks (docs/experiments.md)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from attrs import evolve, field, frozen

from graspsense.core.components.entries import TABLE_OF_ROLE
from graspsense.core.components.strict import plain
from graspsense.core.settings.resolved import Settings
from graspsense.experiments.task import Task
from graspsense.sources.input_content import contents_of, input_names
from graspsense.sources.simulated import LARGEST_SEED
from graspsense.sources.trial_source import TrialSource

PIPELINE_TABLES: Final[tuple[str, ...]] = (
    *(table for table in TABLE_OF_ROLE.values() if table != "classifier"),
    "run",
)
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
class CaseTables:
    """The tables of the file of an experiment that say what its cases are."""

    gripper: Mapping[str, Any] = field(factory=dict)
    """Keys that override those of all pipelines. Likewise `controller`, `features` and `run`."""
    controller: Mapping[str, Any] = field(factory=dict)
    features: Mapping[str, Any] = field(factory=dict)
    run: Mapping[str, Any] = field(factory=dict)
    data: Mapping[str, Any] = field(factory=dict)
    """Keys of `graspsense.sources.trial_source.TrialSource`."""
    test: Mapping[str, Any] = field(factory=dict)
    """Other trials to test on, instead of cross-validation."""
    judge: Mapping[str, Any] = field(factory=dict)
    """Keys that the kind of the experiment defines, such as `graspsense.experiments.recognise.EvaluationSettings`."""


@frozen(kw_only=True)
class Variant(CaseTables):
    """A case that differs from the others in several keys at once."""

    name: str
    classifier: Mapping[str, Any] = field(factory=dict)


@frozen(kw_only=True)
class Experiment(CaseTables):
    """The keys of an experiment file."""

    title: str
    question: str = ""
    kind: str = "recognise"
    parts: tuple[str, ...] = ()
    """Names or files of the experiments that this one consists of. Its seeds apply to all; it has no cases itself."""
    seeds: int | tuple[int, ...] = field(default=1, validator=_seeds)
    """Number of seeds, or a list of them. Each seed has its own simulated trials and its own folds."""
    pipelines: tuple[str | PipelineOf, ...] = ("default",)
    classifiers: tuple[str | Mapping[str, Any], ...] = ()
    """Names, or tables with a `type`, a `name` to show, and keys. Default: that of the pipeline, or c45."""
    variants: tuple[Variant, ...] = ()
    sweep: Mapping[str, Any] = field(factory=dict)
    """Keys such as `controller.probing_force_n`, each with a list of values; every combination is a case."""

    @property
    def listed_seeds(self) -> tuple[int, ...]:
        """Its seeds, also where their number is given."""
        return tuple(range(self.seeds)) if isinstance(self.seeds, int) else self.seeds


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

    @property
    def params(self) -> dict[str, Any]:
        """All that defines its tasks but their seeds, as JSON values, without settings that are not set."""
        return {
            "settings": {
                table: {key: value for key, value in self.settings.values[table].items() if value is not None}
                for table in PIPELINE_TABLES
            },
            "data": plain(self.data),
            "test": None if self.test is None else plain(self.test),
            "learners": [plain(learner) for learner in self.learners],
            "judge": plain(self.judge),
        }


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
        params = {**case.params, "first": seed == self.seeds[0]}
        own = {text: self.inputs[text] for text in input_names([case.kind, params]) if text in self.inputs}
        params = {**params, "inputs": own} if own else params
        return Task(kind=case.kind, params=params, seed=seed, name=f"{case.name}, seed {seed}".lstrip(", "))

    def with_inputs(self) -> Planned:
        """Return the experiment with the present content of its inputs."""
        return evolve(self, inputs=contents_of([[case.kind, case.params] for case in self.cases]))
