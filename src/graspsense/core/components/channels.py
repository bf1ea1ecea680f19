"""The further channels of a gripper, which are not part of a frame: their values in a reading, and their record."""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Iterable, Mapping
from functools import cache, lru_cache
from math import nan
from typing import TYPE_CHECKING, Any, Final

from attrs import asdict

from graspsense.core.values.channel import FLOATS, Channel, FastChannel, TactileArray
from graspsense.core.values.fingers import FingerForce
from graspsense.core.values.signals import CHANNELS, Image, Samples

if TYPE_CHECKING:
    from numpy.typing import NDArray

KINDS: Final[Mapping[str, type[Channel]]] = {
    "scalar": Channel,
    "array": TactileArray,
    "fast": FastChannel,
    "finger": FingerForce,
}
"""The kinds of channel, as a recording names them."""


def further(channels: Iterable[Channel]) -> tuple[Channel, ...]:
    """Return the channels that are delivered in `Reading.signals`: all that are not part of a frame."""
    return tuple(channel for channel in channels if channel.name not in CHANNELS)


def fingertips(channels: Iterable[Channel]) -> TactileArray | None:
    """Return the array of the cells of both fingertips, None where the channels do not say which cells there are."""
    pads = (channel for channel in channels if channel.name == "pads")
    return next((channel for channel in pads if isinstance(channel, TactileArray)), None)


def signal_type(channels: Iterable[Channel]) -> type[tuple[Any, ...]]:
    """Return the named tuple of the further ones of these channels, for `Reading.signals`.

    The same names give the same class, so that compiled code takes the values of every gripper with these channels.

    >>> from graspsense.plugin_api import Channel
    >>> signal_type((Channel("gap", "m"), Channel("motor_temperature", "K")))(300.0)
    Signals(motor_temperature=300.0)
    """
    return _named_tuple(tuple(channel.name for channel in further(channels)))


def no_signals(channels: Iterable[Channel]) -> Any:
    """Return the value of `Reading.signals` before anything was measured: NaN, counters 0, in the declared shapes.

    The cells of an array of whole numbers are 0, since these have no NaN. It is `()` where there are no further
    channels.

    >>> from graspsense.plugin_api import TactileArray
    >>> no_signals((TactileArray("palm", "counts", rows=1, columns=2),))
    Signals(palm=Image(t_s=0.0, counter=0, cells=(nan, nan)))
    """
    channels = further(channels)
    return signal_type(channels)(*map(_nothing_yet, channels)) if channels else ()


def shape_of(value: Any) -> tuple[int, ...]:
    """Return the shape of a value of `Reading.signals`: () of a number, `TactileArray.shape`, (samples, axes)."""
    if isinstance(value, Image):
        cells = value.cells
        shape: tuple[int, ...] | None = getattr(cells, "shape", None)
        if shape is None:
            shape = (len(cells), len(cells[0])) if cells and isinstance(cells[0], tuple) else (len(cells),)
        return shape
    if isinstance(value, Samples):
        return len(value.values), len(value.values[0]) if value.values else 0
    return ()


def declared_shape(channel: Channel) -> tuple[int, ...]:
    """Return the shape that the values of a channel have, as `shape_of`."""
    if isinstance(channel, TactileArray):
        return channel.shape
    if isinstance(channel, FastChannel):
        return channel.samples, len(channel.axes)
    return ()


def dtype_of(value: Any) -> str:
    """Return the type of the numbers of a value of `Reading.signals`: that of an image which is a numpy array."""
    dtype = getattr(value.cells, "dtype", None) if isinstance(value, Image) else None
    return FLOATS if dtype is None else _name_of(dtype)


@cache
def _name_of(dtype: Any) -> str:
    """Return the name of a type of numpy, which takes numpy longer than all else that is checked in a tick."""
    return str(dtype)


def declared_dtype(channel: Channel) -> str:
    """Return the type that the numbers of a channel have, as `dtype_of`."""
    return channel.dtype if isinstance(channel, TactileArray) else FLOATS


def cells_of(array: TactileArray, numbers: NDArray[Any]) -> Any:
    """Return the cells of an `Image` of this array, given its numbers in any shape of the same order.

    A numpy array is returned by reference where that is read-only. Raises ValueError for another number of numbers.
    """
    numbers = numbers.reshape(array.shape)
    if array.dtype == FLOATS:
        return tuple(map(tuple, numbers.tolist())) if array.components > 1 else tuple(numbers.tolist())
    return read_only(numbers, array.dtype)


def read_only(numbers: NDArray[Any], dtype: str) -> NDArray[Any]:
    """Return the numbers as a read-only numpy array of this type: the same one if it is that, else a copy."""
    if numbers.dtype == dtype and numbers.flags.c_contiguous and not can_change(numbers):
        return numbers
    copied = numbers.astype(dtype, order="C")
    copied.setflags(write=False)
    return copied


def can_change(array: Any) -> bool:
    """Return whether a numpy array can be written to, or the one whose numbers it shows."""
    while hasattr(array, "flags"):
        if array.flags.writeable:
            return True
        array = array.base
    return False


def as_json(channel: Channel) -> dict[str, Any]:
    """Return the declaration of a channel as JSON values."""
    kind = next(kind for kind, cls in KINDS.items() if type(channel) is cls)
    return {"kind": kind, **asdict(channel)}


def from_json(value: Mapping[str, Any]) -> Channel:
    """Return the channel that `as_json` gave. Raises KeyError, TypeError or ValueError for anything else."""
    given = dict(value)
    cls = KINDS[given.pop("kind")]
    for name, listed in given.items():
        if isinstance(listed, list):
            given[name] = tuple(_place(member) if isinstance(member, list) else member for member in listed)
    channel: Channel = cls(**given)
    return channel


def _place(numbers: Iterable[float | None]) -> tuple[float, ...]:
    """Return the position of a cell; JSON has no NaN, so a missing number is null there."""
    return tuple(nan if number is None else number for number in numbers)


@lru_cache(maxsize=256)
def _named_tuple(names: tuple[str, ...]) -> type[tuple[Any, ...]]:
    return namedtuple("Signals", names)


@lru_cache(maxsize=64)
def _no_cells(shape: tuple[int, ...], dtype: str) -> Any:
    if dtype == FLOATS:
        return ((nan,) * shape[1] if len(shape) > 1 else nan,) * shape[0]
    import numpy as np

    cells = np.full(shape, nan if dtype == "float32" else 0, dtype)
    cells.setflags(write=False)
    return cells


def _nothing_yet(channel: Channel) -> Any:
    if isinstance(channel, TactileArray):
        return Image(0.0, 0, _no_cells(channel.shape, channel.dtype))
    if isinstance(channel, FastChannel):
        return Samples(0.0, 0, 0, ((nan,) * len(channel.axes),) * channel.samples)
    return nan
