"""Labelled trials from a simulated gripper: many things of each kind, each grasped several times.

Thing number i of a kind is the same in all its trials and in all its states (`odwalla:full_open#3`); what differs
between its trials is how it is placed, the gripper's friction and the sensors' noise. Numbers and seeds follow
from one seed: thing i of seed s has the number 1000 s + i, and trial k, counted over all, the seed 1 000 000 s + k.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

from attrs import evolve, fields_dict

from graspsense.core.errors import ConfigError
from graspsense.core.features import Features, table_of
from graspsense.core.labelled import Control, Labelled
from graspsense.core.roles import BatchBackend, Controller, SensorBackend
from graspsense.core.runner import run_grasp
from graspsense.core.wiring import check
from graspsense.trials.before_contact import before_contact

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
BATCH: Final = 1000
"""Grasps asked for at once: large enough that a backend may compile them, and at most some 400 MB of traces."""

Progress = Callable[[int, int], None]


def default_objects() -> tuple[str, ...]:
    """Return the names of the paper's containers in all their states."""
    return tuple(f"{kind}:{state}" for kind, states in CONTAINERS.items() for state in states)


def simulated(
    settings: Settings,
    *,
    objects: Sequence[str] = (),
    instances: int = 12,
    trials: int = 5,
    seed: int = 0,
    progress: Progress | None = None,
) -> Labelled:
    """Grasp `instances` things of each object `trials` times each under these settings.

    `objects` are names as after `--object`, or kinds (`can`: all states of it that `CONTAINERS` lists); none
    stands for all of `CONTAINERS`. Raises ConfigError where the gripper is no simulated one, UnknownName for an
    object it does not know.
    """
    names = _named(objects)
    if not 1 <= instances <= THINGS_PER_SEED:
        raise ConfigError(f"{instances} instances of an object: give 1 to {THINGS_PER_SEED}")
    if trials < 1 or instances * trials * len(names) > TRIALS_PER_SEED:
        raise ConfigError(f"{trials} trials of an instance: give at least 1, and at most a million in all")
    check(settings)
    config = settings.gripper.config
    if "object" not in fields_dict(type(config)):
        raise ConfigError(
            f"gripper {settings.gripper.component.qualified} takes no object, so it cannot simulate trials. "
            "Choose a simulated one, as in --gripper sim"
        )
    scenes, labels, things = [], [], []
    for name in names:
        for i in range(instances):
            number = THINGS_PER_SEED * seed + i
            scenes += [f"{name}#{number}"] * trials
            things += [f"{name.partition(':')[0]}#{number}"] * trials
        labels += [name] * (instances * trials)
    seeds = [TRIALS_PER_SEED * seed + k for k in range(len(scenes))]

    backend, controller = settings.gripper.create(), settings.controller.create()
    feature_set = settings.features.create()
    if progress is not None:
        progress(0, len(scenes))
    rows: list[Features] = []
    before: list[Features] = []
    for trace in _traces(backend, controller, settings, scenes, seeds):
        rows.append(feature_set.extract(trace))
        before.append(before_contact(trace))
        if progress is not None:
            progress(len(rows), len(scenes))
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
            "objects": list(names),
            "instances": instances,
            "trials_of_an_instance": trials,
            "seed_of_the_trials": seed,
            "settings": {t: dict(settings.values[t]) for t in ("gripper", "controller", "features")},
            "components": {t: one for t, one in settings.components.items() if t != "classifier"},
        },
    )


def _named(objects: Sequence[str]) -> list[str]:
    names: list[str] = []
    for one in objects:
        if one in CONTAINERS:
            names += [f"{one}:{state}" for state in CONTAINERS[one]]
        else:
            names.append(one)
    if len(set(names)) < len(names):
        raise ConfigError(f"an object is named twice: {', '.join(names)}")
    if any("#" in name for name in names):
        raise ConfigError(
            "objects are named without an instance (#3) here: --instances says how many there are"
        )
    return names or list(default_objects())


def _traces(
    backend: SensorBackend[Any],
    controller: Controller[Any],
    settings: Settings,
    scenes: Sequence[str],
    seeds: Sequence[int],
) -> Iterable[Trace]:
    """Yield one trace a scene."""
    if isinstance(backend, BatchBackend):
        for start in range(0, len(scenes), BATCH):
            end = start + BATCH
            yield from backend.run_many(controller, scenes[start:end], seeds[start:end])
        return
    for scene, seed in zip(scenes, seeds, strict=True):
        one = settings.gripper.component.create(evolve(settings.gripper.config, object=scene))
        yield run_grasp(one, controller, evolve(settings.run, seed=seed)).trace
