"""Labelled trials from a simulated gripper: several objects of each kind, each grasped several times.

Object number i of a kind is the same in all its trials and in all its states (`odwalla:full_open#3`); with
`states_per_instance = "one"` every object is used in one state only. Its trials differ
in its placement, in the friction of the gripper and in the noise of the sensors. All numbers and seeds follow from one
seed s: object i has the number 1000 s + i, and trial k, counted over all trials, has the seed 1 000 000 s + k.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from math import ceil
from typing import Any, Final, Literal, NamedTuple

from attrs import Attribute, evolve, field, frozen

from graspsense.core.components.caller import option
from graspsense.core.components.compiled_features import CompiledExtraction, both, compiled_extraction
from graspsense.core.components.roles import BatchBackend, FeatureSet, ObjectKind
from graspsense.core.components.strict import plain
from graspsense.core.grasp.runner import run_uninterrupted
from graspsense.core.learn.checkpoints import with_checkpoints
from graspsense.core.learn.labelled import Labelled, class_of
from graspsense.core.pipeline.wiring import check
from graspsense.core.settings.resolved import Settings
from graspsense.core.values.device import DeviceInfo
from graspsense.core.values.errors import ComponentFailed, ConfigError, counted, named
from graspsense.core.values.features import FeatureRows, Features
from graspsense.core.values.label_text import natural_order
from graspsense.core.values.limits import CLASSES
from graspsense.core.values.trace import Trace
from graspsense.recording.before_contact import (
    before_contact,
    before_contact_compiled,
    contact_force_of,
)
from graspsense.recording.controls import controls

OBJECTS_PER_SEED: Final = 1000
TRIALS_PER_SEED: Final = 1_000_000
LARGEST_SEED: Final = 2**32 - 1
"""The largest seed that a user can give; the trials of a seed have seeds up to a million times as large."""
BATCH: Final = 500
"""Most grasps per call if their traces are wanted: enough to be worth compiling for, at most 250 MB."""
BATCH_WITHOUT_TRACES: Final = 20_000
"""Most grasps per call otherwise, whose results take 30 MB."""

NAMED: Final = 3
"""Most labels that a note names."""

Progress = Callable[[int, int], None]
OnTrace = Callable[[int, str, "Trace"], None]
"""Called with the number, the label and the trace of each trial."""


def _check_instances(group: object, attribute: Attribute[int], value: int) -> None:
    if not 1 <= value <= OBJECTS_PER_SEED:
        raise ValueError(f"{value} instances of an object: give 1 to {OBJECTS_PER_SEED}")


def _check_trials(group: object, attribute: Attribute[Any], value: int | None) -> None:
    if value is not None and value < 1:
        what = "per instance" if attribute.name == "trials" else "in total"
        raise ValueError(f"{value} trials {what}: give at least 1")
    if value is not None and value > TRIALS_PER_SEED:
        raise ValueError(f"{value} trials: give at most {TRIALS_PER_SEED}")


class PlannedTrial(NamedTuple):
    """One trial to simulate: its label, the name of its object, and the number of the instance within its group."""

    label: str
    object_name: str
    instance: int


@frozen(kw_only=True)
class Group:
    """Trials of the same objects: which objects, how many instances of each, and how many grasps of each instance."""

    objects: tuple[str, ...] = ()
    """Names as for `--object`, or names of kinds (`can` means all states of it). None: the default of the gripper."""
    named: Mapping[str, str] = field(factory=dict)
    """Labels with the object that each stands for, such as a scene file for `odwalla:full_open`."""
    instances: int = field(default=12, validator=_check_instances)
    trials: int = field(default=5, validator=_check_trials)
    """Grasps of each instance in each state."""
    total: int | None = field(default=None, validator=_check_trials)
    """Grasps in total, in place of `trials`: distributed in turn over the states, then over the instances."""
    states_per_instance: Literal["all", "one"] = "all"
    """Whether each instance is grasped in all states, or in one only; the instances are then dealt to the states."""

    def with_defaults(self, kinds: Sequence[ObjectKind]) -> Group:
        """Return the group with the default objects among these kinds, if it names none."""
        if self.objects or self.named:
            return self
        return evolve(self, objects=tuple(name for kind in kinds if kind.default for name in kind.full_names))

    def number(self, kinds: Sequence[ObjectKind]) -> int:
        """Return the number of its trials. Raises ConfigError."""
        if self.total is not None:
            return self.total
        return self.trials * sum(len(instances) for *_, instances in self._states(kinds))

    def planned(self, kinds: Sequence[ObjectKind]) -> list[PlannedTrial]:
        """Return the trials of the group; `kinds` are those that the gripper can simulate. Raises ConfigError."""
        states = self._states(kinds)
        if self.total is None:
            return [
                PlannedTrial(label, name, i)
                for label, name, instances in states
                for i in instances
                for _ in range(self.trials)
            ]
        dealt = (divmod(k, len(states)) for k in range(self.total))
        places = sorted((state, states[state][2][turn % len(states[state][2])]) for turn, state in dealt)
        return [PlannedTrial(*states[state][:2], i) for state, i in places]

    def _states(self, kinds: Sequence[ObjectKind]) -> list[tuple[str, str, range]]:
        """Return each label, the object that it stands for, and the instances that are grasped of it.

        Raises ConfigError, also if a label has no instances.
        """
        known = {**{name: name for name in _full_names(self.objects, kinds)}, **self.named}
        if any("#" in name for name in (*known, *known.values())):
            raise ConfigError(
                f"name objects without an instance (#3) here: {option('instances')} is the number of instances"
            )
        if too_many := CLASSES.exceeded(len(known)):
            raise ConfigError(f"the objects to simulate: {too_many}")
        if self.states_per_instance == "all":
            return [(label, name, range(self.instances)) for label, name in known.items()]
        of_class: dict[str, list[str]] = {}
        for label in known:
            of_class.setdefault(class_of(label), []).append(label)
        most = next((len(labels) for labels in of_class.values() if len(labels) > self.instances), 0)
        if most:
            raise ConfigError(
                f"{self.instances} instances cannot be in one of {most} states each: give at least {most} instances"
            )
        siblings = {label: of_class[class_of(label)] for label in known}
        return [
            (label, name, range(siblings[label].index(label), self.instances, len(siblings[label])))
            for label, name in known.items()
        ]


@frozen(kw_only=True)
class SimulationPlan:
    """The trials of several groups for one seed: scenes as the gripper names them, and the seed of each trial."""

    groups: tuple[Group, ...]
    labels: tuple[str, ...]
    instances: tuple[str, ...]
    """The individual object of each trial, by its class: `odwalla#3`."""
    scenes: tuple[str, ...]
    """The individual object of each trial, by its name: `odwalla:full_open#3`."""
    seeds: tuple[int, ...]


def number_of_trials(settings: Settings, groups: Sequence[Group]) -> int:
    """Return the number of trials of a seed, without planning them. Raises ConfigError like `plan_trials`."""
    kinds, groups = _checked_groups(settings, groups)
    return sum(group.number(kinds) for group in groups)


def _checked_groups(
    settings: Settings, groups: Sequence[Group]
) -> tuple[Sequence[ObjectKind], tuple[Group, ...]]:
    """Return the kinds of object, and the groups with their default objects. Raises ConfigError."""
    kinds = simulated_objects(settings)
    groups = tuple(group.with_defaults(kinds) for group in groups)
    if kinds and not any(group.objects or group.named for group in groups):
        names = ", ".join(kind.name for kind in kinds)
        raise ConfigError(
            f"no kind of object of this gripper is a default: name {option('objects')}, any of {names}"
        )
    trials = sum(group.number(kinds) for group in groups)
    if not 1 <= trials <= TRIALS_PER_SEED:
        raise ConfigError(f"{trials} trials: give at least 1 and at most {TRIALS_PER_SEED} in total")
    return kinds, groups


def plan_trials(settings: Settings, groups: Sequence[Group], seed: int) -> SimulationPlan:
    """Return the trials to simulate. Raises ConfigError if the gripper is not simulated or there are no trials."""
    kinds, groups = _checked_groups(settings, groups)
    trials = [trial for group in groups for trial in group.planned(kinds)]
    first_object = OBJECTS_PER_SEED * seed
    return SimulationPlan(
        groups=groups,
        labels=tuple(trial.label for trial in trials),
        instances=tuple(f"{class_of(trial.label)}#{first_object + trial.instance}" for trial in trials),
        scenes=tuple(f"{trial.object_name}#{first_object + trial.instance}" for trial in trials),
        seeds=tuple(TRIALS_PER_SEED * seed + k for k in range(len(trials))),
    )


def simulated(
    settings: Settings,
    *,
    groups: Sequence[Group],
    seed: int = 0,
    progress: Progress | None = None,
    on_trace: OnTrace | None = None,
    checkpoints_s: Sequence[float] = (),
) -> Labelled:
    """Grasp the objects of every group under these settings and return the labelled trials.

    With `checkpoints_s` (s after the contact), they have the features of `CheckpointFeatures`.

    Raises ConfigError if the gripper is not simulated, UnknownName for an object that it does not know.
    """
    check(settings)
    plan = plan_trials(settings, groups, seed)
    if progress is not None:
        progress(0, len(plan.scenes))
    rows, early = FeatureRows(), FeatureRows()
    doubts: dict[str, list[str]] = {}
    feature_set = with_checkpoints(settings.features.create(), checkpoints_s)
    extract = _Extraction(
        settings.features.component.qualified, feature_set, contact_force_of(settings.values)
    )
    wanted = on_trace is not None
    grasps = _grasps(settings, plan, progress, extract, traces=wanted)
    for number, (features, features_before, trace, report) in enumerate(grasps):
        if on_trace is not None and trace is not None:
            on_trace(number, plan.labels[number], trace)
        rows.add(features)
        early.add(features_before)
        for doubt in _doubts(report):
            doubts.setdefault(doubt, []).append(plan.labels[number])
    table = rows.table()
    return Labelled(
        source="simulated grasps",
        table=table,
        labels=plan.labels,
        instances=plan.instances,
        no_order="simulated trials are independent, so they have no order of recording",
        **controls(table, early.table()),
        notes=(
            "every figure here is simulated: it comes from a model of gripper and objects",
            *_states_note(plan.groups, plan.labels),
            *(_doubt_note(doubt, doubted, len(plan.labels)) for doubt, doubted in doubts.items()),
        ),
        provenance={
            "simulated": True,
            "groups": [plain(group) for group in plan.groups],
            "seed_of_the_trials": seed,
            "settings": {t: dict(settings.values[t]) for t in ("gripper", "controller", "features")},
            "components": {t: component for t, component in settings.components.items() if t != "classifier"},
        },
    )


def _doubts(report: Mapping[str, Any]) -> Iterator[str]:
    """Yield why the figures of a simulated grasp may be inaccurate (see `SensorBackend.report`)."""
    if report.get("unstable_loop"):
        yield str(report["unstable_loop"])
    elif report.get("not_verified"):
        names = ", ".join(report["not_verified"])
        yield f"accuracy not verified for {names} (reasons: graspsense run --object NAME --explain-model)"


def _doubt_note(doubt: str, labels: Sequence[str], total: int) -> str:
    """Return in how many grasps, and of which objects, the figures may be inaccurate."""
    names = natural_order(labels)
    more = f" and {len(names) - NAMED} others" if len(names) > NAMED else ""
    return f"{len(labels)} of {counted(total, 'grasp')} ({', '.join(names[:NAMED])}{more}): {doubt}"


def _states_note(groups: Sequence[Group], labels: Sequence[str]) -> tuple[str, ...]:
    """Return in which of its states each instance is grasped; nothing if no class has several labels."""
    if len(set(labels)) == len({class_of(label) for label in labels}):
        return ()
    ways = {group.states_per_instance for group in groups}
    if ways == {"all"}:
        return ("each instance is grasped in all of its states",)
    held_out = "an instance that is both in training and in test gives its state away"
    which = "each instance is grasped" if ways == {"one"} else "the instances of some groups are grasped"
    return (f"{which} in one of its states only: {held_out}",)


def simulated_objects(settings: Settings) -> Sequence[ObjectKind]:
    """Return the kinds of object that the gripper of these settings can simulate; nothing is opened.

    Raises ConfigError if it declares none: a real gripper would move if it were opened for simulated trials.
    """
    kinds: Sequence[ObjectKind] = settings.gripper.create().objects()
    if not kinds:
        raise ConfigError(
            f"gripper {settings.gripper.component.qualified} declares no objects that it can simulate, so it was not "
            "opened. Simulated trials need a simulated gripper, as in gripper.type = 'sim'; `graspsense collect` "
            "records trials of a real gripper"
        )
    return kinds


def _refuse_real_device(info: DeviceInfo) -> None:
    """Raise ConfigError if an opened gripper says that it is real, before it gets any command."""
    if not info.simulated:
        raise ConfigError(
            f"{info.name} was opened for simulated trials but says that it is a real gripper. It was closed again "
            "without a command"
        )


def _full_names(objects: Sequence[str], kinds: Sequence[ObjectKind]) -> list[str]:
    """Return the names of objects, with a kind replaced by its names in all states. Raises ConfigError."""
    names_of_kind = {kind.name: kind.full_names for kind in kinds}
    names = [name for text in objects for name in names_of_kind.get(text, (text,))]
    if len(set(names)) < len(names):
        raise ConfigError(f"an object is named twice: {', '.join(names)}")
    return names


@frozen
class _Extraction:
    """Extracts all features from a trace. It is a class because a batch may send it to another process."""

    name: str
    feature_set: FeatureSet[Any]
    contact_force_n: float

    def __call__(self, trace: Trace) -> tuple[Features, Features]:
        """Return the features, and those from before contact."""
        with self._named_failure():
            features = self.feature_set.extract(trace)
        return features, before_contact(trace, self.contact_force_n)

    def compiled_extraction(self) -> CompiledExtraction | None:
        """Return the form that a simulator compiles; None if the feature set has none."""
        form = compiled_extraction(self.feature_set.extract)
        if form is None:
            return None
        of_set = form.result

        def result(measured: Any) -> Any:
            with self._named_failure():
                return of_set(measured)

        return both(evolve(form, result=result), before_contact_compiled(self.contact_force_n))

    @contextmanager
    def _named_failure(self) -> Iterator[None]:
        try:
            yield
        except Exception as error:
            raise ComponentFailed(
                f"feature set {self.name} failed on a simulated grasp: {named(error)}"
            ) from error


def _grasps(
    settings: Settings,
    plan: SimulationPlan,
    progress: Progress | None,
    extract: _Extraction,
    *,
    traces: bool,
) -> Iterator[tuple[Features, Features, Trace | None, Mapping[str, Any]]]:
    """Yield the features of each trial, those from before contact, its trace if `traces` asks for it, its report."""
    backend, controller = settings.gripper.create(), settings.controller.create()
    total = len(plan.scenes)
    if isinstance(backend, BatchBackend):
        backend.expect_features(extract.feature_set)
        # Parts of equal size, so that none is too small to be worth compiling for.
        size = ceil(total / ceil(total / (BATCH if traces else BATCH_WITHOUT_TRACES)))
        for start in range(0, total, size):
            part = slice(start, start + size)
            for grasped in backend.run_many(
                controller,
                plan.scenes[part],
                plan.seeds[part],
                run=settings.run,
                extract=extract,
                traces=traces,
                progress=None if progress is None else partial(_report_batch, progress, start, total),
            ):
                yield *grasped.extracted, grasped.trace, grasped.report
        return
    for k, (scene, seed) in enumerate(zip(plan.scenes, plan.seeds, strict=True)):
        run = evolve(settings.run, seed=seed)
        gripper = backend.with_object(scene)
        gripper.expect_features(extract.feature_set)
        grasp = run_uninterrupted(gripper, controller, run, on_open=_refuse_real_device)
        yield *extract(grasp.trace), grasp.trace, grasp.report
        if progress is not None:
            progress(k + 1, total)


def _report_batch(progress: Progress, start: int, total: int, done: int, _batch: int) -> None:
    progress(start + done, total)
