"""From a config, an object's name and a seed to the numbers of one grasp."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, Final

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.plugin_api import (
    CELLS,
    EFFORT,
    PR2_LINKAGES,
    Command,
    ConfigError,
    DeviceInfo,
    gap_and_rate,
    revolutions_at,
)
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.plant import Drive, PlantParams, PlantState, Skin, Squeezed, Thing
from graspsense_sim_gripper.scene import Instance, cell_weights, find, instance_of, numbered
from graspsense_sim_gripper.sensing import PAD_PERIOD_S, SensorParams, SensorState, first_sensed
from graspsense_sim_gripper.terms.registry import find_term

EFFORT_LIMIT_N: Final = 100.0
SPEED_LIMIT_M_S: Final = 0.2
"""Software limits of the PR2 gripper at the time of the paper."""
OPENING_N: Final = -20.0
"""The authors' recordings show +17 and +20 N (opening) between squeezes."""
TARE_IMAGES: Final = 6
CELL_OFFSET: Final = (3300.0, 250.0)
"""Mean and spread of an unloaded cell's counts: 2900 to 3800 are reported."""
IMAGES_A_BLOCK: Final = 64
RESOLVED: Final = 0.05
"""Natural frequency times step stays below this: peaks are then good to better than 1 %."""
STIFFEST_N_M: Final = 1e9


def device_info(config: SimConfig) -> DeviceInfo:
    """Return how this gripper presents itself."""
    return DeviceInfo(
        name="simulated PR2 gripper",
        clock="virtual",
        rate_hz=config.rate_hz,
        effort_limit_n=EFFORT_LIMIT_N,
        speed_limit_m_s=SPEED_LIMIT_M_S,
        opening=Command(EFFORT, OPENING_N, math.inf, math.inf),
        relaxed=Command(EFFORT, 0.0, math.inf, math.inf),
        tare_images=0 if config.sensor == "ideal" else TARE_IMAGES,
        notes=("simulated: every figure below comes from a model",),
    )


@frozen(kw_only=True)
class Setting:
    """One grasp before it begins: the numbers of plant and sensor, their first states, what the seed still gives."""

    kinds: tuple[str, ...]
    """The object's terms."""
    plant: PlantParams
    body: PlantState
    sensor: SensorParams
    sensed: SensorState
    dt_s: float
    drawn: Mapping[str, Any]
    """State of the seed's generator after all of the above was drawn."""

    def noise(self) -> Iterator[NDArray[np.float64]]:
        """Yield blocks of rows of 44 standard normal numbers, one row an image; the same at every call."""
        rng = np.random.default_rng()
        rng.bit_generator.state = self.drawn
        while True:
            yield rng.standard_normal((IMAGES_A_BLOCK, 2 * CELLS))


def set_scene(config: SimConfig, scene: str, seed: int) -> Setting:
    """Return the grasp of this object (`none`: nothing there; `*.toml`: a scene file) with this seed.

    Raises UnknownName, and ConfigError for a file that describes nothing which fits between the fingers.
    """
    rng = np.random.default_rng(seed)
    instance = None
    if scene != "none":
        name, number = numbered(scene)
        instance = instance_of(find(name), rng if config.spread else None, number)
        _check_fit(config, instance)
    plant, body = _plant(config, instance, rng)
    sensor = _sensor(config, instance, rng)
    return Setting(
        kinds=instance.kinds if instance else (),
        plant=plant,
        body=body,
        sensor=sensor,
        sensed=first_sensed(sensor, body),
        dt_s=1.0 / config.rate_hz,
        drawn=rng.bit_generator.state,
    )


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
    config: SimConfig, instance: Instance | None, rng: np.random.Generator
) -> tuple[PlantParams, PlantState]:
    """Return the plant's numbers and its state before the grasp: open, at rest, nothing touched.

    Friction varies between trials, so it is drawn here.
    """
    link = PR2_LINKAGES[config.transmission]
    friction_n = float(config.coulomb_n)
    if config.spread:
        friction_n = max(friction_n + config.coulomb_spread_n * float(rng.standard_normal()), 0.0)
    drive = Drive(
        link=link,
        inertia=4.0 * math.pi * math.pi * config.rotor_kg_m2,
        coulomb_n=friction_n,
        breakaway_n=max(float(config.breakaway_n), friction_n),
        stribeck_m_s=float(config.stribeck_m_s),
        load_share=float(config.load_share),
        damping_n_s_m=float(config.damping_n_s_m),
        closed_rev=revolutions_at(link, 0.0),
        open_rev=revolutions_at(link, config.open_gap_m),
        lag_s=float(config.drive_lag_s),
    )
    thing = Thing(
        # Nothing there: thinner than the closed gap, so that no finger ever touches it.
        width_m=instance.width_m if instance else -1.0,
        table_n=instance.table_n if instance else 0.0,
        skins_n_m=0.5 * float(config.skin_n_m),
        terms=instance.terms if instance else (),
        skin=Skin(
            damping_n_s_m=0.5 * float(config.skin_damping_n_s_m),
            arm_n_m=0.5 * float(config.skin_creep_n_m),
            tau_s=float(config.skin_creep_s),
        ),
        held=1 if instance and instance.spec.held else 0,
    )
    gap, rate = gap_and_rate(link, drive.open_rev)
    kinds = instance.kinds if instance else ()
    at_rest = Squeezed(0.0, 0.0, 0.0, tuple(find_term(kind)[1].at_rest for kind in kinds), 0.0, 0.0)
    offset = instance.offset_m if instance else 0.0
    state = PlantState(drive.open_rev, 0.0, gap, rate, 0.0, 0.0, offset, 0, at_rest, 0.0, 0.0, at_rest)
    return PlantParams(drive, thing, _substeps(drive, thing, rate, 1.0 / config.rate_hz)), state


def _sensor(config: SimConfig, instance: Instance | None, rng: np.random.Generator) -> SensorParams:
    """Return the sensing chain; the cells' offsets and the phase of the pads' clock are drawn here."""
    mean, spread = CELL_OFFSET
    offsets = (mean + spread * rng.standard_normal((2, CELLS))).tolist()
    weights = cell_weights(instance.spec.patch, instance.patch_row) if instance else (1.0 / 15.0,) * 15
    return SensorParams(
        ideal=1 if config.sensor == "ideal" else 0,
        link=PR2_LINKAGES[config.transmission],
        pad_phase_s=float(rng.random()) * PAD_PERIOD_S,
        pad_delay_s=float(config.pad_delay_s),
        share=float(instance.share) if instance else 1.0,
        noise_counts=float(config.noise_counts),
        left_weights=weights,
        right_weights=weights,
        left_offset=tuple(offsets[0]),
        right_offset=tuple(offsets[1]),
    )


def _substeps(drive: Drive, thing: Thing, rate_m_rev: float, dt: float) -> int:
    """Return into how many steps a tick is cut near the object, from the stiffest it can feel."""
    stiffest = min(thing.skins_n_m, STIFFEST_N_M)
    mass = drive.inertia / (rate_m_rev * rate_m_rev)
    return max(1, math.ceil(math.sqrt(stiffest / mass) * dt / RESOLVED))
