"""A gripper that goals move outside of a grasp: opened with the first goal, and held until it is let go."""

from __future__ import annotations

import time
from collections.abc import Mapping
from math import isfinite
from typing import Any, Final

from attrs import frozen

from graspsense.gripper_api import OPEN_SPEED_M_S, OPEN_WINDOW_S, Interrupts, Pipeline
from graspsense.plugin_api import (
    POSITION,
    REST_SPEED_M_S,
    VELOCITY,
    Command,
    ConfigError,
    DeviceInfo,
    DeviceLost,
    Frame,
    RestState,
    SensorBackend,
    at_rest,
    update_rest,
)
from graspsense_ros2.action_server import Goal

NEAR_M: Final = 0.001
"""Distance from the target at which it is reached, where the gripper has no coarser step."""
STALLED_S: Final = 0.3
"""Time without motion after which the fingers are stalled."""
BEGIN_S: Final = 0.5
"""Time in which the fingers have to begin to move."""
LONGEST_S: Final = 30.0
FEEDBACK_S: Final = 0.1
FRAME_TIMEOUT_S: Final = 0.5


@frozen
class MoveResult:
    """Where the fingers are after a goal, and how they got there."""

    frame: Frame
    stalled: bool
    reached: bool

    def values(self) -> Mapping[str, Any]:
        """Return the fields of the result and of the feedback of GripperCommand."""
        effort = self.frame.effort_n
        return {
            "position": self.frame.gap_m,
            "effort": effort if isfinite(effort) else 0.0,
            "stalled": self.stalled,
            "reached_goal": self.reached,
        }


class HeldGripper:
    """The gripper of a pipeline. Raises ConfigError for one that takes neither positions nor velocities."""

    def __init__(self, pipeline: Pipeline) -> None:
        self._pipeline = pipeline
        settings = pipeline.settings.gripper
        accepts = settings.declared.accepts
        if not {"position", "velocity"} & set(accepts):
            raise ConfigError(
                f"gripper {settings.component.name} takes {', '.join(accepts)} only: a GripperCommand needs "
                "one that takes positions or velocities. The service `grasp` works with every gripper"
            )
        self._by_position = "position" in accepts
        self._backend: SensorBackend[Any] | None = None
        self._info: DeviceInfo | None = None
        self._command = Command(VELOCITY, 0.0, 0.0, 0.0)

    @property
    def ticking(self) -> bool:
        """Whether `tick` has to be called although nothing is to move: the gripper is held, and has a clock."""
        return self._info is not None and self._info.clock == "device"

    def move(self, goal: Goal) -> MoveResult:
        """Move to a goal, whose position is the gap, until it is reached, the fingers stall, or it is stopped.

        Raises NoDevice, DeviceLost.
        """
        self._open()
        assert self._backend is not None
        assert self._info is not None
        asked, near_m = goal.asked.command, max(NEAR_M, self._backend.least_step_m)
        frame = self.tick()
        closing = asked.position < frame.gap_m
        began_s = still_s = told_s = frame.t_s
        moved, stalled, reached = False, False, abs(asked.position - frame.gap_m) <= near_m
        while not (reached or stalled or goal.stop.is_set()) and frame.t_s - began_s < LONGEST_S:
            self._command = self._towards(asked.position, asked.max_effort, closing)
            frame = self.tick()
            if abs(frame.velocity_m_s) > REST_SPEED_M_S:
                moved, still_s = True, frame.t_s
            stalled = frame.t_s - still_s > (STALLED_S if moved else BEGIN_S)
            reached = (
                frame.gap_m <= asked.position + near_m if closing else frame.gap_m >= asked.position - near_m
            )
            if frame.t_s - told_s > FEEDBACK_S:
                told_s = frame.t_s
                goal.publish(MoveResult(frame, stalled, reached).values())
        if not stalled:
            self._command = self._staying(frame.gap_m)
            frame = self.tick()
        return MoveResult(frame, stalled and not reached, reached)

    def tick(self) -> Frame:
        """Apply the command once more, and return the next frame. Raises DeviceLost; the gripper is then let go."""
        assert self._backend is not None
        try:
            self._backend.apply(self._command)
            reading = self._backend.read(FRAME_TIMEOUT_S)
            if reading is None:
                raise DeviceLost(f"no frame for {FRAME_TIMEOUT_S:g} s")
        except DeviceLost:
            self._close()
            raise
        return reading.frame

    def release(self) -> None:
        """Open the fingers if the gripper is held, and let it go; a second Ctrl-C does not interrupt this."""
        if self._backend is None or self._info is None:
            return
        with Interrupts(deferred=True):
            try:
                self._command = self._info.opening or self._info.relaxed
                frame = self.tick()
                # The rule of the end of a grasp: by the gap, since a gripper may not tell its velocity.
                still = RestState(frame.t_s + self._backend.command_delay_s + BEGIN_S, frame.gap_m)
                until = time.monotonic() + LONGEST_S
                while not at_rest(still, frame.t_s, OPEN_WINDOW_S) and time.monotonic() < until:
                    frame = self.tick()
                    still = update_rest(still, frame.t_s, frame.gap_m, OPEN_SPEED_M_S, OPEN_WINDOW_S)
            finally:
                self._close()

    def _open(self) -> None:
        if self._backend is not None:
            return
        settings = self._pipeline.settings
        backend: SensorBackend[Any] = settings.gripper.create()
        backend.expect(settings.controller.create(), settings.run)
        try:
            self._info = backend.open(settings.run.seed)
        except BaseException:
            backend.close()
            raise
        self._backend, self._command = backend, self._info.relaxed

    def _close(self) -> None:
        backend, self._backend, self._info = self._backend, None, None
        if backend is not None:
            backend.close()

    def _towards(self, gap_m: float, effort_n: float, closing: bool) -> Command:
        """Return the command for a goal; an effort of 0 is the greatest allowed one, which a real gripper limits."""
        info, run = self._info, self._pipeline.settings.run
        assert info is not None
        effort, speed = info.effort_limit_n, info.speed_limit_m_s
        if info.clock == "device":
            speed = min(speed, run.first_speed_m_s)
        effort = min(effort, effort_n or run.first_effort_n)
        if self._by_position:
            return Command(POSITION, gap_m, effort, speed)
        return Command(VELOCITY, -speed if closing else speed, effort, speed)

    def _staying(self, gap_m: float) -> Command:
        kind, _, effort, speed = self._command
        return Command(kind, gap_m if kind == POSITION else 0.0, effort, speed)
