"""The gripper with one of its parameters, or one of those of the objects in it, larger by a small share."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from attrs import evolve, fields

from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.scene.library import find, split_number
from graspsense_sim_gripper.scene.scaled import ScaledParameter, parameters_of

OF_THE_MODEL: Final = ("accuracy", "step_s", "rate_hz", "expected_force_n", "expected_speed_m_s")
"""Numbers among the settings that are no property of the gripper or its sensors."""


def perturbed(
    config: SimConfig, scenes: Sequence[str], share: float
) -> Mapping[str, tuple[SimConfig, ScaledParameter | None]]:
    """Return the gripper with each parameter scaled, by the name of the parameter; "" is the gripper as it is.

    Each is given by its settings, and by the parameter of its objects that is scaled, if any. A parameter that is 0,
    infinite or not used is left out. Raises UnknownName and ConfigError as `find` does.
    """
    # Steps of a fixed length depend smoothly on the parameters, so what 1 ppm moves is not due to their control.
    step_s = config.step_s or 1.0 / config.rate_hz
    steady = evolve(config, fidelity="scene", step_s=step_s, explain=False)
    names = dict.fromkeys(
        name
        for scene in dict.fromkeys(split_number(scene)[0] for scene in scenes if scene != "none")
        for name in parameters_of(find(scene))
    )
    return {
        "": (steady, None),
        **{
            f"gripper.{name}": (evolve(steady, **{name: getattr(steady, name) * (1.0 + share)}), None)
            for name in _settings(steady)
        },
        **{name: (steady, ScaledParameter(name, share)) for name in names},
    }


def _settings(config: SimConfig) -> Iterator[str]:
    unused = {"rotor_kg_m2" if config.transmission == "straight" else "moving_mass_kg"}
    if not config.spread:
        unused.add("coulomb_spread_n")
    if config.pad_creep_n_m == 0.0:
        unused.add("pad_creep_s")
    if config.sensor == "ideal":
        unused.update(("noise_counts", "pad_period_s", "pad_delay_s"))
    for field in fields(SimConfig):
        value = getattr(config, field.name)
        is_number = isinstance(value, float) and value != 0.0 and math.isfinite(value)
        if is_number and field.name not in unused.union(OF_THE_MODEL):
            yield field.name
