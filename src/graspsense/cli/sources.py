"""Where labelled trials come from, as a user types it: a CSV, a data set, or the simulator."""

from __future__ import annotations

import shlex
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click

from graspsense.cli.options import (
    SEED,
    dashed,
    force_option,
    keys_option,
    option_group,
    pipeline_option,
    refuse_typed,
    typed,
)
from graspsense.cli.output import file_to_write
from graspsense.cli.progress import ProgressLine
from graspsense.core.components.entries import TABLE_OF_ROLE
from graspsense.core.components.registry import installed
from graspsense.core.components.strict import nearest_path
from graspsense.core.settings.layers import Flag, Merged, option_layers, typed_path
from graspsense.core.settings.resolved import Settings, default_paths, resolve
from graspsense.core.settings.selected import SelectedComponent, build
from graspsense.core.values.errors import ConfigError
from graspsense.core.values.printable import printable
from graspsense.store.opening import STORE, as_source, store_folder

if TYPE_CHECKING:
    from graspsense.core.learn.labelled import Labelled
    from graspsense.core.values.features import FeatureTable

SIMULATED: Final = "simulated"
DEFAULT_CLASSIFIER: Final = "c45"

SOURCES: Final = """\b
    SOURCE is one of
      FILE.csv     a feature table, one line per trial;
                   --label names the column of the label
      FILE.arff    the same, with types from its header
      NAME:FOLDER  a data set of a plugin, such as icub:FOLDER
      store:DIR    the labelled trials of a store, or DIR alone
      simulated    grasps of the simulated gripper
      identified:FILE.toml,...  simulated grasps of objects that
                   `graspsense identify` has identified
    """

source_options = option_group(
    click.option("--label", metavar="COLUMN", help="CSV: column of the label."),
    click.option(
        "--instance",
        metavar="COLUMN",
        help="CSV: column of the instance.  [default: the only one that names objects]",
    ),
    click.option("--order", metavar="COLUMN", help="CSV: column that increases in the order of recording."),
    click.option(
        "--features",
        metavar="COLUMNS",
        help="CSV: comma-separated feature columns; pad_* is all that begin so, -NAME leaves one out.  [default: all "
        "that can be features]",
    ),
    click.option(
        "--before",
        metavar="COLUMNS",
        help="CSV: comma-separated columns known before contact, for a control.",
    ),
    click.option(
        "--target-value",
        metavar="COLUMN",
        help="CSV, store: a number to predict in place of the label, such as a force at break.",
    ),
    click.option(
        "--unreliable", is_flag=True, help="Data set: include trials that its author calls unreliable."
    ),
    click.option(
        "--objects",
        metavar="NAMES",
        help="simulated: comma-separated objects or kinds.  [default: those of the paper]",
    ),
    click.option(
        "--instances", type=int, default=12, show_default=True, help="simulated: instances of each object."
    ),
    click.option(
        "--trials", type=int, default=5, show_default=True, help="simulated: grasps of each instance."
    ),
    click.option(
        "--states-per-instance",
        type=click.Choice(["all", "one"]),
        default="all",
        show_default=True,
        help="simulated: grasp each instance in all of its states, or in one only.",
    ),
    pipeline_option("simulated: pipeline.  [default: default]"),
    click.option("--gripper", metavar="NAME", help="simulated: another simulated gripper. (gripper.type)"),
    click.option(
        "--only",
        metavar="CLASS",
        help="Use only the trials of this class (the part of a label before the colon).",
    ),
    keys_option("Set a key of a component: -o controller.probing_force_n=17."),
    click.option("--seed", type=SEED, default=0, show_default=True, help="Seed of all random numbers."),
    force_option,
)
"""The options that say where trials come from; they arrive as keywords for `trials_of`."""

_SIMULATED_TOO: Final = ("calibration_instances", "pipeline", "gripper")
"""Options for simulated trials that are no keys of `TrialSource`."""
_SAME_KEYS: Final = (
    *("only", "label", "instance", "order", "unreliable"),
    *("instances", "trials", "states_per_instance"),
)
"""Options that are keys of `TrialSource` as they are."""


classifier_option = click.option(
    "--classifier",
    metavar="NAME",
    help="c45, svm, mlp, forest, extra-trees, boosted, ebm, knn, tree, or another. "
    f"[{DEFAULT_CLASSIFIER}] (classifier.type)",
)
folds_option = click.option(
    "--folds", type=click.IntRange(min=2), default=10, show_default=True, help="Number of folds."
)
keep_option = click.option(
    "--keep",
    metavar="FILE",
    callback=file_to_write(),
    help="Write the features of all trials as a CSV file.",
)
"""The file that `keep_features` writes."""
checkpoints_option = click.option(
    "--checkpoints",
    metavar="SECONDS",
    help="Also predict so many seconds after the contact, comma-separated, as in 0.1,0.2,0.4.",
)
"""`checkpoints_of` reads its text."""


def named_source(_ctx: click.Context, _param: click.Parameter, value: Any) -> Any:
    """Callback of the argument for one source or several: a store by its folder becomes `store:DIR`."""
    return tuple(map(as_source, value)) if isinstance(value, tuple) else as_source(value)


source_argument = click.argument("source", callback=named_source)
"""The argument SOURCE; the folder of a store needs no `store:`."""


def named_store(_ctx: click.Context, _param: click.Parameter, value: str) -> str:
    """Callback of the argument for the folder of a store, which may be named as `store:DIR` as well."""
    return store_folder(value)


def keep_features(keep: str | None, labelled: Labelled) -> None:
    """Write the trials as a table of features, if a file is named."""
    if keep:
        from graspsense.sources.trial_table.features_csv import write_labelled

        write_labelled(Path(keep), labelled)


def is_csv(source: str) -> bool:
    """Whether this source is a file of features."""
    from graspsense.sources.trial_source import kind_of

    return kind_of(source) == "CSV"


def trials_of(
    source: str,
    progress: ProgressLine,
    given: Mapping[str, Any],
    checkpoints_s: Sequence[float] = (),
    folds: int | None = None,
    *,
    copies: bool = False,
) -> Labelled:
    """Return the trials of a source, or of one class of it; `given` holds the options of `source_options`.

    With `checkpoints_s` (s after the contact), they have the features of `CheckpointFeatures`. Copies of other trials
    are left out, unless `copies` is set. More `folds` than simulated trials are refused before the first grasp.
    Raises ConfigError, DataDamaged.
    """
    from graspsense.core.learn.copies import without_copies
    from graspsense.core.learn.groups import with_sessions
    from graspsense.sources.trial_source import described_trials, groups_of, kind_of, labelled_trials

    kind = kind_of(source)
    _refuse_misplaced(kind)
    values = {
        **{key: given[key] for key in _SAME_KEYS},
        "columns": _names("features", given),
        "before": _names("before", given),
        "value": given["target_value"],
        "objects": _names("objects", given),
        "checkpoints_s": tuple(checkpoints_s),
    }
    described = described_trials(source, values, lambda key: "SOURCE" if key == "source" else dashed(key))
    if kind == SIMULATED and folds is not None:
        from graspsense.evaluation.folds import check_folds
        from graspsense.sources.simulated import number_of_trials

        check_folds(number_of_trials(_settings(source, given, None), groups_of(described)), folds)
    trials = labelled_trials(
        described,
        settings=lambda: _settings(source, given, None),
        features=lambda: _alone("features", "chitta", given, source).create(),
        options=given["options"],
        seed=given["seed"],
        progress=lambda done, total: progress(
            "grasping" if kind == SIMULATED else "extracting features", done, total
        ),
    )
    return with_sessions(trials) if copies else without_copies(trials)


def to_predict(
    source: str, names: tuple[str, ...], given: Mapping[str, Any]
) -> tuple[FeatureTable, Labelled | None, tuple[str, ...]]:
    """Return the features of the trials, the trials (None if only their features are known), and notes.

    A CSV has the features of these names.
    """
    if is_csv(source) and not given["label"] and not given["target_value"]:
        from graspsense.sources.trial_table.features_csv import read_table

        table, notes = read_table(Path(source), names)
        return table, None, notes
    with ProgressLine() as progress:
        labelled = trials_of(source, progress, {**given, "features": given["features"] or names}, copies=True)
    return labelled.table, labelled, labelled.notes


def learner_of(source: str, classifier: str | None, given: Mapping[str, Any]) -> SelectedComponent:
    """Return the classifier that is to learn: by its name, or that of the pipeline where there is one."""
    from graspsense.sources.trial_source import kind_of

    if kind_of(source) == SIMULATED:
        chosen = _settings(source, given, classifier).classifier
        assert chosen is not None
        return chosen
    return _alone("classifier", classifier or DEFAULT_CLASSIFIER, given, source)


def detector_of(source: str, given: Mapping[str, Any]) -> SelectedComponent:
    """Return the controller that tells the events, which the options can select and set."""
    return _alone("controller", "event-detector", given, source)


def command_line(without: Collection[str], command: str = "") -> str:
    """Return the command that is running, or another one with its arguments, without some options, as printable."""
    context = click.get_current_context()
    words = ["graspsense", command or str(context.info_name)]
    by_user = set(typed()).difference(without)
    for param in context.command.params:
        if param.name not in by_user or not param.expose_value:
            continue
        value = context.params[param.name]
        if isinstance(param, click.Argument):
            words.append(str(value))
        elif isinstance(param, click.Option) and param.is_flag:
            words.append(param.opts[0])
        else:
            for each in value if param.multiple else [value]:
                words += [param.opts[0], str(each)]
    return printable(shlex.join(words))


def _refuse_misplaced(kind: str) -> None:
    """Refuse options that say nothing about this kind of source. Raises UsageError."""
    from graspsense.sources.trial_source import KEYS_OF_KIND

    for owner, keys in KEYS_OF_KIND.items():
        if owner != kind:
            why = f"is for a source of the kind {owner!r}; this one is of the kind {kind!r}"
            if owner == "CSV":
                refuse_typed(["features"], f"{why}: a feature set is selected by -o features.type=NAME")
            refuse_typed((*keys, *(_SIMULATED_TOO if owner == SIMULATED else ())), why)


def _settings(source: str, given: Mapping[str, Any], classifier: str | None) -> Settings:
    from graspsense.sources.identified import gripper_flags

    flags = (
        *gripper_flags(source),
        Flag("--gripper", "gripper.type", given["gripper"]),
        Flag("--classifier", "classifier.type", classifier),
    )
    settings = resolve(given["pipeline"], options=given["options"], flags=flags, force=given["force"])
    return settings if settings.classifier else _settings(source, given, DEFAULT_CLASSIFIER)


def _alone(table: str, name: str, given: Mapping[str, Any], source: str) -> SelectedComponent:
    """Return a component outside of any pipeline, with the keys that options give it."""
    from graspsense.store.extract_again import CHANGEABLE

    layers, complaints = option_layers(given["options"])
    merged = Merged()
    own = () if is_csv(source) else CHANGEABLE if source.startswith(STORE) else ("features",)
    tables = (table,) if table == "controller" else ("classifier", *own)
    for layer in layers:
        for key, values in layer.values.items():
            if key not in tables or not isinstance(values, dict):
                others = ", ".join(f"[{other}]" for other in tables[:-1])
                known = f"{others} and [{tables[-1]}]" if others else f"[{tables[-1]}]"
                near = nearest_path(".".join(map(str, typed_path(layer))), default_paths(tables))
                meant = f" Did you mean {near!r}?" if near else ""
                complaints.append(f"{layer.typed}: here only keys of {known} have a meaning.{meant}")
            elif key == table:
                merged.add((), values, layer)
    if complaints:
        raise ConfigError("\n".join(complaints))
    role = next(role for role, name in TABLE_OF_ROLE.items() if name == table)
    values = merged.values
    component = installed().find(role, str(values.pop("type", name)))
    return SelectedComponent(component, build(component, values, force=given["force"]))


def _names(option: str, given: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the names in an option, or those that a model has. Raises UsageError for an option without any."""
    text = given[option]
    if text is None or isinstance(text, tuple):
        return text or ()
    names = tuple(name.strip() for name in text.split(",") if name.strip())
    if not names:
        raise click.UsageError(
            f"{dashed(option)} {text!r} has no name: leave it out, or give names with commas"
        )
    return names
