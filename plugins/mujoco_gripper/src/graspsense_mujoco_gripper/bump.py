"""A ball that bumps into a finger or the thing from the side, across the closing direction."""

from __future__ import annotations

from math import inf, pi
from typing import Final, Literal

import mujoco
import numpy as np
from attrs import field, frozen
from attrs.validators import gt, lt
from numpy.typing import NDArray

from graspsense.plugin_api import ConfigError

Floats = NDArray[np.float64]
BALL: Final = "bump"
"""The name of the body of the ball."""
EDGE_BIT: Final = 16
"""Of `conaffinity`: an edge of a finger, which the ball touches and things do not."""
RADIUS_M: Final = 0.01
START_M: Final = 0.06
"""How far the ball begins from the middle of what it bumps into: further than half of a thing that fits."""
AWAY_M: Final = 1.0
DAMPING: Final = 0.1
ABOVE_ZERO: Final = (gt(0.0), lt(inf))


@frozen(kw_only=True)
class Bump:
    """A bump: into what, when (s since both fingers touched), how heavy and fast the ball is, how long it touches.

    The finger is the left one, and is hit where its edge sensor is.
    """

    target: Literal["finger", "thing"] = field(default="finger", alias="at")
    t_s: float
    mass_kg: float = field(default=0.1, validator=ABOVE_ZERO)
    speed_m_s: float = field(default=0.2, validator=ABOVE_ZERO)
    touch_s: float = field(default=0.05, validator=ABOVE_ZERO)

    def __attrs_post_init__(self) -> None:
        if self.speed_m_s * self.touch_s / pi > RADIUS_M:
            raise ValueError(
                f"touch_s is so long that the ball would pass through: at {self.speed_m_s:g} m/s give at most "
                f"{pi * RADIUS_M / self.speed_m_s:.2g} s"
            )


def add_ball(spec: mujoco.MjSpec, bump: Bump, place: Floats, axis: Floats) -> None:
    """Add the ball, far away beside this place."""
    side = np.cross([0.0, 0.0, 1.0], axis)
    ball = spec.worldbody.add_body(name=BALL, pos=place + AWAY_M * side, gravcomp=1.0)
    ball.add_freejoint()
    ball.add_geom(
        name=BALL,
        size=[RADIUS_M, 0.0, 0.0],
        mass=bump.mass_kg,
        contype=1 | EDGE_BIT,
        conaffinity=1,
        priority=2,
        # Half a period of a damped oscillation takes as long as the bump.
        solref=[bump.touch_s / (pi * DAMPING), DAMPING],
        solimp=[0.95, 0.95, 0.001, 0.5, 2.0],
    )


class Bumper:
    """Throws the ball once, when it is time. Raises ConfigError for a finger without an edge sensor."""

    def __init__(self, model: mujoco.MjModel, bump: Bump, edge: str, thing: int) -> None:
        self._bump, self._thrown, self._thing, self._site = bump, False, thing, -1
        if bump.target == "finger":
            if not edge:
                raise ConfigError(
                    "bump: the left finger has no edge sensor (edge in the gripper file) to bump into"
                )
            self._site = int(model.sensor_objid[model.sensor(edge).id])
        joint = int(model.body_jntadr[model.body(BALL).id])
        self._place, self._speed = int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])

    def set(self, data: mujoco.MjData, since_s: float) -> None:
        """Throw the ball if it is time; `since_s` is the time since both fingers touched."""
        if self._thrown or since_s < self._bump.t_s:
            return
        self._thrown = True
        target = data.xipos[self._thing] if self._site < 0 else data.site_xpos[self._site]
        away = data.qpos[self._place : self._place + 3] - target
        away[2] = 0.0
        away /= np.linalg.norm(away)
        data.qpos[self._place : self._place + 3] = target + START_M * away
        data.qvel[self._speed : self._speed + 3] = -self._bump.speed_m_s * away
