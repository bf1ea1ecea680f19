"""Where labelled trials come from, as a user types it: a CSV, a data set, or the simulator."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeVar

import click

if TYPE_CHECKING:
    from graspsense.cli.progress import Progress
    from graspsense.core.config import Chosen, Settings
    from graspsense.core.labelled import Labelled

CommandT = TypeVar("CommandT", bound=Callable[..., Any])

SIMULATED: Final = "simulated"
DEFAULT_CLASSIFIER: Final = "c45"

SOURCES: Final = """\b
    SOURCE is one of
      FILE.csv     a table of features, one line a trial; --label names its column
      NAME:FOLDER  a data set that a plugin reads, as icub:FOLDER
      simulated    grasps of the simulated gripper
    """

_OPTIONS: Final = (
    click.option("--label", metavar="COLUMN", help="CSV: the column that says what was grasped."),
    click.option("--instance", metavar="COLUMN", help="CSV: the column that names the very thing."),
    click.option("--order", metavar="COLUMN", help="CSV: a column that rises in the order of recording."),
    click.option(
        "--features", metavar="COLUMNS", help="CSV: the columns to learn from, with commas.  [all numbers]"
    ),
    click.option(
        "--before", metavar="COLUMNS", help="CSV: columns known before any contact; a control uses them."
    ),
    click.option("--unreliable", is_flag=True, help="Data set: take in what its author calls unreliable."),
    click.option(
        "--objects", metavar="NAMES", help="simulated: objects or kinds, with commas.  [the paper's]"
    ),
    click.option(
        "--instances", type=int, default=12, show_default=True, help="simulated: things of each object."
    ),
    click.option("--trials", type=int, default=5, show_default=True, help="simulated: grasps of each thing."),
    click.option(
        "--pipeline", metavar="NAME|FILE", default="default", help="simulated: the pipeline.  [default]"
    ),
    click.option("--gripper", metavar="NAME", help="simulated: another simulated gripper. (gripper.type)"),
    click.option(
        "--only", metavar="CLASS", help="Use the trials of one class, what is before the colon of labels."
    ),
    click.option(
        "-o",
        "options",
        metavar="TABLE.KEY=VALUE",
        multiple=True,
        help="A key of a component, as in -o controller.probing_force_n=17. May be given again.",
    ),
    click.option(
        "--seed", type=int, default=0, show_default=True, help="What is drawn at random follows from it."
    ),
)

_ONLY_FOR: Final = {
    "CSV": ("label", "instance", "order", "features", "before"),
    "data set": ("unreliable",),
    SIMULATED: ("objects", "instances", "trials", "pipeline", "gripper"),
}


def source_options(command: CommandT) -> CommandT:
    """Add the options that say where trials come from; they arrive as keywords for `trials_of`."""
    for option in reversed(_OPTIONS):
        command = option(command)
    return command


def classifier_option(command: CommandT) -> CommandT:
    """Add --classifier."""
    return click.option(
        "--classifier",
        metavar="NAME",
        help=f"c45, svm, mlp, forest, knn, tree, or a plugin's.  [{DEFAULT_CLASSIFIER}] (classifier.type)",
    )(command)


def is_csv(source: str) -> bool:
    """Whether this source is a file of features."""
    return _kind(source) == "CSV"


def trials_of(source: str, progress: Progress, given: Mapping[str, Any]) -> Labelled:
    """Return the trials of a source, or of one class of it; `given` holds the options of `source_options`.

    Raises ConfigError, DataDamaged.
    """
    kind = _kind(source)
    _refuse_misplaced(kind)
    if kind == SIMULATED:
        found = _simulated(progress, given)
    elif kind == "CSV":
        found = _csv(source, given)
    else:
        found = _data_set(source, given)
    return found.of_class(given["only"]) if given["only"] else found


def learner_of(source: str, classifier: str | None, given: Mapping[str, Any]) -> Chosen:
    """Return the classifier that is to learn: by its name, or that of the pipeline where there is one."""
    if _kind(source) == SIMULATED:
        chosen = _settings(given, classifier).classifier
        assert chosen is not None
        return chosen
    return _alone("classifier", classifier or DEFAULT_CLASSIFIER, given)


def command_line(without: Sequence[str], command: str = "") -> str:
    """Return the command that is running, or another one with its arguments, without some of its options."""
    context = click.get_current_context()
    words = ["graspsense", command or str(context.info_name)]
    for one in context.command.params:
        name = str(one.name)
        typed = context.get_parameter_source(name) is click.core.ParameterSource.COMMANDLINE
        if name in without or not typed:
            continue
        value = context.params[name]
        if isinstance(one, click.Argument):
            words.append(str(value))
        elif isinstance(one, click.Option) and one.is_flag:
            words.append(one.opts[0])
        else:
            for each in value if one.multiple else [value]:
                words += [one.opts[0], str(each)]
    return shlex.join(words)


def _kind(source: str) -> str:
    from graspsense.core.errors import ConfigError

    if source == SIMULATED:
        return SIMULATED
    if source.lower().endswith((".csv", ".tsv", ".txt")) or Path(source).is_file():
        return "CSV"
    if ":" in source:
        return "data set"
    raise ConfigError(
        f"{source!r} is no source of trials: name a FILE.csv, a data set as icub:FOLDER, or `{SIMULATED}`"
    )


def _refuse_misplaced(kind: str) -> None:
    """Refuse options that say nothing about this kind of source. Raises UsageError."""
    context = click.get_current_context()
    for owner, names in _ONLY_FOR.items():
        for name in names:
            from_user = context.get_parameter_source(name) is click.core.ParameterSource.COMMANDLINE
            if from_user and owner != kind:
                raise click.UsageError(f"--{name} is for a {owner} source; this one is a {kind}", context)


def _settings(given: Mapping[str, Any], classifier: str | None) -> Settings:
    from graspsense.core.config import Flag, resolve

    flags = [Flag("--gripper", "gripper.type", given["gripper"])] if given["gripper"] else []
    if classifier:
        flags.append(Flag("--classifier", "classifier.type", classifier))
    settings = resolve(given["pipeline"], options=given["options"], flags=flags)
    if settings.classifier is None:
        flags.append(Flag("--classifier", "classifier.type", DEFAULT_CLASSIFIER))
        settings = resolve(given["pipeline"], options=given["options"], flags=flags)
    return settings


def _simulated(progress: Progress, given: Mapping[str, Any]) -> Labelled:
    from graspsense.cli.output import talk
    from graspsense.trials.simulated import simulated

    settings = _settings(given, None)
    talk("grasping; where the simulator can be compiled, the first seconds go into that")
    return simulated(
        settings,
        objects=_names(given["objects"]),
        instances=given["instances"],
        trials=given["trials"],
        seed=given["seed"],
        progress=lambda done, total: progress("grasping", done, total),
    )


def _csv(source: str, given: Mapping[str, Any]) -> Labelled:
    from graspsense.core.errors import ConfigError
    from graspsense.trials.features_csv import read_labelled

    if not given["label"]:
        raise ConfigError(f"which column of {source} holds the label? Name it: --label COLUMN")
    return read_labelled(
        Path(source),
        given["label"],
        instance=given["instance"],
        order=given["order"],
        features=_names(given["features"]),
        before=_names(given["before"]),
    )


def _data_set(source: str, given: Mapping[str, Any]) -> Labelled:
    from graspsense.core.errors import ConfigError, PluginUnavailable
    from graspsense.core.labelled import Labelled
    from graspsense.core.plugins import installed

    name, _, folder = source.partition(":")
    if not folder:
        raise ConfigError(f"{source!r} names no folder: write it after the colon")
    reader = installed().dataset(name).load()
    features = _alone("features", "chitta", given).create()
    found = reader(folder, features, unreliable=given["unreliable"])
    if not isinstance(found, Labelled):
        raise PluginUnavailable(
            f"data set {name!r} cannot be used here: its reader gave {type(found).__name__}, not Labelled"
        )
    return found


def _alone(table: str, name: str, given: Mapping[str, Any]) -> Chosen:
    """Return a component outside of any pipeline, with the keys that options give it."""
    from graspsense.core.config import Chosen, build
    from graspsense.core.entries import TABLE_OF_ROLE
    from graspsense.core.errors import ConfigError
    from graspsense.core.layers import Merged, option_layers
    from graspsense.core.plugins import installed

    layers, complaints = option_layers(given["options"])
    merged = Merged()
    for layer in layers:
        for key, values in layer.values.items():
            if key not in ("classifier", "features") or not isinstance(values, dict):
                complaints.append(
                    f"{layer.typed}: here only keys of [classifier] and [features] have a meaning"
                )
            elif key == table:
                merged.add((), values, layer)
    if complaints:
        raise ConfigError("\n".join(complaints))
    role = next(role for role, one in TABLE_OF_ROLE.items() if one == table)
    values = merged.values
    component = installed().find(role, str(values.pop("type", name)))
    return Chosen(component, build(component, values))


def _names(text: str | None) -> tuple[str, ...]:
    return tuple(one.strip() for one in text.split(",") if one.strip()) if text else ()
