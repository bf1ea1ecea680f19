"""A grasp that is sent to what shows it live, without a gripper."""

import math

from graspsense.core.values.channel import Channel, FastChannel, TactileArray
from graspsense.core.values.device import DeviceInfo
from graspsense.core.values.signals import EFFORT, NO_PADS, SQUEEZE, Command, Frame, Image, Reading, Samples
from graspsense.plugin_api import signal_type

COMMAND = Command(EFFORT, 5.0, math.inf, math.inf)
CHANNELS = (
    Channel("gap", "m", 1000.0),
    Channel("temperature", "K", 1000.0),
    TactileArray("skin", "counts", 100.0, rows=2, columns=3),
    FastChannel("sound", "V", 4000.0, samples=4, axes=("x", "y")),
)


Signals = signal_type(CHANNELS)


def device(channels=CHANNELS):
    return DeviceInfo(
        name="hand",
        simulated=True,
        clock="device",
        rate_hz=1000.0,
        effort_limit_n=100.0,
        speed_limit_m_s=0.1,
        opening=COMMAND,
        relaxed=COMMAND,
        channels=channels,
    )


def reading(k):
    t_s, nan = k / 1000, math.nan
    frame = Frame(t_s, 0.001, 0.05 - k * 1e-5, 0.0, 1.0 + k, nan, nan, nan, nan, 0)
    skin = Image(t_s, k + 1, tuple(float(k + i) for i in range(6)))
    sound = Samples(t_s, 4 * k + 3, 3, (*((k + i / 4, -1.0) for i in range(3)), (nan, nan)))
    return Reading(frame, NO_PADS, Signals(300.0 + k, skin, sound))


def port_of(feed):
    return int(feed.answer["address"].split(":")[2].partition("/")[0])


def shown(feed, n=20):
    """Show a grasp of so many ticks that ends as steady."""
    feed.opened(device())
    for k in range(n):
        feed.take(reading(k), SQUEEZE, COMMAND)
    feed.told("outcome", {"outcome": "steady", "reason": ""})
