"""Several experiments compared: the settings in which they differ, and the differences of their rates."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from attrs import frozen

from graspsense.core.components.strict import plain
from graspsense.core.values.errors import ConfigError, counted
from graspsense.evaluation.intervals import Difference, unpaired_difference
from graspsense.experiments.cases import shown
from graspsense.experiments.experiment import PIPELINE_TABLES, ExperimentCase
from graspsense.experiments.results import EXPERIMENT, RESULTS, Results
from graspsense.experiments.summary import ConditionResult, Summary, summary_of
from graspsense.recording.provenance import commit_text
from graspsense.report.wording import TARGETS

ABSENT: Final = "not set"
NO_CASE: Final = "all trials"
"""Name of a condition whose experiment has a single case and a single classifier."""


@frozen(kw_only=True, eq=False)
class FinishedExperiment:
    """The results of one experiment: the name that tells it from the others, its folder and its summary."""

    name: str
    results: Results
    summary: Summary


@frozen(kw_only=True)
class SettingDifference:
    """A key with its value in each experiment; several values of one experiment are those of its cases."""

    key: str
    meaning: str
    values: tuple[str, ...]


@frozen(kw_only=True, eq=False)
class ConditionDifference:
    """The rate of a condition of one experiment minus that of the first (`base`); `how` tells the basis."""

    base: ConditionResult
    other: ConditionResult
    other_name: str
    """The name of the experiment of `other`."""
    difference: Difference
    how: str

    @property
    def verdict(self) -> str:
        """Whether the rate is shown to be higher or lower, in words; `equal` where every seed has the same answers."""
        if self.base.by_seed == self.other.by_seed:
            return "equal"
        interval = self.difference.interval
        if interval is None or interval[0] <= 0.0 <= interval[1]:
            return "not shown to differ"
        return "higher" if interval[0] > 0.0 else "lower"


@frozen(kw_only=True, eq=False)
class ExperimentComparison:
    """Several experiments, the settings in which they differ, and the differences from the first of them."""

    experiments: tuple[FinishedExperiment, ...]
    settings: tuple[SettingDifference, ...]
    differences: tuple[ConditionDifference, ...]

    @property
    def names(self) -> str:
        """The names of the experiments, in words."""
        *others, last = (experiment.name for experiment in self.experiments)
        return f"{', '.join(others)} and {last}"

    @property
    def answer(self) -> str:
        """The first of the differences and the number of settings that differ, in a few sentences."""
        told = [f"{self.names} have no case in common."]
        if self.differences and {difference.verdict for difference in self.differences} == {"equal"}:
            told = [f"{self.names} have the same results."]
        elif self.differences:
            shown = self.differences[0]
            told = [
                f"{condition_name(shown.other)}, {TARGETS[shown.other.recognised]}: {shown.other_name} minus "
                f"{self.experiments[0].name} is {shown.difference.words}, {shown.verdict}, {shown.how}."
            ]
            if len(self.differences) > 1:
                told.append(f"The table has {len(self.differences) - 1} more.")
        count = len(self.settings)
        differ = counted(count, "setting differs", "settings differ")
        told.append(f"{differ if count else 'No setting differs'}.")
        return " ".join(told)

    def as_json(self) -> dict[str, Any]:
        """Return all of it as JSON values."""
        return {
            "answer": self.answer,
            "settings": [
                {
                    "key": setting.key,
                    **dict(zip((e.name for e in self.experiments), setting.values, strict=True)),
                }
                for setting in self.settings
            ],
            "experiments": {experiment.name: experiment.summary.as_json() for experiment in self.experiments},
            "differences": [
                {
                    "experiment": difference.other_name,
                    "minus": self.experiments[0].name,
                    "case": difference.other.name,
                    "target": difference.other.target,
                    "difference": difference.difference.value,
                    "interval": difference.difference.interval,
                    "how": difference.how,
                    "verdict": difference.verdict,
                }
                for difference in self.differences
            ],
        }


def condition_name(condition: ConditionResult) -> str:
    """Return the name of a condition in a table."""
    return condition.name or NO_CASE


def compare_experiments(paths: Sequence[str]) -> ExperimentComparison:
    """Read the experiments in these folders, and compare each with the first.

    A path is the folder that `graspsense experiment` wrote, or a file in it. Raises ConfigError if there are fewer than
    two, if one is given twice, is no experiment, was changed after its run, or has no recognition rates.
    """
    folders = [_folder(path) for path in paths]
    if len(folders) < 2:
        raise ConfigError("give at least two experiments to compare: graspsense experiment compare A B")
    if len({folder.resolve() for folder in folders}) < len(folders):
        raise ConfigError(f"two of {', '.join(paths)} are the same experiment: name different ones")
    short = [folder.resolve().name for folder in folders]
    names = short if len(set(short)) == len(short) else [str(folder) for folder in folders]
    experiments = tuple(_read(name, folder) for name, folder in zip(names, folders, strict=True))
    return ExperimentComparison(
        experiments=experiments,
        settings=tuple(_setting_differences(experiments)),
        differences=tuple(_differences(experiments)),
    )


def _folder(path: str) -> Path:
    """Return the folder of an experiment."""
    given = Path(os.path.expanduser(path))
    folder = given.parent if given.is_file() else given
    if not given.exists():
        raise ConfigError(f"there is no {path}: name folders that `graspsense experiment` wrote")
    if not (folder / EXPERIMENT).is_file() or not (folder / RESULTS).is_dir():
        raise ConfigError(
            f"{path} is not an experiment: there is no {EXPERIMENT} with {RESULTS}/ in it. Name folders that "
            "`graspsense experiment` wrote"
        )
    return folder


def _read(name: str, folder: Path) -> FinishedExperiment:
    results = Results(folder)
    summary = summary_of(results)
    if not summary.conditions:
        raise ConfigError(f"{folder} has no recognition rates to compare")
    return FinishedExperiment(name=name, results=results, summary=summary)


def _setting_differences(experiments: Sequence[FinishedExperiment]) -> list[SettingDifference]:
    """Return the keys whose values differ between the experiments."""
    columns = [_settings(experiment.summary) for experiment in experiments]
    meanings: dict[str, str] = {}
    for experiment in experiments:
        meanings |= _meanings(experiment.summary.planned.cases[0])
    columns_made = [_circumstances(experiment) for experiment in experiments]
    differing = []
    for each in (columns, columns_made):
        for key in dict.fromkeys(key for column in each for key in column):
            values = tuple(column.get(key, ABSENT) for column in each)
            if len(set(values)) > 1:
                differing.append(SettingDifference(key=key, meaning=meanings.get(key, ""), values=values))
    return differing


def _settings(summary: Summary) -> dict[str, str]:
    """Return every key with its values over the cases, as text."""
    planned = summary.planned
    values: dict[str, dict[str, None]] = {}
    for case in planned.cases:
        params = case.params
        tables = {"experiment": {"kind": case.kind}, **params.pop("settings")}
        for learner in params.pop("learners"):
            tables[f"classifier {learner['name']}"] = {"type": learner["type"], **learner["config"]}
        tables |= params
        for key, value in _flat(tables).items():
            values.setdefault(key, {})[value] = None
    seeds = {"experiment.seeds": ", ".join(map(str, planned.seeds))}
    return {**seeds, **{key: ", ".join(each) for key, each in values.items()}}


def _flat(value: Any, key: str = "") -> dict[str, str]:
    """Return the leaves of nested tables as text, by their dotted keys, without those that are not set."""
    if isinstance(value, Mapping):
        flat: dict[str, str] = {}
        for name, inner in value.items():
            flat |= _flat(inner, f"{key}.{name}" if key else str(name))
        return flat
    if value is None or value == () or value == []:
        return {}
    if isinstance(value, list | tuple) and any(isinstance(item, Mapping) for item in value):
        return {key: json.dumps(value)}
    return {key: shown(value)}


def _meanings(case: ExperimentCase) -> dict[str, str]:
    return {
        f"{table}.{key}": str(declared.get("meaning") or "")
        for table in PIPELINE_TABLES
        for key, declared in case.settings.keys(table).items()
    }


def _circumstances(experiment: FinishedExperiment) -> dict[str, str]:
    """Return what else a result may depend on: the content of inputs, the versions, and the commit of the code."""
    made = experiment.results.provenance()
    circumstances = {
        f"{kind} of {name}": str(value)[:12] if kind == "content" else str(value)
        for kind, table in (("content", "inputs"), ("version", "versions"))
        for name, value in (made.get(table) or {}).items()
    }
    return {**circumstances, "commit": commit_text(made)}


def _differences(experiments: Sequence[FinishedExperiment]) -> list[ConditionDifference]:
    """Return the difference of each experiment from the first, for each condition that both have."""
    reference, *others = experiments
    pairs = [
        (mine, theirs, other.name)
        for other in others
        for mine, theirs in _matched(reference.summary.conditions, other.summary.conditions)
    ]
    differences = []
    for mine, theirs, name in pairs:
        difference, how = _difference(theirs, mine, len(pairs))
        differences.append(
            ConditionDifference(base=mine, other=theirs, other_name=name, difference=difference, how=how)
        )
    return differences


def _matched(
    mine: Sequence[ConditionResult], theirs: Sequence[ConditionResult]
) -> list[tuple[ConditionResult, ConditionResult]]:
    """Return the conditions of the same name and target; if there are none, the best ones for each target."""
    by_name = {(their.name, their.target): their for their in theirs}
    pairs = [
        (result, by_name[result.name, result.target])
        for result in mine
        if (result.name, result.target) in by_name
    ]
    if pairs:
        return pairs
    targets = dict.fromkeys(result.target for result in mine)
    # Of several values of a key, a dictionary keeps the last: the highest rate of each target.
    best, best_of_theirs = (
        {condition.target: condition for condition in sorted(side, key=lambda each: each.rate.mean)}
        for side in (mine, theirs)
    )
    return [(best[target], best_of_theirs[target]) for target in targets if target in best_of_theirs]


def _difference(result: ConditionResult, other: ConditionResult, comparisons: int) -> tuple[Difference, str]:
    """Return the rate of one condition minus that of another, and what the interval rests on."""
    corrected = f", corrected for {comparisons} comparisons" if comparisons > 1 else ""
    same_trials = result.simulated and other.simulated and plain(result.case.data) == plain(other.case.data)
    common = [seed for seed in result.rates if seed in other.rates]
    paired = result.minus(other, comparisons) if same_trials else None
    if paired is not None:
        return Difference(paired.value, paired.interval), f"paired over {len(common)} common seeds{corrected}"
    if not result.simulated or not other.simulated:
        reason = "recorded trials are not paired"
    elif not same_trials:
        reason = "the trials differ"
    else:
        reason = f"{counted(len(common), 'common seed')}, two are needed"
    intervals = result.rate.interval, other.rate.interval
    if intervals[0] is None or intervals[1] is None:
        value = result.rate.mean - other.rate.mean
        return Difference(value, None, "a rate has none"), f"unpaired: {reason}"
    unpaired = unpaired_difference(
        result.rate.mean, other.rate.mean, (intervals[0], intervals[1]), comparisons
    )
    return unpaired, f"unpaired: {reason}{corrected}"
