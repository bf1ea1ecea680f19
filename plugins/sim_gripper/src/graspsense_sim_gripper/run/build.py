"""Building the parameters and initial states of a grasp from a config, the name of an object, and a seed.

This takes three steps: `build` gives the problem, `accuracy.select` its steps, and `instantiate` one grasp.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from functools import cached_property, lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
from attrs import evolve, fields, frozen

from graspsense.gripper_api import gap_and_rate, revolutions_at
from graspsense.plugin_api import EFFORT, Command, ConfigError, DeviceInfo
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.plant.drive import Drive, Friction
from graspsense_sim_gripper.plant.drive_models import LINKAGES, STRAIGHT
from graspsense_sim_gripper.plant.fingertip import CELL_OFFSET, CELLS
from graspsense_sim_gripper.plant.object_model import ObjectModel
from graspsense_sim_gripper.plant.pads import PadCompliance
from graspsense_sim_gripper.plant.sensing import (
    ImageClock,
    PadCells,
    SensorParams,
    SensorState,
    initial_sensor,
)
from graspsense_sim_gripper.plant.state import Contact, ContactState, Motion
from graspsense_sim_gripper.run.accuracy.chosen_steps import ChosenSteps
from graspsense_sim_gripper.run.accuracy.levels import step_tolerance
from graspsense_sim_gripper.run.compiled.compose import all_active, uncompressed
from graspsense_sim_gripper.run.drawing import (
    NO_NUMBER,
    CellArrays,
    Drawn,
    draw_buffers,
    draw_grasp,
    scene_numbers,
)
from graspsense_sim_gripper.run.problem import GraspSetup
from graspsense_sim_gripper.scene.instance import PAD_CELLS, deepest_dent, draws_of_number, params_of_terms
from graspsense_sim_gripper.scene.library import find, split_number
from graspsense_sim_gripper.scene.random_numbers import key_of
from graspsense_sim_gripper.scene.spec import ObjectSpec, TermParams
from graspsense_sim_gripper.solve.scheme import PlantParams, PlantState, Steps

EFFORT_LIMIT_N: Final = 100.0
SPEED_LIMIT_M_S: Final = 0.2
"""Software limits of the PR2 gripper at the time of the paper."""
OPENING_N: Final = -20.0
"""The effort that opens the fingers. The recordings of the paper's authors show 17 and 20 N between squeezes."""
TARE_IMAGES: Final = 6
"""Number of cell images in a tare."""
IDEAL_CELLS: Final = PadCells(np.full(PAD_CELLS, 1.0 / PAD_CELLS), np.full(CELLS, CELL_OFFSET[0]))
"""The cells of an ideal sensor; they are never read."""
EXAMPLES: Final = 4
"""Number of instances whose trial grasps verify a model whose steps have no estimate of their error."""
_SENSOR_SETTINGS: Final = ("noise_counts", "pad_period_s", "pad_cells", "pad_delay_s")
_NOT_OF_THE_MODEL: Final[dict[str, Any]] = {
    field.name: field.default
    for field in fields(SimConfig)
    if field.name in ("object", "explain", "compile", *_SENSOR_SETTINGS)
} | {"sensor": "ideal"}
"""The settings that the choice of steps does not depend on, with the values that they have in its trial grasps."""


def device_info(config: SimConfig) -> DeviceInfo:
    """Return the properties of this gripper as a device: rate, limits, opening command, and tare."""
    return DeviceInfo(
        name="simulated PR2 gripper",
        clock="virtual",
        simulated=True,
        harmless=True,
        rate_hz=config.rate_hz,
        effort_limit_n=EFFORT_LIMIT_N,
        speed_limit_m_s=SPEED_LIMIT_M_S,
        opening=Command(EFFORT, OPENING_N, math.inf, math.inf),
        relaxed=Command(EFFORT, 0.0, math.inf, math.inf),
        tare_images=0 if config.sensor == "ideal" else TARE_IMAGES,
        open_gap_m=config.open_gap_m,
        notes=("simulated: every figure comes from a model",),
    )


@frozen(eq=False)
class Problem:
    """An object in the gripper, before a seed draws an instance of it."""

    config: SimConfig
    spec: ObjectSpec | None
    """None: there is no object."""
    number: int | None = None
    """The number of a particular instance; None: the seed draws the instance."""

    @cached_property
    def model_config(self) -> SimConfig:
        """The settings that the choice of steps depends on; all others have fixed values, such as ideal sensors.

        `spread` is True for a numbered instance, which differs from the nominal object like those that a seed draws.
        """
        return _model_config(self.config, self.config.spread or self.number is not None)

    @cached_property
    def device(self) -> DeviceInfo:
        """The properties of the gripper with ideal sensors, for the controller of a trial grasp."""
        return device_info(self.model_config)

    @cached_property
    def nominal(self) -> GraspSetup:
        """The grasp of the nominal object with all its terms. Raises TypeError if there is no object."""
        if self.spec is None:
            raise TypeError("where there is no object there is nothing to grasp")
        return _setup(_model_config(self.config, False), self.spec, None, None)

    def examples(self) -> Iterator[GraspSetup]:
        """Yield grasps of some instances with all their terms, always the same ones; none if they do not differ.

        An instance that does not fit between the open fingers is left out.
        """
        for seed in range(EXAMPLES if self.model_config.spread else 0):
            with suppress(ConfigError):
                yield _setup(self.model_config, self.spec, None, seed)


def build(config: SimConfig, scene: str) -> Problem:
    """Return the problem of grasping an object: a name, a scene file (`*.toml`), or `none` for no object.

    Raises UnknownName for an unknown name, ConfigError for a file that cannot be read as an object.
    """
    if scene == "none":
        return Problem(config, None)
    name, number = split_number(scene)
    return Problem(config, find(name), number)


@lru_cache(maxsize=64)
def _model_config(config: SimConfig, spread: bool) -> SimConfig:
    """Return the settings that the choice of steps depends on, with this `spread`. A batch shares them."""
    return evolve(config, **_NOT_OF_THE_MODEL, spread=spread)


def instantiate(problem: Problem, chosen: ChosenSteps | None, seed: int | None) -> GraspSetup:
    """Return the grasp with this seed, of an instance; `chosen` None: in steps that are not chosen for it.

    `seed` None: that of the nominal object, for what all grasps of a scene have in common. It may not fit between the
    fingers, and its cells measure nothing.

    Raises ConfigError for an object of a scene file that the open fingers would cut into, and ValueError for a seed
    that is negative or has more than 64 bits.
    """
    return _setup(problem.config, problem.spec, problem.number, seed, chosen)


def _setup(
    config: SimConfig,
    spec: ObjectSpec | None,
    number: int | None,
    seed: int | None,
    chosen: ChosenSteps | None = None,
) -> GraspSetup:
    """Return what `instantiate` does."""
    scene = scene_numbers(config, spec)
    if seed is None:
        scene = scene._replace(varies=0, period_s=0.0)
    buffers = draw_buffers(scene)
    of_number = NO_NUMBER if number is None or spec is None else draws_of_number(spec, number)
    drawn = draw_grasp(scene, key_of(seed or 0), of_number, buffers)
    width_m, terms = drawn.placement.width_m, ()
    if spec is not None:
        width_m -= deepest_dent(spec, buffers.params)
        terms = params_of_terms(spec, buffers.params)
        if seed is not None:
            check_fit(config, spec, width_m, drawn.placement.offset_m)
    plant, state = _plant(config, spec, drawn, width_m, terms)
    if chosen is not None:
        plant = chosen.applied_to(plant)
    return GraspSetup(
        kinds=() if spec is None else spec.kinds,
        terms=terms,
        plant=plant,
        state=state,
        sensor=_sensor(config, drawn, buffers.cells),
        sensor_state=_gripper(config).sensor_state,
        dt_s=1.0 / config.rate_hz,
        seed=seed or 0,
    )


def check_fit(config: SimConfig, spec: ObjectSpec, width_m: float, offset_m: float) -> None:
    """Raise ConfigError if an instance of a scene file does not fit between the fingers, or has no width or terms."""
    where = spec.file
    needed_m = width_m + 2.0 * abs(offset_m)
    if where and width_m <= 0.0:
        raise ConfigError(f"{where}: width_m: this instance is {width_m:g} m wide (width_spread_m)")
    if where and needed_m >= config.open_gap_m:
        what = "width_m" if width_m >= config.open_gap_m else "offset_m"
        raise ConfigError(
            f"{where}: {what}: {width_m:g} m wide and {offset_m:g} m off the centre, it needs "
            f"{needed_m:g} m, and the fingers open to {config.open_gap_m:g} m (gripper.open_gap_m)"
        )
    if where and not spec.terms:
        raise ConfigError(
            f"{where}: terms: there are none, so nothing resists the fingers: add a table [[terms]] for each law"
        )


def _plant(
    config: SimConfig, spec: ObjectSpec | None, drawn: Drawn, width_m: float, terms: tuple[TermParams, ...]
) -> tuple[PlantParams, PlantState]:
    """Return the parameters of the plant, and its state before the grasp: open, at rest, without contact."""
    gripper = _gripper(config)
    friction = gripper.drive.friction._replace(coulomb_n=drawn.coulomb_n, breakaway_n=drawn.breakaway_n)
    drive = gripper.drive._replace(friction=friction)
    model = ObjectModel(
        width_m=width_m,
        table_friction_n=0.0 if spec is None else spec.table_n,
        terms=all_active(terms),
        pads=gripper.pads,
        held=1 if spec is not None and spec.held else 0,
    )
    at_rest = _uncompressed(() if spec is None else spec.kinds)
    right = (at_rest,) if model.held == 1 else ()
    state = PlantState(
        gripper.motion,
        Contact(
            left_n=0.0, right_n=0.0, offset_m=drawn.placement.offset_m, touched=0, left=at_rest, right=right
        ),
    )
    return PlantParams(drive, model, gripper.steps), state


@lru_cache(maxsize=256)
def _uncompressed(kinds: tuple[str, ...]) -> ContactState:
    return uncompressed(kinds)


class _Gripper(NamedTuple):
    """The parameters that all grasps of a config share."""

    drive: Drive
    pads: PadCompliance
    steps: Steps
    """The steps of a model that is not reduced."""
    motion: Motion
    """At rest with open fingers."""
    sensor_state: SensorState
    """What the sensors show then."""


@lru_cache(maxsize=64)
def _gripper(config: SimConfig) -> _Gripper:
    link = LINKAGES[config.transmission]
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
        # Two pads in series compress twice as far.
        hardening_m=math.inf if config.pad_hardening_m is None else 2.0 * config.pad_hardening_m,
        exponent=float(config.pad_exponent),
    )
    motion = Motion(drive.open_rev, 0.0, *gap_and_rate(link, drive.open_rev))
    return _Gripper(
        drive=drive,
        pads=pads,
        steps=Steps(step_tolerance(config.accuracy)),
        motion=motion,
        sensor_state=initial_sensor(link, motion),
    )


def drive_and_pads(config: SimConfig) -> tuple[Drive, PadCompliance]:
    """Return the drive and the fingertips of these settings."""
    gripper = _gripper(config)
    return gripper.drive, gripper.pads


def _inertia(config: SimConfig) -> float:
    """Return the inertia `Drive.inertia`: m g^2 of straight jaws, (2 pi)^2 J of a rotor."""
    if config.transmission == "straight":
        return config.moving_mass_kg * STRAIGHT.pitch_m * STRAIGHT.pitch_m
    return 4.0 * math.pi * math.pi * config.rotor_kg_m2


def _sensor(config: SimConfig, drawn: Drawn, cells: CellArrays) -> SensorParams:
    """Return the sensors of a grasp."""
    period = float(config.pad_period_s)
    if config.sensor == "ideal":
        clock = ImageClock(0.0, period, 0.0)
        return SensorParams(
            ideal=1,
            link=LINKAGES[config.transmission],
            clock=clock,
            share=1.0,
            noise_counts=0.0,
            left=IDEAL_CELLS,
            right=IDEAL_CELLS,
        )
    return SensorParams(
        ideal=0,
        link=LINKAGES[config.transmission],
        clock=ImageClock(drawn.image_phase_s, period, float(config.pad_delay_s)),
        share=float(drawn.placement.share),
        noise_counts=float(config.noise_counts),
        left=PadCells(cells.weights, cells.left),
        right=PadCells(cells.weights, cells.right),
    )
