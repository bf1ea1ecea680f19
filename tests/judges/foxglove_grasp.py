"""Sends a grasp to a viewer of Foxglove's makers, and compares what it decoded with what was sent.

python foxglove_grasp.py TICKS RATE_HZ NODE VIEWER.mjs
"""

from __future__ import annotations

import hashlib
import json
import math
import struct
import subprocess
import sys
import time

from graspsense.core.components.channels import signal_type
from graspsense.core.values.channel import Channel, FastChannel, TactileArray
from graspsense.core.values.device import DeviceInfo
from graspsense.core.values.signals import EFFORT, SQUEEZE, Command, Frame, Image, Pads, Reading, Samples
from graspsense.live.feeds import LiveFeed

COMMAND = Command(EFFORT, 5.0, 20.0, 0.1)
CHANNELS = (
    Channel("gap", "m", 1000.0),
    Channel("temperature", "K", 1000.0),
    TactileArray("skin", "counts", 100.0, rows=2, columns=3),
    FastChannel("sound", "V", 4000.0, samples=4, axes=("x", "y")),
)
CELLS = 22
Signals = signal_type(CHANNELS)


class Sent:
    """Counts the messages of a topic and digests their numbers, as the viewer does."""

    def __init__(self) -> None:
        self.count, self._digest = 0, hashlib.sha256()

    def add(self, *numbers: float) -> None:
        self.count += 1
        self._digest.update(struct.pack(f"<{len(numbers)}d", *numbers))

    def values(self) -> dict[str, object]:
        return {"count": self.count, "digest": self._digest.hexdigest()}


def reading(k: int) -> Reading:
    t_s = k / 1000
    frame = Frame(t_s, 0.001, 0.05 - k * 1e-7, -1e-4, math.sin(k), k % 7, k % 5, 0.5, 0.25, 0)
    left, right = (tuple(float(k // 10 + side + i) for i in range(CELLS)) for side in (0, 100))
    pads = Pads(k // 10 / 100, k // 10 + 1, left, right)
    skin = Image(k // 10 / 100, k // 10 + 1, tuple(float(k // 10 + i) for i in range(6)))
    sound = Samples(t_s, 4 * k + 4, 4, tuple((k + i / 4, -1.0) for i in range(4)))
    return Reading(frame, pads, Signals(300.0 + k % 11, skin, sound))


def expected(ticks: int) -> dict[str, Sent]:
    """Return what a viewer has to have decoded, from the values that were sent alone."""
    tick, pads, skin, sound, scalars = (Sent() for _ in range(5))
    for k in range(ticks):
        frame, tips, signals = reading(k)
        tick.add(*frame, SQUEEZE, *COMMAND)
        scalars.add(frame.t_s, signals.temperature)
        samples = signals.sound
        flat = [value for row in samples.values for value in row]
        sound.add(samples.t_s, samples.counter, samples.new, 2, *flat)
        if k % 10 == 0:
            pads.add(tips.t_s, tips.counter, *tips.left, *tips.right)
            skin.add(signals.skin.t_s, signals.skin.counter, *signals.skin.cells)
    topics = {"tick": tick, "pads": pads, "signals/skin": skin, "signals/sound": sound, "scalars": scalars}
    return {f"/grasp/{name}": sent for name, sent in topics.items()}


def say(text: str) -> None:
    sys.stdout.write(f"foxglove: {text}\n")


def main(ticks: int, rate_hz: float, *viewer: str) -> int:
    device = DeviceInfo(
        name="hand",
        clock="device",
        simulated=True,
        rate_hz=1000.0,
        effort_limit_n=100.0,
        speed_limit_m_s=0.1,
        opening=COMMAND,
        relaxed=COMMAND,
        channels=CHANNELS,
    )
    feed = LiveFeed("graspsense.live.foxglove_process", ["0"])
    command = [*viewer, str(feed.answer["address"])]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as watching:
        assert watching.stdout is not None
        watching.stdout.readline()  # it has subscribed
        feed.opened(device)
        began = time.perf_counter()
        for k in range(ticks):
            feed.take(reading(k), SQUEEZE, COMMAND)
            time.sleep(max(0.0, began + k / rate_hz - time.perf_counter()))
        seconds = time.perf_counter() - began
        error = feed.close()
        decoded = json.loads(watching.stdout.read().splitlines()[-1])
    wanted = {name: sent.values() for name, sent in expected(ticks).items()}
    digests = {name: {key: values[key] for key in ("count", "digest")} for name, values in decoded.items()}
    counts = {name: values["count"] for name, values in digests.items()}
    say(f"decoded {counts} in {seconds:.0f} s; not handed over: {feed.dropped}")
    if error or digests != wanted:
        sent = {name: values["count"] for name, values in wanted.items()}
        say(f"sent {sent}. {error}")
    return int(bool(error) or digests != wanted)


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), float(sys.argv[2]), *sys.argv[3:]))
