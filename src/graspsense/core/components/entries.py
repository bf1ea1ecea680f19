"""Entries: the declarations of components and resources that the hooks of a plugin return.

Classes are named by import strings (`"package.module:Class"`), which are resolved at first use. Listing plugins
therefore imports the entry modules only, and no driver.

The entry of a component needs a name, a target and a summary. Everything else is declared by the class: its channels,
units and kinds of command as class attributes, its config class as the parameter of its base class. An entry repeats
none of that; a field that is given here is for a class that does not declare it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, Final, Literal, NamedTuple

from attrs import Attribute, field, frozen
from attrs.validators import and_, deep_iterable, ge, in_, instance_of, optional

from graspsense.core.values.channel import IS_NAME, Channel
from graspsense.core.values.errors import suggestion

Role = Literal["sensor-backend", "controller", "feature-set", "classifier"]

KINDS: Final = ("effort", "velocity", "position", "force")
"""The kinds of command as entries name them, each at the place of its number (`EFFORT` and so on)."""


def _known_kinds(entry: object, attribute: Attribute[Any], kinds: tuple[str, ...]) -> None:
    for kind in kinds:
        if kind not in KINDS:
            raise ValueError(
                f"'{attribute.name}' has the unknown command kind {kind!r}; there are {', '.join(KINDS)}."
                f"{suggestion(str(kind), KINDS)}"
            )


def _distinct_channels(entry: object, attribute: Attribute[Any], channels: tuple[Channel, ...]) -> None:
    names = [channel.name for channel in channels]
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"'{attribute.name}' names channel {name!r} twice")


def _written_as(pattern: str, example: str) -> Any:
    """Return the validator of a text of this form, of which the error shows an example."""

    def check(entry: object, attribute: Attribute[Any], text: object) -> None:
        if not (isinstance(text, str) and re.fullmatch(pattern, text)):
            raise ValueError(f"'{attribute.name}' is {text!r}: write it as in {example!r}")

    return check


_IS_TARGET: Final = _written_as(r"[A-Za-z_][\w.]*:[A-Za-z_]\w*", "lab_hand.backend:LabHand")
_IS_TARGET_OR_EMPTY: Final = _written_as(r"([A-Za-z_][\w.]*:[A-Za-z_]\w*)?", "lab_hand.backend:LabHand")
_IS_RESOURCE: Final = _written_as(r"[A-Za-z_][\w.]*:[^/:][^:]*", "lab_hand:pipelines/lab.toml")
_ARE_KINDS: Final = optional(and_(instance_of(tuple), _known_kinds))


_ARE_CHANNELS: Final = optional(
    and_(deep_iterable(instance_of(Channel), instance_of(tuple)), _distinct_channels)
)


@frozen
class _CodeEntry:
    """A name, and the code behind it."""

    name: str = field(validator=IS_NAME)
    """The name by which it is selected, without spaces."""
    target: str = field(validator=_IS_TARGET)
    """Its import string, as in `"lab_hand.backend:LabHand"`."""
    summary: str = field(validator=instance_of(str))
    """What it is, in one line."""
    needs: str = ""
    """What to install or do if the target cannot be imported."""


@frozen
class _ComponentEntry(_CodeEntry):
    """A component; its target is a class."""

    config: str = field(default="", validator=_IS_TARGET_OR_EMPTY, kw_only=True)
    """The import string of the config class; empty where the class names it as the parameter of its base class."""


@frozen
class _FileEntry:
    """A name, and a file shipped inside a package."""

    name: str = field(validator=IS_NAME)
    """The name by which it is selected, without spaces."""
    resource: str = field(validator=_IS_RESOURCE)
    """The file in its package: `"package:path/inside/it.toml"`."""


@frozen
class SensorBackendEntry(_ComponentEntry):
    """A gripper with its sensors. Its class declares its `channels`, and the kinds of command that it `accepts`."""

    channels: tuple[Channel, ...] | None = field(default=None, validator=_ARE_CHANNELS, kw_only=True)
    """The channels that `read` delivers; None where the class declares them."""
    accepts: tuple[str, ...] | None = field(default=None, validator=_ARE_KINDS, kw_only=True)
    """The kinds of command that it accepts, any of effort, velocity, position, force; None where the class
    declares them.
    """


@frozen
class ControllerEntry(_ComponentEntry):
    """A control law. Its class declares the channels that it `requires`, and the kinds of `commands` that it sends."""

    requires: tuple[Channel, ...] | None = field(default=None, validator=_ARE_CHANNELS, kw_only=True)
    """The channels that it needs; None where the class declares them."""
    commands: tuple[str, ...] | None = field(default=None, validator=_ARE_KINDS, kw_only=True)
    """The kinds of command that it may send, unless its config says otherwise by the key `sends`; None where
    the class declares them.
    """
    alternatives: tuple[str, ...] | None = field(default=None, validator=_ARE_KINDS, kw_only=True)
    """Command kinds that it can send instead, each alone.

    Its config then has a key `sends` that names one kind of `commands` or `alternatives`. Where nothing sets the
    key, it is the first of them that the gripper accepts.
    """


def _names_a_column(feature: Feature, attribute: Attribute[Any], text: str) -> None:
    if not text.isprintable() or text.strip() != text or not text or set(text) & set(",[]"):
        raise ValueError(
            f"'{attribute.name}' of a feature is {text!r}: it names a column of a table, so write it without commas, "
            "brackets, and spaces at its ends, as in peak_force"
        )


def _is_length(feature: Feature, attribute: Attribute[Any], width: bool) -> None:
    if width and feature.unit != "m":
        raise ValueError(
            f"feature {feature.name!r} in {feature.unit} is marked as the width of the object, which is in m"
        )


def _not_empty(feature: Feature, attribute: Attribute[Any], text: str) -> None:
    if not text.strip():
        raise ValueError(
            f"feature {feature.name!r} has no {attribute.name}: say in a few words what it measures"
        )


@frozen
class Feature:
    """A feature: its name, its SI unit (`1` where it has none), and in a few words what it measures.

    With `width` it is the width of the object, as the gap between the fingers shows it: a classifier that has this
    feature alone is the baseline that the whole set is compared with.
    """

    name: str = field(validator=and_(instance_of(str), _names_a_column))
    """The name of the feature."""
    unit: str = field(validator=instance_of(str))
    """Its SI unit, `1` where it has none."""
    meaning: str = field(validator=and_(instance_of(str), _not_empty))
    """What it measures, in a few words."""
    width: bool = field(default=False, validator=and_(instance_of(bool), _is_length))
    """Whether it is the width of the object, as the gap between the fingers shows it."""


def _distinct_features(entry: object, attribute: Attribute[Any], features: tuple[Feature, ...]) -> None:
    names = [feature.name for feature in features]
    if len(set(names)) < len(names):
        raise ValueError(f"'features' names one feature twice: {', '.join(names)}")
    widths = [feature.name for feature in features if feature.width]
    if len(widths) > 1:
        raise ValueError(f"'features' marks {len(widths)} features as the width: {', '.join(widths)}")


@frozen
class FeatureSetEntry(_ComponentEntry):
    """A set of features. Its class declares the channels that it `requires`, and the `features` that it returns."""

    requires: tuple[Channel, ...] | None = field(default=None, validator=_ARE_CHANNELS, kw_only=True)
    """The channels that it needs; None where the class declares them."""
    features: tuple[Feature, ...] | None = field(
        default=None,
        validator=optional(and_(deep_iterable(instance_of(Feature), instance_of(tuple)), _distinct_features)),
        kw_only=True,
    )
    """The features in the order in which they are returned; None where the class declares them."""

    @property
    def width(self) -> str | None:
        """The name of the feature that is the width of the object; None where the set has none."""
        return next((feature.name for feature in self.features or () if feature.width), None)


@frozen
class ClassifierEntry(_ComponentEntry):
    """A classifier: it learns from a table of features, and predicts the object and its state."""


@frozen
class PipelineEntry(_FileEntry):
    """A pipeline file shipped inside a package, which `--pipeline` names."""

    summary: str = field(validator=instance_of(str))
    """What the pipeline is for, in one line."""
    better: str = field(default="", validator=instance_of(str), kw_only=True)
    """The name of a pipeline for the same gripper that recognises more, which `run` names; empty if there is none."""


@frozen
class ModelEntry(_FileEntry):
    """A trained model shipped inside a package, which `classifier.model` names; its file ends with `.json`."""

    summary: str = field(validator=instance_of(str))
    """What the model was trained on, in one line."""


@frozen(kw_only=True)
class DatasetEntry:
    """A reader of recorded data, used as `name:FOLDER`.

    It names a function `recordings(folder)` that yields a `LabelledRecording` for each grasp, and graspsense imports,
    replays and evaluates them. A data set that has features of its own names a function `target` instead, or beside it:
    `evaluate` then uses that. Raises ValueError if neither is given.
    """

    name: str = field(validator=IS_NAME)
    """The name before the colon in `name:FOLDER`."""
    summary: str = field(validator=instance_of(str))
    """What the data set is, in one line."""
    recordings: str = field(default="", validator=_IS_TARGET_OR_EMPTY)
    """The import string of the function `recordings(folder)`, as in `"lab_data.reader:recordings"`."""
    target: str = field(default="", validator=_IS_TARGET_OR_EMPTY)
    """The import string of a function `read(folder, features, *, unreliable)` that returns `Labelled`."""
    export: str = field(default="", validator=_IS_TARGET_OR_EMPTY)
    """The import string of a function `export(grasps, folder)` for `graspsense export DIR --to NAME:FOLDER`.

    It writes a sequence of `StoredGrasp` to a new folder, and returns what it has counted as a dict of numbers."""
    needs: str = ""
    """What to install or do if the functions cannot be imported."""

    def __attrs_post_init__(self) -> None:
        if not self.recordings and not self.target:
            raise ValueError(
                f"data set {self.name!r} names no function: give 'recordings', as in \"lab_data.reader:recordings\""
            )


@frozen
class CommandEntry(_CodeEntry):
    """A further subcommand of `graspsense`: `target` is a click command. `graspsense --help` prints `summary`."""


@frozen
class EmulatorEntry(_CodeEntry):
    """A device that software emulates on this machine: `graspsense emulate NAME`.

    `target` is a function `emulate(config, wire, seed)` that returns an `EmulatedDevice`; `config` is that of the
    backend in the pipeline that the user names.
    """

    wires: tuple[str, ...] = field(validator=deep_iterable(and_(*IS_NAME), instance_of(tuple)))
    """The interfaces of the operating system that it can use, for `--wire`; the best one first."""
    options: tuple[str, ...] = ()
    """Settings that the user's options override, as in `("gripper.transport=emulated",)`."""
    needs: str = ""
    """What to install or do if the target cannot be imported."""
    backend: str = ""
    """The sensor backend that drives the device; empty: the one of the same name."""


@frozen
class LiveObserverEntry(_CodeEntry):
    """A function that receives grasps as they run, in a process of its own: `--live`.

    `target` is a function `observe(batches)`. `batches` yields a list of messages about 30 times a second, until the
    command ends; docs/live.md lists them. What the function does, and how long it takes, cannot disturb a grasp.
    """


@frozen
class IdentifierEntry(_CodeEntry):
    """A function that identifies an object from recorded squeezes, as a scene of a simulator: `graspsense identify`.

    `name` is the sensor backend that simulates the scene. `target` is a function `identify(config, squeezes, progress,
    block)` that returns an `Identification`. `config` is that of the backend, `squeezes` and `block` are sequences of
    `RecordedSqueeze`, `block` those of a rigid block by the same gripper. `progress(what, done, total)` tells how far
    it is. It raises ConfigError if the squeezes determine no object.
    """


@frozen
class ConformanceCheckEntry(_CodeEntry):
    """A check of what other plugins return from a hook that this plugin owns.

    `hook` is the name of that hook. `target` is a function that takes a list of everything that the hook of one
    distribution returned, and yields a sentence for each defect: what is wrong, and what to do. It is called by
    `graspsense plugins check` for each distribution that implements the hook.
    """

    hook: str = field(validator=instance_of(str))
    """The name of the hook whose results are checked."""
    summary: str = field(validator=instance_of(str))
    """What the check requires, in one line."""
    needs: str = ""
    """What to install or do if the target cannot be imported."""


@frozen(kw_only=True)
class ExperimentKindEntry:
    """A kind of experiment, which an experiment file names by its key `kind`.

    `run` is a function `run(params, seed)` that computes a task; its result must depend on these two alone, and
    `result` is the attrs class of the result. `keys` is the attrs class of the keys under `[judge]`. A kind without
    `run` is for experiments that consist of others. Raises ValueError if only one of `run` and `keys` is given.
    """

    name: str = field(validator=IS_NAME)
    """The value of the key `kind`."""
    summary: str = field(validator=instance_of(str))
    """What a task computes, in one line."""
    run: str = field(default="", validator=_IS_TARGET_OR_EMPTY)
    """The import string of the function `run(params, seed)`."""
    keys: str = field(default="", validator=_IS_TARGET_OR_EMPTY)
    """The import string of the class of the keys under `[judge]`."""
    result: str = field(default="", validator=_IS_TARGET_OR_EMPTY)
    """The import string of the attrs class of the result, which has `source: str` (where its trials are from, in words)
    and `simulated: bool`; empty for recognition rates."""
    findings: str = field(default="", validator=_IS_TARGET_OR_EMPTY)
    """The import string of a function from a `Summary` to `Findings`; empty if the rates are the whole report."""
    simulates: bool = False
    """Whether tasks simulate all trials: recorded ones are refused."""
    seconds_per_trial: float | None = field(default=None, validator=optional(ge(0.0)))
    """Processor time per trial, from which the duration of a user's experiment is estimated; None if not known."""
    needs: str = ""
    """What to install or do if these cannot be imported."""

    def __attrs_post_init__(self) -> None:
        if bool(self.run) != bool(self.keys):
            raise ValueError(f"kind {self.name!r} of experiment needs both 'run' and 'keys', or neither")


@frozen
class ExperimentEntry(_FileEntry):
    """An experiment file shipped inside a package, which `graspsense experiment` names."""

    seconds_per_trial: float | None = field(default=None, validator=optional(ge(0.0)))
    """Processor time per trial, from which the duration is estimated; None for that of its kind."""


@frozen
class FoundDevice:
    """A device that a probe found: its backend, its serial number, and whether it can be opened."""

    backend: str = field(validator=instance_of(str))
    """The sensor backend that drives the device."""
    serial: str
    """The serial number of the device."""
    where: str = field(validator=instance_of(str))
    """Where it is connected, as in `/dev/hidraw0`."""
    ready: bool
    """Whether it can be opened now."""
    advice: str = field(default="", validator=instance_of(str))
    """What to do if it cannot be opened."""


@frozen
class Finding:
    """A result of `graspsense doctor`: the subject that was examined, its state, and what to do.

    `state` is `ok`, `note` (not wrong, but worth knowing) or `problem`. `numbers` are measured values, whose names end
    with their units: `rate_hz`.
    """

    subject: str = field(validator=instance_of(str))
    """What was examined."""
    state: Literal["ok", "note", "problem"] = field(validator=in_(("ok", "note", "problem")))
    """`ok`, `note` (not wrong, but worth knowing) or `problem`."""
    words: str = field(validator=instance_of(str))
    """What was found, in words."""
    advice: str = field(default="", validator=instance_of(str))
    """What to do about a problem."""
    numbers: Mapping[str, float | int | str | bool] = field(factory=dict)
    """Measured values, whose names end with their units: `rate_hz`."""


ComponentEntry = SensorBackendEntry | ControllerEntry | FeatureSetEntry | ClassifierEntry
ResourceEntry = (
    PipelineEntry
    | ModelEntry
    | DatasetEntry
    | CommandEntry
    | EmulatorEntry
    | IdentifierEntry
    | LiveObserverEntry
    | ExperimentKindEntry
    | ExperimentEntry
    | ConformanceCheckEntry
)


class ResourceKind(NamedTuple):
    """A kind of resource: the hook whose entries declare it, the type of these entries, and the kind in words."""

    hook: str
    entry: type
    words: str


RESOURCES: Final = (
    ResourceKind("graspsense_pipelines", PipelineEntry, "pipeline"),
    ResourceKind("graspsense_models", ModelEntry, "model"),
    ResourceKind("graspsense_datasets", DatasetEntry, "data set"),
    ResourceKind("graspsense_commands", CommandEntry, "command"),
    ResourceKind("graspsense_emulators", EmulatorEntry, "emulator"),
    ResourceKind("graspsense_identifiers", IdentifierEntry, "identifier of objects for gripper"),
    ResourceKind("graspsense_live_observers", LiveObserverEntry, "live observer"),
    ResourceKind("graspsense_experiment_kinds", ExperimentKindEntry, "kind of experiment"),
    ResourceKind("graspsense_experiments", ExperimentEntry, "experiment"),
    ResourceKind("graspsense_conformance_checks", ConformanceCheckEntry, "conformance check"),
)
KIND_OF_ENTRY: Final = {kind.entry: kind.words for kind in RESOURCES}


class ComponentKind(NamedTuple):
    """What belongs to a role: the hook whose entries declare components, and the type of these entries.

    `table` is the table of a pipeline file in which a component is selected, `declared` what its class declares by
    attributes, unless the entry has it. The base class of the role is named as the entry, without `Entry`.
    """

    hook: str
    entry: type
    table: str
    declared: tuple[str, ...]


ROLES: Final[Mapping[Role, ComponentKind]] = {
    "sensor-backend": ComponentKind(
        "graspsense_sensor_backends", SensorBackendEntry, "gripper", ("channels", "accepts")
    ),
    "controller": ComponentKind(
        "graspsense_controllers", ControllerEntry, "controller", ("requires", "commands", "alternatives")
    ),
    "feature-set": ComponentKind(
        "graspsense_feature_sets", FeatureSetEntry, "features", ("requires", "features")
    ),
    "classifier": ComponentKind("graspsense_classifiers", ClassifierEntry, "classifier", ()),
}
ROLE_OF_ENTRY: Final[Mapping[type, Role]] = {kind.entry: role for role, kind in ROLES.items()}
TABLE_OF_ROLE: Final[Mapping[Role, str]] = {role: kind.table for role, kind in ROLES.items()}
"""The table of a pipeline file in which a component of each role is selected."""
