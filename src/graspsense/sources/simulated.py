"""Labelled trials from a simulated gripper: many things of each kind, each grasped several times.

Thing number i of a kind is the same in all its trials and in all its states (`odwalla:full_open#3`); what differs
between its trials is how it is placed, the gripper's friction and the sensors' noise. Numbers and seeds follow
from one seed: thing i of seed s has the number 1000 s + i, and trial k, counted over all, the seed 1 000 000 s + k.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

from attrs import Attribute, evolve, field, frozen

from graspsense.core.errors import ConfigError
from graspsense.core.features import Features, table_of
from graspsense.core.labelled import Control, Labelled, class_of
from graspsense.core.roles import BatchBackend, Controller, DeviceInfo, FeatureSet, SensorBackend
from graspsense.core.runner import run_grasp
from graspsense.core.strict import plain
from graspsense.core.wiring import check
from graspsense.recording.before_contact import before_contact

if TYPE_CHECKING:
    from graspsense.core.config import Settings
    from graspsense.core.trace import Trace

CONTAINERS: Final[Mapping[str, tuple[str, ...]]] = {
    "odwalla": ("full_closed", "full_open", "empty_closed", "empty_open"),
    "naked": ("full_closed", "full_open", "empty_closed", "empty_open"),
    "can": ("full_closed", "full_open", "empty_open"),
    "water": ("full_closed", "full_open", "empty_closed", "empty_open"),
}
"""The containers of Chitta, Piccoli and Sturm (ICRA 2010), section III.E, in the states they can be in."""

THINGS_PER_SEED: Final = 1000
TRIALS_PER_SEED: Final = 1_000_000
BATCH: Final = 500
"""Grasps asked for at once where their traces are: large enough to be worth compiling, at most 250 MB."""

Progress = Callable[[int, int], None]


def _things(group: object, attribute: Attribute[int], value: int) -> None:
    if not 1 <= value <= THINGS_PER_SEED:
        raise ValueError(f"{value} instances of an object: give 1 to {THINGS_PER_SEED}")


def _trials(group: object, attribute: Attribute[Any], value: int | None) -> None:
    if value is not None and value < 1:
        kind = "of an instance" if attribute.name == "trials" else "in all"
        raise ValueError(f"{value} trials {kind}: give at least 1")


@frozen(kw_only=True)
class Group:
    """Trials that are made alike: of which objects, how many things of each, how often each is grasped."""

    objects: tuple[str, ...] = ()
    """Names as after `--object`, or kinds (`can`: all states of it that `CONTAINERS` lists)."""
    named: Mapping[str, str] = field(factory=dict)
    """Labels with the object that stands for each, as a scene file for `odwalla:full_open`."""
    instances: int = field(default=12, validator=_things)
    trials: int = field(default=5, validator=_trials)
    """Grasps of each thing in each state."""
    total: int | None = field(default=None, validator=_trials)
    """Grasps in all, in place of `trials`: dealt in turn to the states, then to the things."""

    def dealt(self) -> list[tuple[str, str, int]]:
        """Return label, object and number of the thing for each trial. Raises ConfigError."""
        known = {**{name: name for name in _named(self.objects)}, **self.named}
        if any("#" in name for name in (*known, *known.values())):
            raise ConfigError(
                "objects are named without an instance (#3) here: --instances says how many there are"
            )
        pairs = list(known.items())
        if self.total is None:
            return [
                (label, name, i)
                for label, name in pairs
                for i in range(self.instances)
                for _ in range(self.trials)
            ]
        n = len(pairs)
        dealt = [(k % n, (k // n) % self.instances) for k in range(self.total)]
        return [(*pairs[k], i) for k, i in sorted(dealt)]


def default_objects() -> tuple[str, ...]:
    """Return the names of the paper's containers in all their states."""
    return tuple(f"{kind}:{state}" for kind, states in CONTAINERS.items() for state in states)


def simulated(
    settings: Settings,
    *,
    groups: Sequence[Group],
    seed: int = 0,
    progress: Progress | None = None,
    on_trace: Callable[[int, str, Trace], None] | None = None,
) -> Labelled:
    """Grasp the things of every group under these settings.

    A group without objects stands for all of `CONTAINERS`. `on_trace` is given the number, the label and the trace
    of each trial. Raises ConfigError where the gripper is no simulated one, UnknownName for an object it does not
    know.
    """
    dealt = [one for group in groups for one in _with_objects(group).dealt()]
    if not 1 <= len(dealt) <= TRIALS_PER_SEED:
        raise ConfigError(f"{len(dealt)} trials: give at least 1, and at most a million in all")
    check(settings)
    refuse_real_gripper(settings)
    labels = [label for label, _, _ in dealt]
    numbers = [THINGS_PER_SEED * seed + i for _, _, i in dealt]
    scenes = [f"{name}#{number}" for (_, name, _), number in zip(dealt, numbers, strict=True)]
    things = [f"{class_of(label)}#{number}" for label, number in zip(labels, numbers, strict=True)]
    seeds = [TRIALS_PER_SEED * seed + k for k in range(len(scenes))]

    backend, controller = settings.gripper.create(), settings.controller.create()
    feature_set = settings.features.create()
    if progress is not None:
        progress(0, len(scenes))
    draw = _Drawing(feature_set)
    rows: list[Features] = []
    before: list[Features] = []
    for drawn, trace in _grasps(
        backend, controller, settings, scenes, seeds, draw, progress, on_trace is not None
    ):
        rows.append(drawn[0])
        before.append(drawn[1])
        if on_trace is not None and trace is not None:
            on_trace(len(rows) - 1, labels[len(rows) - 1], trace)
    table = table_of(rows)
    has_width = "p_first" in table.names
    return Labelled(
        source="simulated grasps",
        table=table,
        labels=tuple(labels),
        instances=tuple(things),
        no_order="simulated trials are independent of one another: they have no order of recording",
        before_contact=Control(
            table=table_of(before),
            what="the first half second of the approach: gap, speed, effort, pad forces",
        ),
        width=Control(table=table.columns(["p_first"]), what="p_first alone") if has_width else None,
        no_width="" if has_width else "the feature set has no p_first",
        notes=("simulated: every figure here comes from a model of gripper and objects",),
        provenance={
            "simulated": True,
            "groups": [plain(_with_objects(group)) for group in groups],
            "seed_of_the_trials": seed,
            "settings": {t: dict(settings.values[t]) for t in ("gripper", "controller", "features")},
            "components": {t: one for t, one in settings.components.items() if t != "classifier"},
        },
    )


def refuse_real_gripper(settings: Settings) -> None:
    """Raise ConfigError where the gripper of these settings does not declare objects that it can simulate.

    Nothing is opened: a real gripper that simulated trials opened would move without anybody being asked.
    """
    if not settings.gripper.create().objects():
        raise ConfigError(
            f"gripper {settings.gripper.component.qualified} declares no objects that it can simulate, so it was not "
            "opened. Simulated trials are made on a simulated gripper, as --gripper sim; trials of a real gripper are "
            "made by `graspsense collect`"
        )


def _refuse_real_device(info: DeviceInfo) -> None:
    """Raise ConfigError where what was opened says that it is real, before it is commanded anything."""
    if not info.simulated:
        raise ConfigError(
            f"{info.name} was opened for simulated trials and says that it is a real gripper: it was closed again, "
            "without a command"
        )


def _named(objects: Sequence[str]) -> list[str]:
    """Return the names of these objects, a kind as the names of its states."""
    names: list[str] = []
    for one in objects:
        if one in CONTAINERS:
            names += [f"{one}:{state}" for state in CONTAINERS[one]]
        else:
            names.append(one)
    if len(set(names)) < len(names):
        raise ConfigError(f"an object is named twice: {', '.join(names)}")
    return names


def _with_objects(group: Group) -> Group:
    return group if group.objects or group.named else evolve(group, objects=default_objects())


@frozen
class _Drawing:
    """What is drawn from each trace. A class: it may have to go to another process."""

    feature_set: FeatureSet[Any]

    def __call__(self, trace: Trace) -> tuple[Features, Features]:
        """Return the features and those of before the contact."""
        return self.feature_set.extract(trace), before_contact(trace)


def _grasps(
    backend: SensorBackend[Any],
    controller: Controller[Any],
    settings: Settings,
    scenes: Sequence[str],
    seeds: Sequence[int],
    draw: _Drawing,
    progress: Progress | None,
    traces: bool,
) -> Iterable[tuple[tuple[Features, Features], Trace | None]]:
    """Yield what was drawn from each scene's trace, with the trace where `traces` asks for it."""
    total = len(scenes)
    if isinstance(backend, BatchBackend):
        # Traces are half a megabyte each, so they come some hundred at a time.
        at_once = BATCH if traces else total
        for start in range(0, total, at_once):

            def ahead(done: int, _: int, start: int = start) -> None:
                if progress is not None:
                    progress(start + done, total)

            part = slice(start, start + at_once)
            for one in backend.run_many(
                controller,
                scenes[part],
                seeds[part],
                run=settings.run,
                draw=draw,
                traces=traces,
                progress=ahead,
            ):
                yield one.drawn, one.trace
        return
    for k, (scene, seed) in enumerate(zip(scenes, seeds, strict=True)):
        trace = run_grasp(
            backend.with_object(scene),
            controller,
            evolve(settings.run, seed=seed),
            on_open=_refuse_real_device,
        ).trace
        yield draw(trace), trace
        if progress is not None:
            progress(k + 1, total)
