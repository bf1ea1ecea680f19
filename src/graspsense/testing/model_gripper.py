"""A model gripper, a mass with friction and a spring between the fingers, for checks of controllers."""

from __future__ import annotations

from math import inf, nan
from typing import Any, Final

import numpy as np

from graspsense.core.components.channels import cells_of, declared_shape, fingertips, further, no_signals
from graspsense.core.components.roles import Controller, SensorBackend
from graspsense.core.components.run_config import RunConfig
from graspsense.core.grasp.runner import Grasp, run_uninterrupted
from graspsense.core.values.channel import Channel, FastChannel, TactileArray
from graspsense.core.values.device import DeviceInfo
from graspsense.core.values.signals import (
    CHANNEL_OF_FIELD,
    EFFORT,
    FORCE,
    POSITION,
    VELOCITY,
    Command,
    Frame,
    Image,
    Pads,
    Reading,
    Samples,
    no_pads,
)

DT_S: Final = 1e-3
OPEN_M: Final = 0.08
MASS_KG: Final = 80.0
FRICTION_N: Final = 7.0
DAMPING_N_S_M: Final = 50.0
EFFORT_LIMIT_N: Final = 100.0
SPEED_LIMIT_M_S: Final = 0.2
FOLLOWING_S: Final = 0.005
TICKS_OF_AN_IMAGE: Final = 41
CELLS: Final = 22
FIRST_PAD_CELL: Final = 7
"""Cells of a fingertip of the bench, where the channels do not say how many, and the first on the gripping face."""


class ModelGripper(SensorBackend[None]):
    """A gripper with a stroke of 80 mm, at 1 kHz, that accepts every kind of command; channels not given are NaN.

    Between its fingers is an object of width `width_m` (0: nothing) and stiffness `stiffness_n_m`.
    """

    first_t_s = 0.0
    """The time (s) of its first tick."""
    dt_s = DT_S
    """The time (s) from a tick to the next."""

    def __init__(self, channels: frozenset[str | Channel], width_m: float, stiffness_n_m: float) -> None:
        super().__init__(None)
        declared = [channel for channel in channels if isinstance(channel, Channel)]
        names = {channel.name if isinstance(channel, Channel) else channel for channel in channels}
        self._absent = [field for field, name in CHANNEL_OF_FIELD.items() if name not in names]
        self._has_pads = "pads" in names
        pads = fingertips(declared)
        self._cells = pads.cells if pads else CELLS
        self._further = tuple(sorted(further(declared), key=lambda channel: channel.name))
        self._signals = no_signals(self._further)
        self._width_m, self._stiffness_n_m = width_m, stiffness_n_m

    def open(self, seed: int) -> DeviceInfo:
        """Begin with open fingers."""
        del seed
        self._gap, self._speed, self._effort, self._ticks = OPEN_M - 0.002, 0.0, 0.0, 0
        self._pads = no_pads(self._cells)
        self._signals = no_signals(self._further)
        return DeviceInfo(
            name="model_gripper",
            clock="virtual",
            simulated=True,
            rate_hz=1.0 / self.dt_s,
            effort_limit_n=EFFORT_LIMIT_N,
            speed_limit_m_s=SPEED_LIMIT_M_S,
            opening=Command(VELOCITY, 0.05, inf, inf),
            relaxed=Command(EFFORT, 0.0, inf, inf),
        )

    def read(self, timeout_s: float) -> Reading:
        """Return the next tick."""
        del timeout_s
        force = self._force()
        frame = Frame(
            t_s=self.first_t_s + self._ticks * self.dt_s,
            dt_s=self.dt_s,
            gap_m=self._gap,
            velocity_m_s=self._speed,
            effort_n=self._effort,
            force_left_n=force,
            force_right_n=force,
            edge_left_n=0.0,
            edge_right_n=0.0,
            status=0,
        )
        if self._has_pads and self._ticks % TICKS_OF_AN_IMAGE == 0:
            cells = (3000.0 + 100.0 * force,) * self._cells
            self._pads = Pads(frame.t_s, 1 + self._ticks // TICKS_OF_AN_IMAGE, cells, cells)
        if self._further:
            values = (self._value(channel, frame, force) for channel in self._further)
            self._signals = type(self._signals)(*values)
        self._ticks += 1
        absent: dict[str, Any] = dict.fromkeys(self._absent, nan)
        return Reading(frame._replace(**absent), self._pads, self._signals)

    def _value(self, channel: Channel, frame: Frame, force: float) -> Any:
        """Return what a further channel measures in this tick: the force on a pad, on every cell and axis."""
        last = getattr(self._signals, channel.name)
        if isinstance(channel, TactileArray):
            if self._ticks % TICKS_OF_AN_IMAGE:
                return last
            return Image(frame.t_s, last.counter + 1, cells_of(channel, np.full(channel.numbers, force)))
        if isinstance(channel, FastChannel):
            rows, axes = declared_shape(channel)
            return Samples(frame.t_s, last.counter + rows, rows, ((force,) * axes,) * rows)
        return force

    def apply(self, command: Command) -> None:
        """Move by one tick under this command."""
        kind, value, effort_limit, speed_limit = command
        force = self._force()
        most = min(effort_limit, EFFORT_LIMIT_N)
        top = min(speed_limit, SPEED_LIMIT_M_S)
        if kind == EFFORT:
            self._effort = min(max(value, -most), most)
            push = force - self._effort - DAMPING_N_S_M * self._speed
            moved = self._speed + push * self.dt_s / MASS_KG
            slowed = FRICTION_N * self.dt_s / MASS_KG
            self._speed = 0.0 if abs(moved) <= slowed else moved - slowed * (1.0 if moved > 0.0 else -1.0)
        else:
            if kind == VELOCITY:
                wanted = value
            elif kind == POSITION:
                wanted = (value - self._gap) / 0.02
            else:
                assert kind == FORCE, f"{kind} is not a kind of command"
                wanted = (force - value) / 2000.0
            self._speed += (min(max(wanted, -top), top) - self._speed) * self.dt_s / FOLLOWING_S
            self._effort = force
            if force >= most and self._speed < 0.0:
                self._speed = 0.0
        self._gap += self._speed * self.dt_s
        if not 0.0 < self._gap < OPEN_M:
            self._gap, self._speed = min(max(self._gap, 0.0), OPEN_M), 0.0

    def close(self) -> None:
        """Do nothing."""

    def _force(self) -> float:
        return self._stiffness_n_m * max(self._width_m - self._gap, 0.0)


def model_gripper(channels: Any, object_name: str = "a soft object") -> ModelGripper:
    """Return a model gripper with these channels and one of `OBJECTS` as the object, to drive a controller with.

    A channel is a name in `signals.CHANNELS`, or a `Channel`. A further channel measures the force on a pad.

    >>> sorted(OBJECTS)
    ['a hard object', 'a soft object', 'nothing']
    """
    return ModelGripper(frozenset(channels), *OBJECTS[object_name])


def drive(controller: Controller[Any], gripper: SensorBackend[Any]) -> Grasp:
    """Return a whole grasp of this gripper under this controller, by the runner: its outcome and its trace.

    >>> from graspsense.plugin_api import create
    >>> channels = ("gap", "velocity", "effort", "force_left", "force_right")
    >>> drive(create("controller", "hybrid"), model_gripper(channels, "a soft object")).outcome.words
    'steady'
    """
    return run_uninterrupted(gripper, controller, RunConfig())


OBJECTS: Final = {
    "a soft object": (0.05, 1500.0),
    "a hard object": (0.05, 40000.0),
    "nothing": (0.0, 0.0),
}
