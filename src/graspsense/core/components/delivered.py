"""Whether readings are what a gripper declares: numbers, and images and samples of the declared shapes."""

from __future__ import annotations

import struct
from array import array
from collections.abc import Iterable
from itertools import chain
from typing import Any, Final

from graspsense.core.components.channels import (
    can_change,
    declared_dtype,
    declared_shape,
    dtype_of,
    fingertips,
    further,
    shape_of,
)
from graspsense.core.values.channel import FLOATS, Channel
from graspsense.core.values.signals import Frame, Image, Pads, Reading, Samples

_FRAME: Final = struct.Struct(f"<{len(Frame._fields) - 1}dq")


class Delivered:
    """Checks the readings of one grasp, in order. What the channels do not say, the first reading does."""

    def __init__(self, channels: Iterable[Channel]) -> None:
        channels = tuple(channels)
        self._forms = {
            channel.name: (declared_shape(channel), declared_dtype(channel)) for channel in further(channels)
        }
        self._declared = tuple(self._forms)
        self._names: tuple[str, ...] | None = None
        pads = fingertips(channels)
        self._cells = pads.cells if pads else None
        self._pads: Pads | None = None
        self._counter = 0
        self._signals: Any = ()
        self._cells_of: dict[str, tuple[Any, ...]] = {}

    def problem(self, reading: Reading) -> str:
        """Return what is wrong with this reading, in words; an empty text if nothing is."""
        if not isinstance(reading, Reading):
            return f"read returned {type(reading).__name__}: return graspsense.plugin_api.Reading"
        frame, pads, signals = reading
        try:
            _FRAME.pack(*frame)
        except (struct.error, TypeError, OverflowError) as error:
            return f"its frame is not one of a gripper: {error}"
        problem = ""
        if pads is not self._pads:
            self._pads = pads
            problem = self._of_pads(pads)
        if signals is not self._signals or self._names is None:
            self._signals = signals
            problem = problem or self._of_signals(signals)
        return problem

    def _of_pads(self, pads: Pads) -> str:
        if self._cells is None and pads.counter:
            self._cells = len(pads.left)
        for side in (pads.left, pads.right):
            if self._cells is not None and len(side) != self._cells and (pads.counter or side):
                return f"an image of a fingertip has {len(side)} cells instead of {self._cells}"
        if pads.counter != self._counter:
            self._counter = pads.counter
            if not (_are_numbers(pads.left) and _are_numbers(pads.right)):
                return "an image of a fingertip has a cell that is not a number"
        return ""

    def _of_signals(self, signals: Any) -> str:
        names = getattr(signals, "_fields", ())
        if self._names is None:
            missing = [name for name in self._declared if name not in names]
            if missing:
                return f"the declared channel {missing[0]!r} is not delivered"
            self._names = names
        if names != self._names:
            return f"its further channels are {', '.join(names) or 'none'}, and were {', '.join(self._names)}"
        for name, value in zip(names, signals, strict=True):
            cells = value.cells if isinstance(value, Image) else None
            # An image is in each reading until the next one comes; a tuple does not change meanwhile.
            if cells is not None and cells is self._cells_of.get(name):
                continue
            if name not in self._forms:
                self._forms[name] = (shape_of(value), dtype_of(value))
            shape, dtype = self._forms[name]
            problem = _problem(value, shape, dtype)
            if problem:
                return f"the channel {name!r} {problem}"
            if isinstance(cells, tuple):
                self._cells_of[name] = cells
        return ""


def _problem(value: Any, shape: tuple[int, ...], dtype: str) -> str:
    """Return what is wrong with the value of a channel that has this shape, and numbers of this type."""
    if dtype_of(value) != dtype:
        return f"has cells of type {dtype_of(value)} instead of {dtype}: convert them, or declare their dtype"
    if shape_of(value) != shape:
        given, wanted = (_sized(size, image=isinstance(value, Image)) for size in (shape_of(value), shape))
        return f"has {given} instead of {wanted}"
    if isinstance(value, Image) and dtype != FLOATS:
        return _array_problem(value.cells)
    if isinstance(value, Samples) and (
        any(len(row) != shape[1] for row in value.values) or not 0 <= value.new <= shape[0]
    ):
        return f"does not have {_sized(shape)} in each tick"
    return "" if _are_numbers(numbers_of(value)) else "has a value that is not a number"


def numbers_of(value: Any) -> Iterable[Any]:
    """Return the numbers of a value of `Reading.signals`, which is no numpy array."""
    if isinstance(value, Samples):
        return chain.from_iterable(value.values)
    if isinstance(value, Image):
        return chain.from_iterable(value.cells) if len(shape_of(value)) > 1 else value.cells
    return (value,)


def _array_problem(cells: Any) -> str:
    """Return what is wrong with a numpy array that has the declared shape and type."""
    if not cells.flags.c_contiguous:
        return "is an array that is not contiguous: deliver numpy.ascontiguousarray(array)"
    if can_change(cells):
        return (
            "is an array that can still be changed: deliver a copy of it that is read-only (array = array.copy(); "
            "array.setflags(write=False))"
        )
    return ""


def _sized(shape: tuple[int, ...], *, image: bool = False) -> str:
    if len(shape) < 2:
        return f"{shape[0]} cells" if shape else "one number"
    return f"the shape {' x '.join(map(str, shape))}" if image else f"{shape[0]} samples of {shape[1]} axes"


def _are_numbers(values: Iterable[Any]) -> bool:
    try:
        array("d", values)
    except TypeError:
        return False
    return True
