"""The same gripper with a camera in its left fingertip."""

import numpy as np
from tcp_hand import RATE_HZ, TcpHand

from graspsense.gripper_api import no_signals
from graspsense.plugin_api import Image, TactileArray, signal_type

EYE = TactileArray(
    "eye", "counts", RATE_HZ / 2, finger="left", rows=240, columns=320, components=3, dtype="uint8"
)


class FakeCamera:
    """Sees a dent that gets brighter with the force, and fills the same array for each image."""

    def __init__(self):
        self._pixels = np.full(EYE.shape, 40, EYE.dtype)

    def image(self, force_n):
        """Return the image under this force (N), always the same array."""
        self._pixels[80:160, 110:210] = 40 + min(round(10.0 * force_n), 200)
        return self._pixels


class TcpHandWithCamera(TcpHand):
    """The gripper with an image in each second tick."""

    channels = (*TcpHand.channels, EYE)

    def open(self, seed):
        """Connect, and begin without an image."""
        info = super().open(seed)
        self._camera, self._signals, self._ticks = FakeCamera(), no_signals(self.channels), 0
        return info

    def read(self, timeout_s):
        """Return the next frame, with the newest image."""
        reading = super().read(timeout_s)
        if reading is None:
            return None
        self._ticks += 1
        if self._ticks % 2:
            pixels = self._camera.image(reading.frame.force_left_n).copy()
            pixels.setflags(write=False)
            image = Image(reading.frame.t_s, self._signals.eye.counter + 1, pixels)
            self._signals = signal_type(self.channels)(eye=image)
        return reading._replace(signals=self._signals)
