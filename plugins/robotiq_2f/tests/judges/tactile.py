"""The package pyrobotiqtactile decodes the emulated TSF-85 fingertips at this port, without a lost frame.

python tactile.py PORT SECONDS
"""

from __future__ import annotations

import sys
import time
from itertools import pairwise

import serial
from pyrobotiqtactile import RobotiqTactileSensor
from pyrobotiqtactile.protocol import PacketParser

PERIOD_US = 1000


def frames(port: serial.Serial, seconds: float) -> tuple[list[int], int]:
    """Return the time stamps of the first finger, and the number of images that changed."""
    parser = PacketParser()
    stamps, images, last = [], 0, None
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        for packet in parser.feed(port.read(port.in_waiting or 1)):
            # Each packet anew, so that what it does not bring is known.
            parser.fingers[0].static_tactile = last = []
            assert parser.parse_sensor_packet(packet) == [True, True]
            images += parser.fingers[0].static_tactile != last
            stamps.append(parser.fingers[0].timestamp)
            assert parser.fingers[0].timestamp == parser.fingers[1].timestamp
            assert parser.fingers[1].accelerometer == [0, 0, 16384]
    return stamps, images


where, seconds = sys.argv[1], float(sys.argv[2])
with serial.Serial(where, 115200, timeout=1.0) as port:
    sensor = RobotiqTactileSensor(serial_port=port)
    sensor.connect()
    # It returns what has come so far.
    assert sensor.get_version()[:1] == b"\x9a"
    time.sleep(0.2)
    port.reset_input_buffer()
    sensor.configure(update_period_ms=1)
    stamps, images = frames(port, seconds)
    sensor.configure(update_period_ms=0)
lost = sum(abs(later - earlier - PERIOD_US) > 1 for earlier, later in pairwise(stamps))
assert lost == 0, f"{lost} of {len(stamps)} frames were lost"
assert len(stamps) > 0.9 * seconds * 1000, f"{len(stamps)} frames in {seconds} s"
assert 50 * seconds < images < 65 * seconds, f"{images} images in {seconds} s"
print(f"judges: pyrobotiqtactile decodes {len(stamps)} frames and {images} images, none lost")  # noqa: T201
