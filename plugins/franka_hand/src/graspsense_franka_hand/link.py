"""The connection to a hand through pylibfranka, which runs in a process of its own."""

from __future__ import annotations

import importlib.util
import json
import os
import select
import subprocess
import sys
from contextlib import suppress
from typing import Final, final

from graspsense.gripper_api import DeadManSwitch, ReadingThread, set_option
from graspsense.plugin_api import PluginUnavailable
from graspsense_franka_hand.orders import HandGone, HandState, Order

CONNECT_S: Final = 8.0
CLOSE_S: Final = 3.0


@final
class LibfrankaLink:
    """A hand at this address. Raises HandGone if it cannot be reached, PluginUnavailable without pylibfranka."""

    def __init__(self, host: str, timeout_s: float = CONNECT_S) -> None:
        if importlib.util.find_spec("pylibfranka") is None:
            raise PluginUnavailable(
                "a Franka Hand needs pylibfranka, which is not installed here\n"
                "  try: pip install pylibfranka (wheels for Linux on x86_64 with glibc 2.34, Python up to 3.12)\n"
                f"  without a hand: {set_option('gripper.host=emulated')} needs nothing"
            )
        self._host, self._ordered = host, False
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "graspsense_franka_hand.hand_process", host],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
            start_new_session=True,
        )
        self._text = b""
        self._reader = ReadingThread(self._read, name="Franka Hand")
        try:
            state = self.newest(timeout_s)
            if state is None:
                raise HandGone(f"no state came within {timeout_s:g} s")
        except BaseException:
            self.close()
            raise
        self.first = state

    def newest(self, timeout_s: float) -> HandState | None:
        """Return the newest state that was not returned yet, None if none comes in time. Raises HandGone."""
        return self._reader.newest(timeout_s)

    def send(self, order: Order) -> None:
        """Order it; what it still does is stopped first. Raises HandGone."""
        assert self._process.stdin is not None
        self._ordered = True
        try:
            os.write(self._process.stdin.fileno(), json.dumps(list(order)).encode() + b"\n")
        except OSError as error:
            raise HandGone("the process of pylibfranka has ended") from error

    def close(self) -> None:
        """Stop the fingers if the hand can be reached, and let go of it."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with suppress(OSError):
            self._process.stdin.close()
        try:
            self._process.wait(CLOSE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
        if self._process.wait() and self._ordered:
            # It was killed, or hangs, and has not stopped the fingers.
            DeadManSwitch("graspsense_franka_hand.hand_process:stop", self._host).release(stopped=False)
        self._reader.close()
        self._process.stdout.close()

    def _read(self) -> HandState | None:
        assert self._process.stdout is not None
        number = self._process.stdout.fileno()
        if not select.select([number], [], [], 0.1)[0]:
            return None
        data = os.read(number, 65536)
        if not data:
            raise HandGone("the process of pylibfranka has ended")
        *lines, self._text = (self._text + data).split(b"\n")
        state = None
        for line in lines:
            message = json.loads(line)
            if "error" in message:
                raise HandGone(message["error"])
            state = HandState(**message)
        return state
