"""The channels of a gripper: numbers, arrays of tactile cells, and fast signals, each with its unit and rate."""

from __future__ import annotations

import re
from keyword import iskeyword
from typing import Any, Final, Literal

from attrs import Attribute, field, frozen
from attrs.validators import and_, deep_iterable, ge, in_, instance_of, min_len

from graspsense.core.values.limits import CHANNEL_NUMBERS
from graspsense.core.values.signals import CHANNELS


def _is_name(entry: object, attribute: Attribute[Any], name: str) -> None:
    if not re.fullmatch(r"[a-z][a-z0-9_-]*", name):
        raise ValueError(
            f"'{attribute.name}' is {name!r}: write small letters, digits, hyphens and underscores, a letter first, "
            "without spaces, as in lab-hand"
        )


IS_NAME: Final = [instance_of(str), _is_name]
"""The validators of the name of a component or channel."""


@frozen
class Channel:
    """A signal that a backend provides or that a component requires: one number a tick.

    `rate_hz` is the rate that a backend provides, or the least rate that a component requires (0: any rate). A name in
    `signals.CHANNELS` must have the unit given there. A plugin may define further channels with units of its own,
    which `Reading.signals` holds under their names. Raises ValueError for a wrong or missing unit, and for a name of a
    further channel that cannot be the name of a field.
    """

    name: str = field(validator=IS_NAME)
    """The name of the channel."""
    unit: str = field(validator=instance_of(str))
    """Its unit."""
    rate_hz: float = field(default=0.0, converter=float, validator=ge(0.0))
    """The rate that a backend provides, or the least rate that a component requires (0: any rate)."""

    def __attrs_post_init__(self) -> None:
        unit = CHANNELS.get(self.name)
        if self.name == "pads" and isinstance(self, TactileArray):
            unit = None  # the cells of other fingertips have other units
        if unit is not None and self.unit != unit:
            raise ValueError(
                f"channel {self.name!r} is in {unit}, not in {self.unit!r}: convert its numbers, and write {unit!r}"
            )
        if not self.unit:
            raise ValueError(f"channel {self.name!r} is not one of {', '.join(CHANNELS)}: give it a unit")
        if self.name not in CHANNELS and (not self.name.isidentifier() or iskeyword(self.name)):
            raise ValueError(
                f"channel {self.name!r} is read as reading.signals.{self.name}, which Python does not allow: write "
                f"{re.sub(r'[^a-z0-9_]', '_', self.name)!r}"
                if not iskeyword(self.name)
                else f"channel {self.name!r} is a word of Python: choose another name"
            )


def _refuse_too_many(channel: Channel, numbers: int) -> None:
    """Raise ValueError if a reading of this channel has more numbers than a recording holds."""
    if too_many := CHANNEL_NUMBERS.exceeded(numbers):
        raise ValueError(f"channel {channel.name!r} has {too_many}")


CellType = Literal["float64", "float32", "uint16", "uint8"]
FLOATS: Final[CellType] = "float64"
"""The type of cells that a reading has as Python floats; those of every other type are a numpy array."""


@frozen
class TactileArray(Channel):
    """An array of tactile cells, or the pixels of a camera. An image has one to three numbers for each cell.

    The array named `pads` stands for both fingertips, whose images are `Reading.pads`; every other array has its
    `Image` in `Reading.signals`. Its cells are given by `rows` and `columns` (row by row), by `positions_m`, or by
    both. With the default `dtype` an image is a tuple of floats, which compiled laws take. With every other one it is
    a read-only numpy array of that type, which is passed on by reference: choose it for a camera. Raises ValueError
    if there is no cell, if these do not have the same number of cells, if there are more numbers than
    `GRASPSENSE_MAX_CHANNEL_NUMBERS`, and if `pads` has another type or several components.
    """

    finger: str = field(default="", validator=instance_of(str), kw_only=True)
    """The finger that carries it, in the maker's words; empty for `pads`, and where it is not on a finger."""
    rows: int = field(default=0, validator=[instance_of(int), ge(0)], kw_only=True)
    columns: int = field(default=0, validator=[instance_of(int), ge(0)], kw_only=True)
    positions_m: tuple[tuple[float, float], ...] = field(default=(), kw_only=True)
    """The place of each cell on its surface, along the finger and across it; NaN for a cell that is elsewhere."""
    facing: tuple[bool, ...] = field(default=(), kw_only=True)
    """Whether each cell faces the object; empty if all do."""
    components: int = field(default=1, validator=[instance_of(int), in_((1, 2, 3))], kw_only=True)
    """The numbers of a cell: 3 for a force in three directions, or for red, green and blue."""
    dtype: CellType = field(
        default=FLOATS, validator=in_((FLOATS, "float32", "uint16", "uint8")), kw_only=True
    )
    """The type of the numbers: `float64`, a Python float each, or `float32`, `uint16`, `uint8`, a numpy array."""

    def __attrs_post_init__(self) -> None:
        super().__attrs_post_init__()
        grid, placed = self.rows * self.columns, len(self.positions_m)
        if not self.cells or (grid and placed and grid != placed):
            raise ValueError(
                f"array {self.name!r} has {self.rows} rows, {self.columns} columns and {placed} positions: give rows "
                "and columns, the position of each cell, or both with the same number of cells"
            )
        _refuse_too_many(self, self.numbers)
        if self.name == "pads" and (self.dtype != FLOATS or self.components != 1):
            raise ValueError(
                f"'pads' has {self.components} numbers of {self.dtype} a cell, and the fingertips have one float64 a "
                "cell: declare an array for each finger, such as TactileArray('camera_left', ..., finger='left')"
            )
        if self.facing and len(self.facing) != self.cells:
            raise ValueError(
                f"array {self.name!r} has {self.cells} cells, and 'facing' has {len(self.facing)} values"
            )

    @property
    def cells(self) -> int:
        """The number of cells."""
        return self.rows * self.columns or len(self.positions_m)

    @property
    def numbers(self) -> int:
        """The number of numbers of an image."""
        return self.cells * self.components

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of an image, as a trace has it: (cells,), or (cells, components) of several components.

        Of a numpy array with rows and columns it is (rows, columns), or (rows, columns, components).
        """
        grid = self.dtype != FLOATS and self.rows
        cells = (self.rows, self.columns) if grid else (self.cells,)
        return cells if self.components == 1 else (*cells, self.components)


@frozen
class FastChannel(Channel):
    """A signal with several samples a tick, such as an acceleration.

    `rate_hz` is the number of samples a second. `samples` is the largest number of new samples in one tick. `clock`
    says what the samples are timed by: `device`, the clock of the frames, or `sensor`, an oscillator of its own, whose
    rate is nominal. Raises ValueError where there is no sample or no axis.
    """

    samples: int = field(default=1, validator=[instance_of(int), ge(1)], kw_only=True)
    axes: tuple[str, ...] = field(
        default=("value",),
        validator=and_(deep_iterable(instance_of(str), instance_of(tuple)), min_len(1)),
        kw_only=True,
    )
    """The names of its axes: `("x", "y", "z")`."""
    clock: Literal["device", "sensor"] = field(
        default="device", validator=in_(("device", "sensor")), kw_only=True
    )

    def __attrs_post_init__(self) -> None:
        super().__attrs_post_init__()
        if self.name in CHANNELS:
            raise ValueError(
                f"channel {self.name!r} is part of a frame, so it has one value a tick: give another name"
            )
        _refuse_too_many(self, self.samples * len(self.axes))
