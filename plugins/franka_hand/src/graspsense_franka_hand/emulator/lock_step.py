"""The emulated hand in the same process: each state is one period later, and nobody waits."""

from __future__ import annotations

from collections import deque
from typing import final

from graspsense.gripper_api import LockStepDevice
from graspsense_franka_hand import orders, protocol
from graspsense_franka_hand.config import FrankaConfig
from graspsense_franka_hand.emulator.hand import TEMPERATURE_C, FrankaHand
from graspsense_franka_hand.orders import ANY_WIDTH_M, RATE_HZ, HandGone, HandState, Order

_COMMANDS = {orders.GRASP: protocol.GRASP, orders.MOVE: protocol.MOVE, orders.STOP: protocol.STOP}


@final
class LockStepHand(LockStepDevice[FrankaHand]):
    """An emulated hand of these settings. Raises HandGone if it gives no state, ConfigError for its body."""

    def __init__(self, config: FrankaConfig, seed: int) -> None:
        self._faults = config.faults
        super().__init__(FrankaHand(config, seed))
        self._done = 0
        self._refused = ""
        self._coming: deque[HandState] = deque()
        """States that have been sent, each at the time of its arrival."""
        try:
            if self._faults.mood == "old":
                raise HandGone("it speaks another version of the protocol")
            state = self.newest(0.0)
            if state is None:
                raise HandGone("no state came")
        except HandGone:
            super().close()
            raise
        self.first = state

    def newest(self, timeout_s: float) -> HandState | None:
        """Return the newest state that has come within this time, at least one period. Raises HandGone."""
        until_s = self._now_s + timeout_s
        while True:
            self._now_s += 1.0 / RATE_HZ
            self._check()
            self.hand.look(self._now_s)
            mood = self._faults.mood_at(self._now_s)
            if mood == "damaged":
                raise HandGone("a state was damaged")
            self._count()
            if mood != "silent":
                self._coming.append(
                    HandState(
                        host_s=self._now_s + (self._faults.late_s if mood == "late" else 0.0),
                        width_m=self.hand.width_m,
                        widest_m=self.hand.widest_m,
                        grasped=self.hand.grasped,
                        temperature_c=float(TEMPERATURE_C),
                        done=self._done,
                        refused=self._refused,
                    )
                )
            newest = None
            while self._coming and self._coming[0].host_s <= self._now_s:
                newest = self._coming.popleft()
            if newest is not None or self._now_s >= until_s:
                return newest

    def send(self, order: Order) -> None:
        """Order it; what it still does is aborted. Raises HandGone."""
        self._check()
        values: tuple[float, ...] = ()
        if order.kind == orders.GRASP:
            values = (order.width_m, ANY_WIDTH_M, ANY_WIDTH_M, order.speed_m_s, order.force_n)
        elif order.kind == orders.MOVE:
            values = (order.width_m, order.speed_m_s)
        self.hand.ask(protocol.HandRequest(_COMMANDS[order.kind], 0, values), self._now_s)
        self._count()

    def close(self) -> None:
        """Stop the fingers, and release the body."""
        self.hand.ask(protocol.HandRequest(protocol.STOP, 0, ()), self._now_s)
        super().close()

    def _check(self) -> None:
        if self._now_s >= self._faults.unplug_at_s:
            raise HandGone("its cable was pulled")

    def _count(self) -> None:
        for _, status in self.hand.ended():
            self._done += 1
            self._refused = "Command failed!" if status == protocol.FAILED else ""
