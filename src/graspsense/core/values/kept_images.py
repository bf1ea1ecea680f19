"""The images of a running grasp that are numpy arrays: in a temporary file, so that they do not fill the memory."""

from __future__ import annotations

import mmap
import os
import tempfile
import weakref
from typing import Any

import numpy as np
from numpy.typing import NDArray

from graspsense.core.values.signals import Image


class KeptImages:
    """The images of one channel, all of the type and the shape of `example`, in the order of their counters.

    The file has no name, and is gone with the last array that shows it. Images for which the disk has no room are kept
    in memory.
    """

    def __init__(self, example: NDArray[Any]) -> None:
        self._dtype, self._shape, self._bytes = example.dtype, example.shape, example.nbytes
        self._fd = -1
        self._written = 0
        self._beside: list[NDArray[Any]] = []
        self._last = Image(0.0, 0, self)

    def add(self, image: Image) -> Image:
        """Keep an image if its counter is new. Return it with this object in place of its cells."""
        if image.counter != self._last.counter:
            # After the first image without room, the others stay beside the file: it has them in order.
            if self._beside or not self._write(image.cells):
                self._beside.append(np.array(image.cells))
            self._last = Image(image.t_s, image.counter, self)
        return self._last

    def first_images(self, number: int) -> NDArray[Any]:
        """Return the cells of the first images, shape (number, ...), read-only. The file is not read as a whole."""
        written = min(number, self._written)
        cells = np.empty((0, *self._shape), self._dtype)
        if written:
            shown = mmap.mmap(self._fd, written * self._bytes, access=mmap.ACCESS_READ)
            cells = np.frombuffer(shown, self._dtype).reshape(written, *self._shape)
        if number > written:
            cells = np.concatenate([cells, np.stack(self._beside[: number - written])])
        cells.setflags(write=False)
        return cells

    def _write(self, cells: NDArray[Any]) -> bool:
        """Write the cells behind those before them. Return whether there was room."""
        try:
            if self._fd < 0:
                self._fd, path = tempfile.mkstemp(prefix="graspsense-images-")
                weakref.finalize(self, os.close, self._fd)
                os.unlink(path)
            data, offset = cells.data.cast("B"), self._written * self._bytes
            while data:
                done = os.pwrite(self._fd, data, offset)
                data, offset = data[done:], offset + done
        except OSError:
            return False
        self._written += 1
        return True
