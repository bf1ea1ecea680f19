"""Settings of a gripper that a MuJoCo model describes."""

from __future__ import annotations

from typing import Literal

from attrs import frozen

from graspsense.plugin_api import NAMES_INPUT, setting


@frozen(kw_only=True, cache_hash=True)
class MujocoConfig:
    """The keys of [gripper]."""

    file: str = setting(
        default="",
        meaning="The gripper file (TOML), which names the MuJoCo model, its actuators and its sensors. "
        "parallel (or empty) and soft_pads come with graspsense-mujoco-gripper.",
    )
    object: str = setting(
        default="block",
        effect=NAMES_INPUT,
        meaning="A thing of the catalogue (block, egg, can, ...), none, the path of an MJCF file (.xml) with one, or "
        "a scene file (.toml).",
    )
    scene: str = setting(
        default="",
        effect=NAMES_INPUT,
        meaning="What happens to the thing: tugged, filled, placed, shaken, or a scene file (.toml), with `object` in "
        "the place of its thing. Empty: what `object` says.",
    )
    rate_hz: float = setting(
        default=1000.0,
        minimum=10.0,
        maximum=10_000.0,
        unit="Hz",
        meaning="Ticks of the controller in a second.",
    )
    timestep_s: float = setting(
        default=0.0005,
        minimum=1e-5,
        maximum=0.01,
        unit="s",
        meaning="Longest step of the integrator of MuJoCo; a tick has a whole number of steps.",
    )
    integrator: Literal["model", "Euler", "implicit", "implicitfast", "RK4", "discrete"] = setting(
        default="model", meaning="The integrator of MuJoCo; model: the one that the gripper's model names."
    )
    spread: bool = setting(
        default=True,
        meaning="Whether mass, friction, stiffness, size and place of the thing vary with the seed.",
    )
    force_noise_n: float = setting(
        default=0.01,
        minimum=0.0,
        unit="N",
        meaning="Standard deviation of the noise of the force on a finger.",
    )
    gap_step_m: float = setting(
        default=1e-5, minimum=0.0, unit="m", meaning="Resolution of the measured gap; 0: exact."
    )
