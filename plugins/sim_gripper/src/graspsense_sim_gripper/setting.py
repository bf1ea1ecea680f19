"""From a config, an object's name and a seed to the numbers of one grasp."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
from attrs import evolve, frozen
from numpy.typing import NDArray

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
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.drive_models import LINKAGES, STRAIGHT
from graspsense_sim_gripper.dynamics.state import Contact, Motion, PlantState
from graspsense_sim_gripper.objects.instance import Instance, cell_weights, central_cells, sample
from graspsense_sim_gripper.objects.library import find, split_number
from graspsense_sim_gripper.objects.spec import ObjectSpec
from graspsense_sim_gripper.plant import (
    EXPLICIT,
    STIFF,
    Drive,
    PlantParams,
    Skin,
    Steps,
    Thing,
)
from graspsense_sim_gripper.selection import (
    CAREFUL,
    WHOLE,
    Choice,
    Rung,
    choose,
    growth,
    tolerance,
    untouched,
    whole,
)
from graspsense_sim_gripper.sensing import ImageClock, PadCells, SensorParams, SensorState, initial_sensor

EFFORT_LIMIT_N: Final = 100.0
SPEED_LIMIT_M_S: Final = 0.2
"""Software limits of the PR2 gripper at the time of the paper."""
OPENING_N: Final = -20.0
"""The authors' recordings show +17 and +20 N (opening) between squeezes."""
TARE_IMAGES: Final = 6
CELL_OFFSET: Final = (3300.0, 250.0)
"""Mean and spread of an unloaded cell's counts: 2900 to 3800 are reported."""
UNLOADED: Final = (CELL_OFFSET[0],) * CELLS
EVEN: Final = (1.0 / 15.0,) * 15
"""What each cell carries where nothing says how the force is spread."""
IMAGES_A_BLOCK: Final = 64
REFERENCE: Final = 1e-3
"""The accuracy that a reference's steps begin at."""
SETTLED: Final = 1e-7
"""Where speed and force after a tick change by less than this part of the accuracy, halving the steps ends."""
FORCE_N: Final = 20.0
SPEED_M_S: Final = 0.01
"""The force and the speed of a grasp that nobody says anything of: those of the paper."""


def _linkage(config: SimConfig) -> ScrewLinkage:
    return LINKAGES[config.transmission]


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


@frozen(kw_only=True)
class Setting:
    """One grasp before it begins: the numbers of plant and sensor, their first states, what the seed still gives."""

    kinds: tuple[str, ...]
    """The object's terms."""
    terms: tuple[Any, ...]
    """Their parameters, whether the model keeps them or not."""
    plant: PlantParams
    body: PlantState
    sensor: SensorParams
    sensed: SensorState
    dt_s: float
    choice: Choice | None
    """Which model of the object this is; None where there is none."""
    drawn: np.random.Generator
    """The seed's generator after all of the above was drawn; nobody draws from it any more."""

    def noise(self) -> Iterator[NDArray[np.float64]]:
        """Yield blocks of rows of 44 standard normal numbers, one row an image; the same at every call."""
        # As a copy of it would, in a quarter of the time.
        rng = np.random.default_rng(0)
        rng.bit_generator.state = self.drawn.bit_generator.state
        while True:
            yield rng.standard_normal((IMAGES_A_BLOCK, 2 * CELLS))


def set_scene(config: SimConfig, scene: str, seed: int, chooser: Chooser | None = None) -> Setting:
    """Return the grasp of this object (`none`: nothing there; `*.toml`: a scene file) with this seed.

    `chooser` as of `setting_of`. Raises UnknownName, and ConfigError for a file that describes nothing which fits
    between the fingers.
    """
    if scene == "none":
        return setting_of(config, None, seed)
    name, number = split_number(scene)
    return setting_of(config, find(name), seed, number, chooser)


def setting_of(
    config: SimConfig,
    spec: ObjectSpec | None,
    seed: int,
    number: int | None = None,
    chooser: Chooser | None = None,
) -> Setting:
    """Return the grasp of an object of this kind, or of its instance of this number. Raises ConfigError.

    `chooser` says which model it has; without one it is `choice_of`, which no trial grasp has checked.
    """
    rng = np.random.default_rng(seed)
    instance = choice = None
    if spec is not None:
        instance = sample(spec, rng if config.spread else None, number)
        _check_fit(config, instance)
        # An instance by its number is not the one that is tried.
        wanted = config if number is None or config.spread else _of_any_instance(config)
        choice = (chooser or choice_of)(wanted, spec)
    plant, body = _plant(config, instance, choice, rng)
    sensor = _sensor(config, instance, rng)
    return Setting(
        kinds=instance.kinds if instance else (),
        terms=instance.terms if instance else (),
        plant=plant,
        body=body,
        sensor=sensor,
        sensed=initial_sensor(sensor, body),
        dt_s=1.0 / config.rate_hz,
        choice=choice,
        drawn=rng,
    )


@lru_cache(maxsize=64)
def _of_any_instance(config: SimConfig) -> SimConfig:
    return evolve(config, spread=True)


def _check_fit(config: SimConfig, instance: Instance) -> None:
    """Refuse a file's object that the open fingers would cut into. One of the catalogue is the gripper's to find."""
    where = instance.spec.file
    needs_m = instance.width_m + 2.0 * abs(instance.offset_m)
    if where and instance.width_m <= 0.0:
        raise ConfigError(
            f"{where}: width_m: this one comes out {instance.width_m:g} m wide (width_spread_m)"
        )
    if where and needs_m >= config.open_gap_m:
        what = "width_m" if instance.width_m >= config.open_gap_m else "offset_m"
        raise ConfigError(
            f"{where}: {what}: {instance.width_m:g} m wide and {instance.offset_m:g} m off the centre, it needs "
            f"{needs_m:g} m, and the fingers open to {config.open_gap_m:g} m (gripper.open_gap_m)"
        )


def _plant(
    config: SimConfig, instance: Instance | None, choice: Choice | None, rng: np.random.Generator
) -> tuple[PlantParams, PlantState]:
    """Return the plant's numbers and its state before the grasp: open, at rest, nothing touched.

    Friction varies between trials, so it is drawn here.
    """
    drive, skins_n_m, skin, steps, gap, rate = _bare(config)
    if config.spread:
        friction_n = max(drive.coulomb_n + config.coulomb_spread_n * float(rng.standard_normal()), 0.0)
        drive = drive._replace(coulomb_n=friction_n, breakaway_n=max(float(config.breakaway_n), friction_n))
    if instance is None:
        # Nothing there: thinner than the closed gap, so that no finger ever touches it.
        thing, at_rest, offset = Thing(-1.0, 0.0, skins_n_m, whole(()), skin), untouched(()), 0.0
    else:
        thing, at_rest, offset = _thing(config, instance), untouched(instance.kinds), instance.offset_m
        if choice is not None:
            thing, steps = choice.apply(thing, instance.kinds), choice.steps
    motion = Motion(drive.open_rev, 0.0, gap, rate)
    state = PlantState(motion, Contact(0.0, 0.0, offset, 0, at_rest, at_rest))
    return PlantParams(drive, thing, steps), state


class _Bare(NamedTuple):
    """What is the same in every grasp of a config: drive, covers, steps where no model says, gap and rate when open."""

    drive: Drive
    skins_n_m: float
    skin: Skin
    steps: Steps
    gap_m: float
    rate_m_rev: float


@lru_cache(maxsize=64)
def _bare(config: SimConfig) -> _Bare:
    link = _linkage(config)
    drive = Drive(
        link=link,
        inertia=_rotor(config),
        coulomb_n=float(config.coulomb_n),
        breakaway_n=max(float(config.breakaway_n), float(config.coulomb_n)),
        stribeck_m_s=float(config.stribeck_m_s),
        load_share=float(config.load_share),
        damping_n_s_m=float(config.damping_n_s_m),
        closed_rev=revolutions_at(link, 0.0),
        open_rev=revolutions_at(link, config.open_gap_m),
        lag_s=float(config.drive_lag_s),
    )
    skin = Skin(
        damping_n_s_m=0.5 * float(config.skin_damping_n_s_m),
        arm_n_m=0.5 * float(config.skin_creep_n_m),
        tau_s=float(config.skin_creep_s),
    )
    steps = Steps(tolerance(config.accuracy))
    return _Bare(drive, 0.5 * float(config.skin_n_m), skin, steps, *gap_and_rate(link, drive.open_rev))


def _thing(config: SimConfig, instance: Instance) -> Thing:
    """Return the object with all its terms, and the covers it is felt through."""
    bare = _bare(config)
    return Thing(
        width_m=instance.width_m,
        table_n=instance.table_n,
        skins_n_m=bare.skins_n_m,
        terms=whole(instance.terms),
        skin=bare.skin,
        held=1 if instance.spec.held else 0,
    )


Chooser = Callable[[SimConfig, ObjectSpec], Choice]
_CHOICES: dict[tuple[SimConfig, int, Rung, float, float], tuple[ObjectSpec, Choice]] = {}


def choice_of(
    config: SimConfig,
    spec: ObjectSpec,
    *,
    rung: Rung = CAREFUL,
    force_n: float | None = None,
    speed_m_s: float | None = None,
) -> Choice:
    """Return the model for this object: chosen once for the spec's own figures, so that all its instances share it.

    What the config expects of the grasp comes before the force and the speed given here.
    """
    force_n = config.expected_force_n or force_n or FORCE_N
    speed_m_s = config.expected_speed_m_s or speed_m_s or SPEED_M_S
    if config.fidelity != "scene" and rung.model_share > 0.0:
        rung = WHOLE
    key = (config, id(spec), rung, force_n, speed_m_s)
    if key not in _CHOICES:
        instance = sample(spec, None)
        link = _linkage(config)
        _, rate = gap_and_rate(link, revolutions_at(link, min(max(instance.width_m, 0.0), config.open_gap_m)))
        choice = choose(
            _thing(config, instance),
            instance.kinds,
            accuracy=config.accuracy,
            force_n=force_n,
            speed_m_s=speed_m_s,
            dt_s=1.0 / config.rate_hz,
            mass_kg=_rotor(config) / (rate * rate),
            damping_n_s_m=config.damping_n_s_m,
            rubs=config.coulomb_n > 0.0,
            rung=rung,
        )
        steps = choice.steps
        if config.scheme != "auto":
            steps = steps._replace(
                scheme=(steps.scheme or STIFF) if config.scheme == "implicit" else EXPLICIT
            )
        if config.step_s is not None:
            steps = steps._replace(tolerance=math.inf, longest_s=float(config.step_s))
        if config.fidelity == "reference":
            steps = steps._replace(
                tolerance=min(steps.tolerance, tolerance(REFERENCE)),
                settle=SETTLED * config.accuracy,
                growth=min(steps.growth, growth(REFERENCE)),
            )
        _CHOICES[key] = (spec, evolve(choice, steps=steps))
    return _CHOICES[key][1]


def _rotor(config: SimConfig) -> float:
    """Return the inertia on the motor's angle, as `Drive` has it."""
    if config.transmission == "straight":
        return config.moving_mass_kg * STRAIGHT.pitch_m * STRAIGHT.pitch_m
    return 4.0 * math.pi * math.pi * config.rotor_kg_m2


def _sensor(config: SimConfig, instance: Instance | None, rng: np.random.Generator) -> SensorParams:
    """Return the sensing chain; the cells' offsets and the phase of the pads' clock are drawn here."""
    if config.sensor == "ideal":
        cells = PadCells(EVEN, UNLOADED)
        clock = ImageClock(0.0, float(config.pad_period_s), 0.0)
        return SensorParams(1, _linkage(config), clock, 1.0, 0.0, cells, cells)
    mean, spread = CELL_OFFSET
    offsets = (mean + spread * rng.standard_normal((2, CELLS))).tolist()
    weights = cell_weights(instance.spec.patch, instance.patch_row) if instance else EVEN
    present = central_cells(config.pad_cells)
    weights = tuple([weight if cell in present else 0.0 for cell, weight in enumerate(weights)])
    left, right = (PadCells(weights, tuple(offset)) for offset in offsets)
    period = float(config.pad_period_s)
    return SensorParams(
        ideal=0,
        link=_linkage(config),
        clock=ImageClock(float(rng.random()) * period, period, float(config.pad_delay_s)),
        share=float(instance.share) if instance else 1.0,
        noise_counts=float(config.noise_counts),
        left=left,
        right=right,
    )
