"""The further channels of a gripper, which are not part of a frame: their values in a reading, and their record."""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Iterable, Mapping
from functools import lru_cache
from math import nan
from typing import Any, Final

from attrs import asdict

from graspsense.core.values.channel import Channel, FastChannel, TactileArray
from graspsense.core.values.fingers import FingerForce
from graspsense.core.values.signals import CHANNELS, Image, Samples

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

    It is `()` where there are no further channels.

    >>> from graspsense.plugin_api import TactileArray
    >>> no_signals((TactileArray("palm", "counts", rows=1, columns=2),))
    Signals(palm=Image(t_s=0.0, counter=0, cells=(nan, nan)))
    """
    channels = further(channels)
    return signal_type(channels)(*map(_nothing_yet, channels)) if channels else ()


def shape_of(value: Any) -> tuple[int, ...]:
    """Return the shape of a value of `Reading.signals`: () of a number, (cells,) of an image, (samples, axes)."""
    if isinstance(value, Image):
        return (len(value.cells),)
    if isinstance(value, Samples):
        return len(value.values), len(value.values[0]) if value.values else 0
    return ()


def declared_shape(channel: Channel) -> tuple[int, ...]:
    """Return the shape that the values of a channel have, as `shape_of`."""
    return shape_of(_nothing_yet(channel))


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
            given[name] = tuple(_place(one) if isinstance(one, list) else one for one in listed)
    channel: Channel = cls(**given)
    return channel


def _place(numbers: Iterable[float | None]) -> tuple[float, ...]:
    """Return the position of a cell; JSON has no NaN, so a missing number is null there."""
    return tuple(nan if number is None else number for number in numbers)


@lru_cache(maxsize=256)
def _named_tuple(names: tuple[str, ...]) -> type[tuple[Any, ...]]:
    return namedtuple("Signals", names)


def _nothing_yet(channel: Channel) -> Any:
    if isinstance(channel, TactileArray):
        return Image(0.0, 0, (nan,) * channel.cells)
    if isinstance(channel, FastChannel):
        return Samples(0.0, 0, 0, ((nan,) * len(channel.axes),) * channel.samples)
    return nan
