"""From raw cell counts to newtons: the tare, the force on a fingertip, and its calibration by a load cell.

Raw counts have an offset of some thousands, which differs between cells, fingers and runs. Every force is therefore a
difference from images taken with nothing touching. The counts per newton are those of the gripper, from its plugin.
A cell that reads 0 or 65535, the ends of a 16-bit count, is dead (`ethercat_hardware`, wg06.cpp). Sums leave it out.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Sequence
from math import ceil, inf
from typing import Final, NamedTuple

from graspsense.core.values.errors import ConfigError, TareRefused
from graspsense.core.values.signals import Pads

TARE_SPREAD_N: Final = 0.5
"""A tare is refused if the sum of a pad varies by more than this while nothing should touch it."""

TARE_DRIFT_N: Final = 3.0
"""A tare is refused if the zero of a pad differs by more than this from the stored one: the pad is loaded.

Offsets also differ between runs, on the PR2 by up to some hundred counts a cell, or 200 * 15 / 1600 = 1.9 N on a pad.
"""
SCALE_UNSEEN: Final = "no check tells a wrong scale of both pads from a stiffer object"
"""What a gripper says of pads that were not calibrated."""
LARGEST_COUNT: Final = 65535.0
"""The largest count of 16 bits."""
PAD_DIGITS: Final = 5
"""Digits behind the point to which readings have the same pad force: between closer ones a slope is rounding."""

Cells = tuple[float, ...]


def pad_force(cells: Cells, zero: Cells, counts_per_n: float, first_cell: int) -> float:
    """Return the force (N) on the cells of the gripping face, which are all from number `first_cell` on.

    `counts_per_n` is the number of counts of their sum under one newton.
    """
    total = 0.0
    for i in range(first_cell, len(cells)):
        total += cells[i] - zero[i]
    return total / counts_per_n


def edge_force(cells: Cells, zero: Cells, counts_per_n: tuple[float, ...]) -> float:
    """Return the largest force (N) on a single one of the first cells, for each of which `counts_per_n` has a value."""
    largest = (cells[0] - zero[0]) / counts_per_n[0]
    for i in range(1, len(counts_per_n)):
        force = (cells[i] - zero[i]) / counts_per_n[i]
        if force > largest:
            largest = force
    return largest


def answers(count: float) -> bool:
    """Return whether a cell with this count works."""
    return 0.0 < count < LARGEST_COUNT


def masked(cells: Cells, zero: Cells) -> tuple[Cells, int]:
    """Return the cells with each dead one set to its zero, where it adds no force, and the number of dead cells.

    A cell whose zero is 0 was dead during the tare, and counts as dead afterwards.
    """
    total = sum(cells)
    if min(cells) > 0.0 and max(cells) < LARGEST_COUNT and total == total and 0.0 not in zero:
        return (
            cells,
            0,
        )  # all of them answer; NaN is neither the smallest nor the largest, but shows in the sum
    good = [answers(c) and z != 0.0 for c, z in zip(cells, zero, strict=True)]
    kept = tuple([c if ok else z for c, z, ok in zip(cells, zero, good, strict=True)])
    return kept, good.count(False)


def zero_of(images: Sequence[Cells]) -> Cells:
    """Return the mean of each cell over these images of one fingertip."""
    total = images[0]
    for image in images[1:]:
        total = tuple([a + b for a, b in zip(total, image, strict=True)])
    return tuple([cell / len(images) for cell in total])


def tare(
    images: Sequence[Pads],
    counts_per_n: float,
    first_cell: int,
    stored: tuple[Cells, Cells] | None = None,
) -> tuple[Cells, Cells]:
    """Return the zero of the left and of the right fingertip from images taken with nothing touching.

    The cells of the gripping face are those from `first_cell` on. The zero of a cell is the mean over the images in
    which it works, or 0 if it works in none. `stored` is the zero of an earlier tare of unloaded pads. Raises
    TareRefused if there is no image, if a value is NaN, if all cells of a fingertip are dead, if the sum of a pad
    varies by more than `TARE_SPREAD_N` over the images (something touches it or moves), or if it differs by more
    than `TARE_DRIFT_N` from the stored one (something presses on it steadily).
    """
    if not images:
        raise TareRefused("no cell image came while taring: check the fingertips' cables, then try again")
    zeros: list[Cells] = []
    for i, (side, cells) in enumerate(
        (("left", [i.left for i in images]), ("right", [i.right for i in images]))
    ):
        zero = zero_of(cells)
        if any(value != value for value in zero):
            raise TareRefused(f"the {side} fingertip gives cells that are not numbers, so it cannot be tared")
        if not all(answers(value) for image in cells for value in image):
            zero = _zero_of_answering(cells)
            if not any(zero):
                raise TareRefused(
                    f"all cells of the {side} fingertip read 0 or {LARGEST_COUNT:.0f}: it may not be connected"
                )
        forces = [pad_force(masked(image, zero)[0], zero, counts_per_n, first_cell) for image in cells]
        spread = max(forces) - min(forces)
        if spread > TARE_SPREAD_N:
            raise TareRefused(
                f"the {side} pad varied by {spread:.2f} N while taring, and {TARE_SPREAD_N} N is allowed: "
                "take everything out of the gripper, wait until it is still, and try again"
            )
        if stored is not None:
            load = pad_force(masked(zero, stored[i])[0], stored[i], counts_per_n, first_cell)
            if abs(load) > TARE_DRIFT_N:
                raise TareRefused(
                    f"the {side} pad is {load:+.2f} N off its stored tare, and {TARE_DRIFT_N} N is allowed: take "
                    "everything out of the gripper and try again; or, if nothing touches it, store a new tare with "
                    "`graspsense calibrate tare --replace`"
                )
        zeros.append(zero)
    return zeros[0], zeros[1]


def _zero_of_answering(images: Sequence[Cells]) -> Cells:
    zero = []
    for cell in zip(*images, strict=True):
        good = [value for value in cell if answers(value)]
        zero.append(sum(good) / len(good) if good else 0.0)
    return tuple(zero)


def counts_per_newton(readings: Iterable[tuple[int, float, float]], cells: int) -> Cells:
    """Return the counts under one newton of each cell of a fingertip from readings (cell, counts, load in N).

    The counts are those over the zero of the cell, and the load is on this cell alone: the line through zero that fits
    best. Raises ConfigError for a cell that there is not or that has no reading, a load that is not above 0 N, and a
    cell whose counts do not rise with the load.
    """
    products, squares = [0.0] * cells, [0.0] * cells
    for cell, counts, load_n in readings:
        if not 0 <= cell < cells:
            raise ConfigError(f"there is no cell {cell}: the fingertip has {cells}, from 0 on")
        if not (0.0 < load_n < float("inf") and abs(counts) < float("inf")):
            raise ConfigError(
                f"reading ({counts}, {load_n}) of cell {cell}: give counts, and a load above 0 N"
            )
        products[cell] += counts * load_n
        squares[cell] += load_n * load_n
    missing = [str(cell) for cell in range(cells) if not squares[cell]]
    if missing:
        raise ConfigError(f"the cells {', '.join(missing)} have no reading: press on each cell")
    gains = tuple(product / square for product, square in zip(products, squares, strict=True))
    for cell, gain in enumerate(gains):
        if not gain > 0.0:
            raise ConfigError(
                f"the counts of cell {cell} do not rise with its load: is it the cell that was pressed?"
            )
    return gains


def cells_force(cells: Cells, zero: Cells, counts_per_n: Cells, first_cell: int) -> float:
    """Return the force (N) on the cells of the gripping face, which are all from number `first_cell` on.

    `counts_per_n` has the counts under one newton of each cell, as `stored_gain` returns them.
    """
    total = 0.0
    for i in range(first_cell, len(cells)):
        total += (cells[i] - zero[i]) / counts_per_n[i]
    return total


class LoadTable(NamedTuple):
    """The force that a load cell measured (N) at each force of a pad (N); both rise, from (0, 0) on."""

    pad_n: tuple[float, ...]
    load_n: tuple[float, ...]


def load_table(readings: Iterable[tuple[float, float]]) -> LoadTable:
    """Return the table that fits these readings (pad, load cell) in N of one fingertip: Fig. 4 of Chitta et al.

    Readings at the same pad force (to `PAD_DIGITS`) are averaged, and neighbours are averaged until the load rises with
    the pad force (pool adjacent violators). Raises ConfigError for fewer than two pad forces above zero, and for a
    reading that is negative or not a number.
    """
    sums: dict[float, list[float]] = {}
    for pad, load in readings:
        if not (0.0 <= pad < float("inf") and 0.0 <= load < float("inf")):
            raise ConfigError(f"load-cell reading ({pad}, {load}): both must be forces of 0 N or more")
        sums.setdefault(round(pad, PAD_DIGITS), []).append(load)
    sums.pop(0.0, None)
    if len(sums) < 2:
        raise ConfigError(f"a load table needs readings at two pad forces above 0 N or more, not {len(sums)}")
    pools: list[tuple[float, list[float]]] = []  # mean load, the pad forces it holds for
    for pad in sorted(sums):
        load, pads = sum(sums[pad]) / len(sums[pad]), [pad]
        while pools and pools[-1][0] > load:
            earlier_load, more = pools.pop()
            load = (earlier_load * len(more) + load * len(pads)) / (len(more) + len(pads))
            pads = more + pads
        pools.append((load, pads))
    pad_n = [pad for _, pads in pools for pad in pads]
    load_n = [load for load, pads in pools for _ in pads]
    return LoadTable((0.0, *pad_n), (0.0, *load_n))


class MotorTable(NamedTuple):
    """The force (N) that a load cell measured at each load or current of a motor that pushes in one direction.

    Nine of ten further readings are within `error_n` of it. The friction of the motor is in the table, and how much
    the force differs while it rises and falls is in the error.
    """

    table: LoadTable
    error_n: float


LEAST_READINGS: Final = 9
"""Readings from which on the largest of their errors holds for nine of ten further ones."""


def motor_table(readings: Sequence[tuple[float, float]]) -> MotorTable:
    """Return the table of these readings (load or current of the motor, without sign; force of the load cell in N).

    The error of each reading is taken from the table of the others, and `error_n` is exceeded by one of ten. Raises
    ConfigError for fewer than `LEAST_READINGS`, and as `load_table` does.
    """
    if len(readings) < LEAST_READINGS:
        raise ConfigError(
            f"{len(readings)} readings of the motor in one direction: take at least {LEAST_READINGS}, while the force "
            "rises and while it falls"
        )
    errors = []
    for i, (motor, load_n) in enumerate(readings):
        others = load_table([*readings[:i], *readings[i + 1 :]])
        errors.append(abs(load_of(others, motor)[0] - load_n))
    rank = ceil(0.9 * (len(errors) + 1))
    return MotorTable(load_table(readings), sorted(errors)[rank - 1])


def load_within(table: MotorTable, motor: float) -> tuple[float, float]:
    """Return the force (N, not negative) at this load or current, and how far off it can be.

    That is inf beyond the last reading. Below the first one, it can be any force up to that of this reading.
    """
    load_n, inside = load_of(table.table, motor)
    least_n = table.table.load_n[1] if motor < table.table.pad_n[1] else 0.0
    return max(load_n, 0.0), max(table.error_n, least_n) if inside else inf


def motor_at(table: MotorTable, load_n: float) -> float:
    """Return the largest load or current with which the motor presses with at most this force; at most the last one."""
    motor, loads = table.table
    i = bisect_right(loads, load_n)
    if i == len(loads):
        return motor[-1]
    share = (load_n - loads[i - 1]) / (loads[i] - loads[i - 1])
    return motor[i - 1] + share * (motor[i] - motor[i - 1])


def load_of(table: LoadTable, pad_n: float) -> tuple[float, bool]:
    """Return the load (N) at this pad force, and whether this lies within the table.

    The table is interpolated linearly, and extrapolated with its first slope below zero and its last slope above.
    """
    pads, loads = table
    i = min(max(bisect_right(pads, pad_n), 1), len(pads) - 1)
    slope = (loads[i] - loads[i - 1]) / (pads[i] - pads[i - 1])
    return loads[i - 1] + slope * (pad_n - pads[i - 1]), pad_n <= pads[-1]


def asked_force(delivered: LoadTable, wanted_n: float) -> float:
    """Return the force (N) to ask a gripper for, so that it delivers `wanted_n` and not more.

    `delivered` is a table from the force asked for to the force that a load cell measured. Above its last force the
    last slope holds; where even the least measured force is more than wanted, the least one that was asked for.

    >>> asked_force(LoadTable((0.0, 20.0, 40.0), (0.0, 30.0, 50.0)), 40.0)
    30.0
    """
    asked, loads = delivered
    if wanted_n < loads[1]:
        return asked[1]
    i = min(bisect_right(loads, wanted_n), len(loads) - 1)
    while i > 1 and loads[i] <= loads[i - 1]:
        i -= 1
    slope = loads[i] - loads[i - 1]
    return asked[i - 1] + (asked[i] - asked[i - 1]) * (wanted_n - loads[i - 1]) / slope
