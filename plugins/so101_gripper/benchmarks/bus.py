"""How long a read of the gripper's motor takes with the port of feetech-servo-sdk and with that of the driver.

    python plugins/so101_gripper/benchmarks/bus.py [--short]

Both send the same packet to an emulated arm in a process of its own, and read the 31 bytes of a frame. The processor's
time is that of the reading thread. A silent motor shows what waiting costs. What came late is thrown away before each
read: without that, the port of the package returns the reply to an earlier request. docs/so101.md has the figures.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial

from graspsense_so101_gripper.bus import NoStatusPacket, ServoBus
from graspsense_so101_gripper.registers import STATE

MOTOR, SILENT = 6, 9
PAUSE_S = 0.002


def timed(read: Callable[[], object], count: int) -> tuple[float, float]:
    """Return the median duration (s) of a read, and its processor time (s)."""
    durations, used_s = [], 0.0
    for _ in range(count):
        begun, worked = time.perf_counter(), time.thread_time()
        with suppress(NoStatusPacket):
            read()
        durations.append(time.perf_counter() - begun)
        used_s += time.thread_time() - worked
        time.sleep(PAUSE_S)
    return sorted(durations)[count // 2], used_s / count


def main() -> None:
    from scservo_sdk import PacketHandler, PortHandler

    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--short", action="store_true", help="only a few reads")
    count = 5 if parser.parse_args().short else 500
    emulator = subprocess.Popen(
        [sys.executable, "-m", "graspsense", "emulate", "so101", "--json"],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    )
    try:
        assert emulator.stdout is not None
        where = json.loads(emulator.stdout.readline())["port"]
        theirs, handler = PortHandler(where), PacketHandler(0)
        theirs.openPort()

        def read(motor: int) -> None:
            theirs.ser.reset_input_buffer()
            handler.readTxRx(theirs, motor, *STATE)

        rows = [("feetech-servo-sdk", motor, timed(partial(read, motor), count)) for motor in (MOTOR, SILENT)]
        theirs.closePort()
        # As long as theirs waits.
        bus = ServoBus(where, 0.034)
        rows += [
            ("driver", motor, timed(partial(bus.read, motor, *STATE), count)) for motor in (MOTOR, SILENT)
        ]
        bus.close()
    finally:
        emulator.terminate()
        emulator.wait()
    print("| port | motor | a read (ms) | processor (ms) |\n|---|---|---|---|")
    for port, motor, (duration_s, used_s) in rows:
        print(f"| {port} | {motor} | {duration_s * 1e3:.2f} | {used_s * 1e3:.2f} |")


if __name__ == "__main__":
    main()
