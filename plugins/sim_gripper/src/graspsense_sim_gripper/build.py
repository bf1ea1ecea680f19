"""From a config, the name of an object and a seed to the parameters and initial states of one grasp.

`build` gives the problem, `reduction.select` its reduced model, and `instantiate` one grasp of it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
from attrs import evolve, fields

from graspsense.plugin_api import (
    CELLS,
    EFFORT,
    Command,
    ConfigError,
    DeviceInfo,
    ScrewLinkage,
    gap_and_rate,
    revolutions_at,
)
from graspsense_sim_gripper.compiled.compose import all_active, uncompressed
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.drive_models import LINKAGES, STRAIGHT
from graspsense_sim_gripper.dynamics.contact import ObjectModel, PadCompliance
from graspsense_sim_gripper.dynamics.drive import Drive, Friction
from graspsense_sim_gripper.dynamics.state import Contact, Motion, PlantState
from graspsense_sim_gripper.objects.instance import Instance, cell_weights, central_cells, sample
from graspsense_sim_gripper.objects.library import find, split_number
from graspsense_sim_gripper.objects.spec import ObjectSpec
from graspsense_sim_gripper.problem import GraspSetup, Problem
from graspsense_sim_gripper.reduction.candidates import reduce_plant
from graspsense_sim_gripper.reduction.levels import step_tolerance
from graspsense_sim_gripper.reduction.model import Reduction
from graspsense_sim_gripper.reduction.propose import grip_of, propose
from graspsense_sim_gripper.sensing import ImageClock, PadCells, SensorParams, initial_sensor
from graspsense_sim_gripper.stepping.scheme import PlantParams, Steps

EFFORT_LIMIT_N: Final = 100.0
SPEED_LIMIT_M_S: Final = 0.2
"""Software limits of the PR2 gripper at the time of the paper."""
OPENING_N: Final = -20.0
"""The authors' recordings show +17 and +20 N (opening) between squeezes."""
TARE_IMAGES: Final = 6
CELL_OFFSET: Final = (3300.0, 250.0)
"""Mean and spread of an unloaded cell's counts: 2900 to 3800 are reported."""
UNLOADED: Final = (CELL_OFFSET[0],) * CELLS
EVEN_WEIGHTS: Final = (1.0 / 15.0,) * 15
"""The part of the force on each cell where there is no object."""
_SENSOR_SETTINGS: Final = ("noise_counts", "pad_period_s", "pad_cells", "pad_delay_s")
_NOT_OF_THE_MODEL: Final[dict[str, Any]] = {
    field.name: field.default
    for field in fields(SimConfig)
    if field.name in ("object", "explain", "compile", *_SENSOR_SETTINGS)
} | {"sensor": "ideal"}
"""Settings on which a reduced model does not depend, as its trial grasps have them."""


def device_info(config: SimConfig) -> DeviceInfo:
    """Return how this gripper presents itself."""
    return DeviceInfo(
        name="simulated PR2 gripper",
        clock="virtual",
        simulated=True,
        rate_hz=config.rate_hz,
        effort_limit_n=EFFORT_LIMIT_N,
        speed_limit_m_s=SPEED_LIMIT_M_S,
        opening=Command(EFFORT, OPENING_N, math.inf, math.inf),
        relaxed=Command(EFFORT, 0.0, math.inf, math.inf),
        tare_images=0 if config.sensor == "ideal" else TARE_IMAGES,
        notes=("simulated: every figure comes from a model",),
    )


def build(config: SimConfig, scene: str) -> Problem:
    """Return the problem of this object (`none`: no object; `*.toml`: a scene file) in a gripper.

    Raises UnknownName, and ConfigError for a file that cannot be read as an object.
    """
    if scene == "none":
        return problem_of(config, None)
    name, number = split_number(scene)
    return problem_of(config, find(name), number)


def problem_of(config: SimConfig, spec: ObjectSpec | None, number: int | None = None) -> Problem:
    """Return the problem of an object, or of its instance of this number; `spec` None: no object."""
    model_config = evolve(config, **_NOT_OF_THE_MODEL)
    nominal = None
    if spec is not None:
        nominal = _setup(evolve(model_config, spread=False), sample(spec, None), np.random.default_rng(0))
        if number is not None:
            # A numbered instance differs from the nominal object, as any does with spread.
            model_config = evolve(model_config, spread=True)
    return Problem(
        config=config,
        spec=spec,
        number=number,
        model_config=model_config,
        device=device_info(model_config),
        nominal=nominal,
    )


def instantiate(problem: Problem, reduction: Reduction | None, seed: int) -> GraspSetup:
    """Return the grasp with this seed, of an instance in its reduced model; `reduction` None: with all its terms.

    Raises ConfigError for an object of a scene file that the open fingers would cut into.
    """
    config, rng = problem.config, np.random.default_rng(seed)
    instance = None
    if problem.spec is not None:
        instance = sample(problem.spec, rng if config.spread else None, problem.number)
        _check_fit(config, instance)
    return _setup(config, instance, rng, reduction)


def unverified_setup(config: SimConfig, scene: str | ObjectSpec | None, seed: int) -> GraspSetup:
    """Return a grasp in a model that is proposed without a trial grasp, for studies of the plant alone.

    Raises as `build` and `instantiate` do.
    """
    problem = build(config, scene) if isinstance(scene, str) else problem_of(config, scene)
    reduction = None if problem.spec is None else propose(problem, grip_of(problem))
    return instantiate(problem, reduction, seed)


def _setup(
    config: SimConfig, instance: Instance | None, rng: np.random.Generator, reduction: Reduction | None = None
) -> GraspSetup:
    """Return the grasp of an instance in its reduced model; `reduction` None: with all its terms."""
    plant, state = _plant(config, instance, rng)
    if instance is not None and reduction is not None:
        plant = reduce_plant(plant, instance.kinds, reduction)
    sensor = _sensor(config, instance, rng)
    return GraspSetup(
        kinds=instance.kinds if instance else (),
        terms=instance.terms if instance else (),
        plant=plant,
        state=state,
        sensor=sensor,
        sensor_state=initial_sensor(sensor, state),
        dt_s=1.0 / config.rate_hz,
        rng=rng,
    )


def _check_fit(config: SimConfig, instance: Instance) -> None:
    """Refuse an object of a scene file that the open fingers would cut into; the catalogue's are not checked."""
    where = instance.spec.file
    needed_m = instance.width_m + 2.0 * abs(instance.offset_m)
    if where and instance.width_m <= 0.0:
        raise ConfigError(f"{where}: width_m: this instance is {instance.width_m:g} m wide (width_spread_m)")
    if where and needed_m >= config.open_gap_m:
        what = "width_m" if instance.width_m >= config.open_gap_m else "offset_m"
        raise ConfigError(
            f"{where}: {what}: {instance.width_m:g} m wide and {instance.offset_m:g} m off the centre, it needs "
            f"{needed_m:g} m, and the fingers open to {config.open_gap_m:g} m (gripper.open_gap_m)"
        )


def _plant(
    config: SimConfig, instance: Instance | None, rng: np.random.Generator
) -> tuple[PlantParams, PlantState]:
    """Return the plant's parameters, and its state before the grasp: open, at rest, without contact.

    Friction varies between trials and is drawn here.
    """
    gripper = _gripper(config)
    drive = gripper.drive
    if config.spread:
        friction_n = max(
            drive.friction.coulomb_n + config.coulomb_spread_n * float(rng.standard_normal()), 0.0
        )
        breakaway_n = max(float(config.breakaway_n), friction_n)
        friction = drive.friction._replace(coulomb_n=friction_n, breakaway_n=breakaway_n)
        drive = drive._replace(friction=friction)
    if instance is None:
        # Thinner than the closed gap, so that no finger ever touches it.
        model = ObjectModel(-1.0, 0.0, gripper.pads, all_active(()))
        at_rest, offset = uncompressed(()), 0.0
    else:
        model = ObjectModel(
            width_m=instance.width_m,
            table_friction_n=instance.table_n,
            terms=all_active(instance.terms),
            pads=gripper.pads,
            held=1 if instance.spec.held else 0,
        )
        at_rest, offset = uncompressed(instance.kinds), instance.offset_m
    state = PlantState(gripper.motion, Contact(0.0, 0.0, offset, 0, at_rest, at_rest))
    return PlantParams(drive, model, gripper.steps), state


class _Gripper(NamedTuple):
    """What is the same in every grasp of a config."""

    drive: Drive
    pads: PadCompliance
    steps: Steps
    """Those without a reduced model."""
    motion: Motion
    """At rest with open fingers."""


@lru_cache(maxsize=64)
def _gripper(config: SimConfig) -> _Gripper:
    link = _linkage(config)
    drive = Drive(
        link=link,
        inertia=_inertia(config),
        friction=Friction(
            coulomb_n=float(config.coulomb_n),
            breakaway_n=max(float(config.breakaway_n), float(config.coulomb_n)),
            stribeck_m_s=float(config.stribeck_m_s),
            load_friction_coefficient=float(config.load_friction_coefficient),
            damping_n_s_m=float(config.damping_n_s_m),
        ),
        closed_rev=revolutions_at(link, 0.0),
        open_rev=revolutions_at(link, config.open_gap_m),
        lag_s=float(config.drive_lag_s),
    )
    pads = PadCompliance(
        stiffness_n_m=0.5 * float(config.pad_stiffness_n_m),
        damping_n_s_m=0.5 * float(config.pad_damping_n_s_m),
        branch_n_m=0.5 * float(config.pad_creep_n_m),
        branch_tau_s=float(config.pad_creep_s),
    )
    motion = Motion(drive.open_rev, 0.0, *gap_and_rate(link, drive.open_rev))
    return _Gripper(drive, pads, Steps(step_tolerance(config.accuracy)), motion)


def _linkage(config: SimConfig) -> ScrewLinkage:
    return LINKAGES[config.transmission]


def _inertia(config: SimConfig) -> float:
    """Return the inertia on the motor's angle, as `Drive` has it."""
    if config.transmission == "straight":
        return config.moving_mass_kg * STRAIGHT.pitch_m * STRAIGHT.pitch_m
    return 4.0 * math.pi * math.pi * config.rotor_kg_m2


def _sensor(config: SimConfig, instance: Instance | None, rng: np.random.Generator) -> SensorParams:
    """Return the sensors; the cells' offsets and the phase of the pads' clock are drawn here."""
    period = float(config.pad_period_s)
    if config.sensor == "ideal":
        cells = PadCells(EVEN_WEIGHTS, UNLOADED)
        return SensorParams(1, _linkage(config), ImageClock(0.0, period, 0.0), 1.0, 0.0, cells, cells)
    mean, spread = CELL_OFFSET
    offsets: Sequence[Sequence[float]] = (mean + spread * rng.standard_normal((2, CELLS))).tolist()
    weights = cell_weights(instance.spec.patch, instance.patch_row) if instance else EVEN_WEIGHTS
    present = central_cells(config.pad_cells)
    weights = tuple([weight if cell in present else 0.0 for cell, weight in enumerate(weights)])
    left, right = (PadCells(weights, tuple(offset)) for offset in offsets)
    return SensorParams(
        ideal=0,
        link=_linkage(config),
        clock=ImageClock(float(rng.random()) * period, period, float(config.pad_delay_s)),
        share=float(instance.share) if instance else 1.0,
        noise_counts=float(config.noise_counts),
        left=left,
        right=right,
    )
