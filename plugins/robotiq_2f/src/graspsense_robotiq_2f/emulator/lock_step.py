"""The emulated gripper in the same process: its time passes while the driver waits, and nobody waits in fact."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, final

from graspsense.gripper_api import LockStepDevice
from graspsense_robotiq_2f.config import RobotiqConfig
from graspsense_robotiq_2f.emulator.fingertips import EmulatedFingertips, emulated_boards
from graspsense_robotiq_2f.emulator.hand import Hand
from graspsense_robotiq_2f.link import NoReply
from graspsense_robotiq_2f.registers import COUNT, INPUT, OUTPUT
from graspsense_robotiq_2f.tactile import TactileData, TactileStream
from graspsense_robotiq_2f.tactile_protocol import START_SENDING

EXCHANGE_S: Final = 0.005
"""Time of a request and its reply on a line of 115200 baud."""
STEP_S: Final = 0.001


@final
class LockStepGripper(LockStepDevice[Hand]):
    """A gripper of these settings, as the link to it and as the clock. Raises ConfigError for an unfit body."""

    def __init__(self, config: RobotiqConfig, seed: int) -> None:
        self._config = config
        super().__init__(Hand(config, seed))
        count = config.tactile_ports.count("emulated")
        self._boards = emulated_boards(count, lambda: self.hand.fingers.forces_n, self.monotonic, seed)

    @property
    def stroke_m(self) -> float:
        """How wide it opens (m): not wider than its body."""
        return self.hand.fingers.stroke_m

    def exchange(self, values: Sequence[int]) -> list[int]:
        """Write the output registers and return the input registers. Raises NoReply, OSError."""
        self._check_plug()
        self.hand.write(OUTPUT, list(values), self._now_s)
        return self.status()

    def status(self) -> list[int]:
        """Return the input registers. Raises NoReply, OSError."""
        self._check_plug()
        self.sleep(EXCHANGE_S)
        faults = self._config.faults
        mood = faults.mood_at(self._now_s - self.hand.active_since_s)
        if mood == "late":
            self.sleep(min(faults.late_s, self._config.reply_timeout_s))
        if mood in ("silent", "damaged") or (mood == "late" and faults.late_s > self._config.reply_timeout_s):
            self.sleep(self._config.reply_timeout_s)
            raise NoReply("no reply, or a damaged one")
        return self.hand.read(INPUT, COUNT, self._now_s)

    def boards(self) -> list[LockStepBoard]:
        """Return the boards of its fingertips, which begin to send."""
        for board in self._boards:
            board.heard(START_SENDING)
        return [LockStepBoard(self, board) for board in self._boards]

    def _check_plug(self) -> None:
        if self._now_s - self.hand.active_since_s >= self._config.faults.unplug_at_s:
            raise OSError("the connection was lost")

    def feel(self) -> None:
        """Move the fingers on, so that the fingertips feel the present time."""
        self._check_plug()
        self.hand.look(self._now_s)


@final
class LockStepBoard:
    """A board of this gripper, as the driver reads those at a port."""

    def __init__(self, gripper: LockStepGripper, board: EmulatedFingertips) -> None:
        self._gripper, self._board = gripper, board
        self.stream = TactileStream(len(board.fingers))

    def newest(self, timeout_s: float) -> TactileData | None:
        """Return what came since the last call, after a wait of up to this time. Raises OSError."""
        until_s = self._gripper.monotonic() + timeout_s
        while True:
            self._gripper.feel()
            data = self.stream.fed(self._board.unasked(), self._gripper.monotonic())
            if data is not None or self._gripper.monotonic() >= until_s:
                return data
            self._gripper.sleep(STEP_S)

    def age_s(self) -> float:
        """Return the time (s) since something came: 0, since it never fails alone."""
        return 0.0

    def close(self) -> None:
        """Do nothing: it ends with the gripper."""
