"""A process that stops a gripper whose program was killed, since a killed program cannot.

python -m graspsense.core.drivers.dead_man_switch MODULE:FUNCTION ARGUMENTS
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from contextlib import suppress
from importlib import import_module
from threading import Thread
from typing import Final, final

from graspsense.core.grasp.interrupts import ENDING
from graspsense.core.values.errors import FAILURES

TRIES_S: Final = 10.0
"""Time for which it is tried: a cable that was pulled may be plugged in again."""
PAUSE_S: Final = 0.2
"""Time between attempts: the system may need a moment to give the port of a killed program free."""


@final
class DeadManSwitch:
    """Has `target(*arguments)` called in a process of its own if this program ends without `release`.

    `target` is the text `module:function` of a function that tells the gripper to stop, within a bounded time. It is
    imported when the program has ended, and called again if it raises. A gripper with a watchdog of its own needs none.
    """

    def __init__(self, target: str, *arguments: str | float) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", __name__, target, json.dumps(arguments)],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )

    def release(self, *, stopped: bool = True) -> None:
        """End the process, which calls nothing; can be called twice.

        With `stopped` False, the gripper could not be told to stop: the target is called, also after this program.
        """
        if stopped:
            self._process.kill()
            self._process.wait()
        else:
            Thread(target=self._process.wait, daemon=True).start()
        assert self._process.stdin is not None
        self._process.stdin.close()


def main(target: str, arguments: str) -> None:
    """Wait until the program that wrote to the standard input has ended, then stop its gripper."""
    for number in ENDING:
        signal.signal(number, signal.SIG_IGN)
    sys.stdin.buffer.read()
    module, _, name = target.partition(":")
    until_s = time.monotonic() + TRIES_S
    while time.monotonic() < until_s:
        with suppress(*FAILURES):
            getattr(import_module(module), name)(*json.loads(arguments))
            return
        time.sleep(PAUSE_S)


if __name__ == "__main__":
    main(*sys.argv[1:])
