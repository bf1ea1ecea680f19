"""A Franka Hand as a sensor backend."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from contextlib import suppress
from math import inf
from types import MappingProxyType
from typing import Any, Final, final

from graspsense.gripper_api import (
    BackendWithEmulator,
    LoadTable,
    asked_force,
    calibrations_of,
    finger_target,
    stored_delivered_force,
)
from graspsense.plugin_api import (
    NO_PADS,
    POSITION,
    VELOCITY,
    Channel,
    Command,
    DeviceInfo,
    DeviceLost,
    Frame,
    NoDevice,
    Reading,
    signal_type,
)
from graspsense_franka_hand.config import FrankaConfig
from graspsense_franka_hand.emulator.lock_step import LockStepHand
from graspsense_franka_hand.link import LibfrankaLink
from graspsense_franka_hand.orders import (
    FASTEST_M_S,
    FORCES_N,
    GRASP,
    MOVE,
    RATE_HZ,
    STOP,
    WIDEST_M,
    HandGone,
    Order,
)

COMMAND_DELAY_S: Final = 0.25
"""The hand has ended the command before (0.1 s at rest), which the next state tells (0.07 s), and acts on the next."""
SLOPE_S: Final = 0.2
"""Time over which the speed is taken: states come at irregular times, and later on a busy machine."""
THERE_M: Final = 1e-3
"""A target that is nearer than this is where the fingers are."""
RESTS_M_S: Final = 2e-3
KELVIN: Final = 273.15


@final
class FrankaBackend(BackendWithEmulator[FrankaConfig]):
    """Turns commands into the few that a hand takes: grasp, move and stop. It measures no force."""

    channels = (
        Channel("gap", "m", RATE_HZ),
        Channel("velocity", "m/s", RATE_HZ),
        Channel("grasped", "1", RATE_HZ),
        Channel("temperature", "K", RATE_HZ),
    )
    accepts = ("velocity", "position", "force")
    closes_itself: Mapping[str, str] = MappingProxyType(
        {
            "velocity": "a grasp to the closed position or a move to the open one, with this speed; 0: stop",
            "position": "a grasp to a narrower target, with speed and force, or a move to a wider one",
            "force": "a grasp to the closed position, with this force",
        }
    )
    command_delay_s = COMMAND_DELAY_S
    least_force_n = FORCES_N[0]

    def __init__(self, config: FrankaConfig) -> None:
        super().__init__(config)
        self._link: LibfrankaLink | LockStepHand | None = None
        self._waiting: Order | None = None
        self._table: LoadTable | None = None
        self._frames = self._sent = 0

    def open(self, seed: int) -> DeviceInfo:
        """Connect to the hand. Raises NoDevice, PluginUnavailable without pylibfranka."""
        self.close()
        config = self.config
        stored = calibrations_of(config.calibration, config.host, {})
        delivered = stored.get("delivered-force")
        self._table = None if delivered is None else stored_delivered_force(delivered)
        try:
            self._emulated = LockStepHand(config, seed) if config.emulated else None
            link = self._emulated or LibfrankaLink(config.host)
            state = link.first
        except HandGone as error:
            raise NoDevice(
                f"no Franka Hand at {config.host}: {error}. Look at gripper.host, at the cable to the control, whether "
                "FCI is active in Desk, and whether another program has the hand"
            ) from error
        self._link, self._state = link, state
        self._began_s = self._last_s = state.host_s
        self._recent: deque[tuple[float, float]] = deque([(0.0, state.width_m)])
        self._frames = self._sent = 0
        self._velocity_m_s = 0.0
        self._asked, self._waiting = Order(STOP), None
        return self._described({} if delivered is None else {"delivered-force": delivered.sha256})

    def read(self, timeout_s: float) -> Reading | None:
        """Wait for the next state. Raises DeviceLost."""
        if self._link is None:
            raise DeviceLost("the Franka Hand is not open")
        try:
            state = self._link.newest(timeout_s)
            if state is None:
                return None
            if state.refused and state.done == self._sent:
                raise HandGone(f"it refused a command: {state.refused}. Home the hand, and look at Desk")
            self._state = state
            if self._waiting is not None and state.done == self._sent:
                self._send(self._waiting)
        except HandGone as error:
            raise DeviceLost(f"the Franka Hand at {self.config.host} was lost: {error}") from error
        t_s, dt_s, self._last_s = state.host_s - self._began_s, state.host_s - self._last_s, state.host_s
        self._recent.append((t_s, state.width_m))
        while len(self._recent) > 2 and t_s - self._recent[1][0] >= SLOPE_S * (1.0 - 1e-9):
            self._recent.popleft()
        start_s, start_m = self._recent[0]
        self._velocity_m_s = (state.width_m - start_m) / (t_s - start_s) if t_s > start_s else 0.0
        self._frames += 1
        frame = Frame(t_s, dt_s, state.width_m, self._velocity_m_s)
        made: Any = signal_type(self.channels)
        signals = made(float(state.grasped), state.temperature_c + KELVIN)
        return Reading(frame, NO_PADS, signals)

    def apply(self, command: Command) -> None:
        """Give the hand an order, if it is another one than before. Raises DeviceLost."""
        order = self._order(command)
        if order is None or order == self._asked or self._link is None:
            return
        previous, self._asked = self._asked, order
        busy = self._state.done < self._sent
        if busy and previous.kind == GRASP and order.kind == GRASP:
            # A hand that is interrupted too often no longer answers: the running grasp ends at the thing by itself.
            self._waiting = order
            return
        try:
            self._send(order)
        except HandGone as error:
            raise DeviceLost(f"the Franka Hand at {self.config.host} was lost: {error}") from error

    def close(self) -> None:
        """Stop the fingers if the hand can be reached, and close the connection."""
        link, self._link = self._link, None
        if link is not None:
            with suppress(HandGone):
                link.close()

    def report(self) -> Mapping[str, float | int | str | bool]:
        """Return the number of frames and of orders, with what the emulated body knows."""
        return {**super().report(), "frames": self._frames, "orders": self._sent}

    def emulation(self) -> Mapping[str, Any]:
        """Return the settings of a dry run, without the calibrations of the real hand."""
        return {**super().emulation(), "calibration": "none"}

    def _send(self, order: Order) -> None:
        assert self._link is not None
        self._waiting = None
        self._sent += 1
        self._link.send(order)

    def _order(self, command: Command) -> Order | None:
        """Return what a command becomes; None where the fingers are already there."""
        width_m = self._state.width_m
        goal_m, speed, force = finger_target(command, width_m, WIDEST_M)
        if goal_m not in (0.0, WIDEST_M) and abs(goal_m - width_m) < THERE_M:
            return Order(STOP) if abs(self._velocity_m_s) > RESTS_M_S else None
        speed = min(speed, FASTEST_M_S)
        if speed <= 0.0:
            return Order(STOP)
        if goal_m > width_m or goal_m == WIDEST_M:
            return Order(MOVE, min(goal_m, self._state.widest_m), speed)
        return Order(GRASP, goal_m, speed, self._force_to_ask(force))

    def _force_to_ask(self, force_n: float) -> float:
        if self._table is not None:
            force_n = asked_force(self._table, force_n)
        return min(max(force_n, FORCES_N[0]), FORCES_N[1])

    def _described(self, calibration: Mapping[str, str]) -> DeviceInfo:
        info = DeviceInfo(
            name="Franka Hand",
            serial=self.config.host,
            clock="device",
            rate_hz=RATE_HZ,
            effort_limit_n=FORCES_N[1],
            speed_limit_m_s=FASTEST_M_S,
            opening=Command(POSITION, WIDEST_M, inf, 0.05),
            relaxed=Command(VELOCITY, 0.0, inf, inf),
            calibration=calibration,
            notes=("a Franka Hand measures no force, so features that need one are missing",),
        )
        return self.marked(info)
