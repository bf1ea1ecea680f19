"""The simulated gripper as a backend: one grasp in the interpreter, many compiled."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from graspsense.plugin_api import (
    CELLS,
    EFFORT,
    NO_PADS,
    PR2_LINKAGES,
    Command,
    DeviceInfo,
    Pads,
    Reading,
    SensorBackend,
    gap_and_rate,
    revolutions_at,
    tare,
)
from graspsense_sim_gripper import kernel
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.plant import Drive, PlantParams, PlantState, Squeezed, Thing
from graspsense_sim_gripper.scene import Instance, cell_weights, find, instance_of
from graspsense_sim_gripper.sensing import (
    PAD_PERIOD_S,
    SensorParams,
    SensorState,
    felt_again,
    first_sensed,
    sense,
)
from graspsense_sim_gripper.terms import TERMS

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


class SimBackend(SensorBackend[SimConfig]):
    """A PR2 gripper, its fingertips and an object, as a model. Everything it says is simulated."""

    def open(self, seed: int) -> DeviceInfo:
        """Set the scene that the config and the seed describe. Raises UnknownName for an unknown object."""
        config = self.config
        self._rng = np.random.default_rng(seed)
        self._instance = instance_for(config, self._rng)
        self._plant, self._body = first_plant(config, self._instance, self._rng)
        self._sensor_params = sensor_of(config, self._instance, self._rng)
        self._sensor = first_sensed(self._sensor_params, self._body)
        self._move = kernel.plant_of(laws_of(self._instance))
        self._dt_s = 1.0 / config.rate_hz
        self._ticks = 0
        zero = (CELL_OFFSET[0],) * CELLS
        self._zero: tuple[Sequence[float], Sequence[float]] = (zero, zero)
        self._noise: list[list[float]] = []
        self._images: list[tuple[list[float], list[float]]] = []
        self._pads = NO_PADS
        self._effort_n: float | None = None
        return device_info(config)

    def read(self, timeout_s: float) -> Reading:
        """Return the next tick; it is always there."""
        del timeout_s
        effort, dt = self._effort_n, self._dt_s
        if effort is None:
            effort = 0.0
        else:
            self._body = self._move(self._plant, self._body, effort, dt)
            self._ticks += 1
        images = self._images
        if self._sensor.images >= len(images):
            self._draw()
        left, right = self._zero
        frame, self._sensor = sense(
            self._sensor_params,
            self._sensor,
            self._body,
            self._ticks * dt,
            dt,
            effort,
            left,
            right,
            self._noise,
            images,
        )
        count = self._sensor.images
        if count != self._pads.counter:
            image = images[count - 1]
            self._pads = Pads(self._sensor.image_t_s, count, tuple(image[0]), tuple(image[1]))
        return Reading(frame, self._pads)

    def apply(self, command: Command) -> None:
        """Take an effort for the next tick."""
        self._effort_n = command.value

    def tare(self, images: Sequence[Pads]) -> None:
        """Set the cells' zero."""
        if self.config.sensor == "ideal":
            return
        self._zero = tare(images)
        self._sensor = felt_again(self._sensor, self._images, *self._zero)

    def close(self) -> None:
        """Nothing to let go of."""

    def report(self) -> Mapping[str, float | int | str | bool]:
        """Return what only the model knows: the true peak force on the pads, and whether something broke."""
        return {
            "simulated": True,
            "true_peak_force_n": self._body.peak_n,
            "broken": any(getattr(state, "broken", 0) == 1 for state in self._body.squeezed.states),
        }

    def _draw(self) -> None:
        self._noise.extend(self._rng.standard_normal((IMAGES_A_BLOCK, 2 * CELLS)).tolist())
        self._images.extend(([0.0] * CELLS, [0.0] * CELLS) for _ in range(IMAGES_A_BLOCK))


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


def instance_for(config: SimConfig, rng: np.random.Generator) -> Instance | None:
    """Return the object that stands in the gripper, drawn from its spreads; None for `none`."""
    if config.object == "none":
        return None
    return instance_of(find(config.object), rng if config.spread else None)


def laws_of(instance: Instance | None) -> list[Any]:
    """Return the laws of the terms of this object, in order."""
    return [] if instance is None else [TERMS[kind][1] for kind in instance.kinds]


def first_plant(
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
    )
    thing = Thing(
        # Nothing there: thinner than the closed gap, so that no finger ever touches it.
        width_m=instance.width_m if instance else -1.0,
        table_n=instance.table_n if instance else 0.0,
        skins_n_m=0.5 * float(config.skin_n_m),
        terms=instance.terms if instance else (),
    )
    gap, rate = gap_and_rate(link, drive.open_rev)
    at_rest = Squeezed(0.0, 0.0, 0.0, tuple(TERMS[kind][2] for kind in instance.kinds) if instance else ())
    offset = instance.offset_m if instance else 0.0
    state = PlantState(drive.open_rev, 0.0, gap, rate, 0.0, 0.0, offset, 0, at_rest, 0.0)
    return PlantParams(drive, thing, _substeps(drive, thing, rate, 1.0 / config.rate_hz)), state


def sensor_of(config: SimConfig, instance: Instance | None, rng: np.random.Generator) -> SensorParams:
    """Return the sensing chain; the cells' offsets and the phase of the pads' clock are drawn here."""
    mean, spread = CELL_OFFSET
    offsets = (mean + spread * rng.standard_normal((2, CELLS))).tolist()
    weights = cell_weights(instance.spec.patch, instance.patch_row) if instance else (1.0 / 15.0,) * 15
    return SensorParams(
        ideal=1 if config.sensor == "ideal" else 0,
        link=PR2_LINKAGES[config.transmission],
        pad_phase_s=float(rng.random()) * PAD_PERIOD_S,
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
