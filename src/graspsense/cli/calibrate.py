"""`graspsense calibrate`: files by device serial with zero, gains, load table, friction and delivered force."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import attrs
import click

from graspsense.cli.options import Finite, option_group, pipeline_options, settings_of
from graspsense.cli.output import echo_values, json_option
from graspsense.cli.terminal import Subcommands, echo, echo_table, talk
from graspsense.core.components.channels import fingertips
from graspsense.core.grasp import calibration
from graspsense.core.grasp.calibrating import Rig, breakaways, unloaded_images
from graspsense.core.grasp.calibration import counts_per_newton, load_table, motor_table
from graspsense.core.grasp.calibration_files import (
    DIRECTIONS,
    UNCALIBRATED,
    Calibration,
    calibration_path,
    calibrations_of,
    stored_zero,
    write_calibration,
)
from graspsense.core.values.channel import TactileArray
from graspsense.core.values.device import DeviceInfo
from graspsense.core.values.errors import ConfigError, DataDamaged

if TYPE_CHECKING:
    from graspsense.sources.formats.csv_columns import CsvColumns


class _Setup(NamedTuple):
    """A gripper opened without any calibration, the way to drive it, and where its calibrations are kept."""

    backend: Any
    info: DeviceInfo
    rig: Rig
    folder: str
    stored: Mapping[str, Calibration]
    first_effort_n: float


_options = option_group(
    pipeline_options,
    click.option("--replace", is_flag=True, help="Replace the stored calibration without comparing with it."),
    json_option(),
)


@click.group(cls=Subcommands)
def calibrate() -> None:
    """Calibrate a gripper and store the result under its serial number.

    The gripper must be empty. Files are stored in gripper.calibration, or in the data folder of the user.
    """


@calibrate.command()
@click.option(
    "--images", type=click.IntRange(2, 1000), default=24, show_default=True, help="Cell images to average."
)
@_options
def tare(images: int, replace: bool, **asked: Any) -> None:
    """Store the zero of the pads: the mean of cell images with open fingers that touch nothing."""
    with _set_up(asked, replace) as setup:
        stored = stored_zero(setup.stored["tare"]) if "tare" in setup.stored else None
        counts_per_n = _counts_per_n(setup)
        taken = unloaded_images(setup.rig, images, timeout_s=10.0 + images)
        facing = _fingertips(setup).facing  # the first cell on the gripping face is taken
        first_facing = facing.index(True) if True in facing else 0
        left, right = calibration.tare(taken, counts_per_n, first_facing, stored)
        if stored is None and not replace:
            setup.backend.tare(taken)
        data = {"left": list(left), "right": list(right), "images": len(taken)}
        _store(setup, "tare", data)


@calibrate.command()
@click.argument("readings", type=click.Path(exists=True, dir_okay=False))
@_options
def gain(readings: str, replace: bool, **asked: Any) -> None:
    """Store the counts under one newton of each cell, computed from READINGS.

    READINGS is a CSV file with the columns side (left or right), cell (from 0 on), counts (over the zero of this cell)
    and load_n (force on this cell alone). Several loads a cell are fitted by a line through zero.
    """
    with _set_up(asked, replace) as setup:
        cells = _fingertips(setup).cells
        rows = _grouped(readings, "side", ("left", "right"), ("cell", "counts", "load_n"))
        readings_of = {
            side: [(_cell(cell), counts, load_n) for cell, counts, load_n in rows[side]] for side in rows
        }
        _store(setup, "gain", {side: list(counts_per_newton(readings_of[side], cells)) for side in rows})


@calibrate.command("load-cell")
@click.argument("readings", type=click.Path(exists=True, dir_okay=False))
@_options
def load_cell(readings: str, replace: bool, **asked: Any) -> None:
    """Store a table from what the gripper measures to the force of a load cell, computed from READINGS.

    READINGS is a CSV file with the column load_n (force of the load cell). For a gripper with pads, its other columns
    are side (left or right) and pad_counts (sum of the pad cells over their tare). For a gripper whose motor tells its
    load, they are direction (closing or opening, in which the motor pushes) and motor (its load or current, without
    sign): at least nine readings in each direction, while the force rises and while it falls.
    """
    with _set_up(asked, replace) as setup:
        pads = any(channel.name == "pads" for channel in setup.backend.channels)
        data = _tables(readings, _counts_per_n(setup)) if pads else _motor_tables(readings)
        _store(setup, "load-cell", data)


@calibrate.command("delivered-force")
@click.argument("readings", type=click.Path(exists=True, dir_okay=False))
@_options
def delivered_force(readings: str, replace: bool, **asked: Any) -> None:
    """Store a table from the force asked for to the force that the gripper delivered, computed from READINGS.

    READINGS is a CSV file with the columns asked_n (force sent to the gripper) and delivered_n (force of a load cell
    between the fingers). Readings at the same force are averaged, and neighbours until the delivered force rises.
    """
    with _set_up(asked, replace) as setup:
        columns = _columns(readings, "asked_n", "delivered_n")
        table = load_table(
            (asked_n, delivered_n)
            for asked_n, delivered_n in _rows(readings, columns, "asked_n", "delivered_n")
        )
        data = {"asked_n": list(table.pad_n), "delivered_n": list(table.load_n)}
        _store(setup, "delivered-force", data)
        echo_table(
            ("ASKED, N", "DELIVERED, N"), [(f"{a:.1f}", f"{b:.1f}") for a, b in zip(*table, strict=True)]
        )


@calibrate.command()
@click.option(
    "--gaps", type=click.IntRange(2, 90), default=5, show_default=True, help="Number of gaps to measure at."
)
@click.option("--narrowest", "narrowest_m", type=Finite(0.002, 0.08), default=0.01, show_default=True,
              help="Smallest gap, in m.")  # fmt: skip
@_options
def friction(gaps: int, narrowest_m: float, replace: bool, **asked: Any) -> None:
    """Store the effort at which the fingers begin to move, closing and opening, over the stroke."""
    with _set_up(asked, replace) as setup:
        if setup.info.tare_images:
            setup.backend.tare(unloaded_images(setup.rig, setup.info.tare_images, timeout_s=10.0))
        widest_m = setup.rig.open().frame.gap_m * 0.95
        step_m = (widest_m - narrowest_m) / (gaps - 1)
        measured = breakaways(
            setup.rig, [narrowest_m + i * step_m for i in range(gaps)], setup.first_effort_n
        )
        names = ("gap_m", "closing_n", "opening_n")
        data = {name: [getattr(breakaway, name) for breakaway in measured] for name in names}
        _store(setup, "friction", data)
        rows = [(f"{a * 1e3:.1f}", f"{b:.2f}", f"{c:.2f}") for a, b, c in measured]
        echo_table(("GAP, mm", "CLOSING, N", "OPENING, N"), rows)


@contextmanager
def _set_up(asked: Mapping[str, Any], replace: bool) -> Iterator[_Setup]:
    """Open the gripper that the options ask for, uncalibrated, and let go of it whatever happens.

    Unless they are to be replaced, the stored calibrations must fit it.
    """
    settings = settings_of(**asked)
    component, config = settings.gripper.component, settings.gripper.config
    folder = getattr(config, "calibration", None)
    if folder is None:
        raise ConfigError(
            f"gripper {component.qualified} keeps no calibrations: its settings have no key 'calibration'. Choose a "
            "device that keeps them, as in --gripper pr2. A plugin whose cells are in counts adds the key, and applies "
            "what `calibrations_of` finds (docs/tcp_gripper.md)"
        )
    if folder == UNCALIBRATED:
        raise ConfigError("gripper.calibration is none, so there is no folder to keep a calibration in")
    backend = component.create(attrs.evolve(config, calibration=UNCALIBRATED))
    try:
        info = backend.open(settings.run.seed)
        # A calibration that cannot be kept is not begun.
        place = calibration_path(folder, info.serial, UNCALIBRATED).parent
        rig = Rig(backend, info, settings.run)
        compares = place.is_dir() and not replace
        stored = calibrations_of(folder, info.serial, info.numbers) if compares else {}
        yield _Setup(
            backend=backend,
            info=info,
            rig=rig,
            folder=folder,
            stored=stored,
            first_effort_n=settings.run.first_effort_n,
        )
    finally:
        backend.close()


def _store(setup: _Setup, kind: str, data: Mapping[str, Any]) -> None:
    made = Calibration(
        kind=kind,
        serial=setup.info.serial,
        device=dict(setup.info.numbers),
        made=datetime.now(UTC).isoformat(timespec="seconds"),
        data=data,
    )
    path = calibration_path(setup.folder, setup.info.serial, kind)
    written = write_calibration(path, made)
    echo_values({"file": str(path), "kind": kind, "serial": written.serial, "made": written.made,
                 "sha256": written.sha256, "data": dict(written.data)})  # fmt: skip
    echo(f"{kind} of {written.serial} kept in {path}", indent=2)
    for note in setup.info.notes:
        talk(f"note: {note}")


def _cell(number: float) -> int:
    """Return the number of a cell. Raises ConfigError."""
    if not number.is_integer():
        raise ConfigError(f"cell {number} is not a whole number: cells are numbered from 0 on")
    return int(number)


def _fingertips(setup: _Setup) -> TactileArray:
    """Return the declared array of the fingertips. Raises ConfigError."""
    pads = fingertips(setup.backend.channels)
    if pads is None:
        raise ConfigError(f"{setup.info.name} does not declare the cells of its fingertips")
    return pads


def _counts_per_n(setup: _Setup) -> float:
    """Return the counts of the pad under one newton, which the gripper states. Raises ConfigError."""
    counts = setup.info.numbers.get("pad_counts_per_n")
    if counts is None:
        raise ConfigError(
            f"{setup.info.name} does not state the counts of its pads under one newton: give "
            'DeviceInfo(numbers={"pad_counts_per_n": ...})'
        )
    return float(counts)


def _tables(path: str, counts_per_n: float) -> dict[str, Any]:
    tables = {}
    for side, rows in _grouped(path, "side", ("left", "right"), ("pad_counts", "load_n")).items():
        table = load_table((pad_counts / counts_per_n, load_n) for pad_counts, load_n in rows)
        tables[side] = {"pad_n": list(table.pad_n), "load_n": list(table.load_n)}
    return tables


def _motor_tables(path: str) -> dict[str, Any]:
    tables = {}
    for direction, rows in _grouped(path, "direction", DIRECTIONS, ("motor", "load_n")).items():
        (motor, load_n), error_n = motor_table([(motor, load_n) for motor, load_n in rows])
        tables[direction] = {"motor": list(motor), "load_n": list(load_n), "error_n": error_n}
    return tables


def _grouped(
    path: str, group: str, values: tuple[str, ...], names: tuple[str, ...]
) -> dict[str, list[tuple[float, ...]]]:
    """Return the numbers in the columns `names` of a CSV file, by the value in the column `group`.

    Raises DataDamaged for a missing column, and for a value of the group that is not one of `values`.
    """
    columns = _columns(path, group, *names)
    readings_of: dict[str, list[tuple[float, ...]]] = {value: [] for value in values}
    for line, value, numbers in zip(
        columns.lines, columns.cells[group], _rows(path, columns, *names), strict=True
    ):
        if value not in readings_of:
            raise DataDamaged(f"{path}:{line}: {group} is {value[:40]!r}, expected {' or '.join(values)}")
        readings_of[value].append(numbers)
    return readings_of


def _columns(path: str, *names: str) -> CsvColumns:
    """Return the columns of a CSV file, which has these. Raises DataDamaged."""
    from graspsense.sources.formats.csv_columns import CsvColumns

    columns = CsvColumns(Path(path))
    if missing := set(names) - set(columns.names):
        raise DataDamaged(f"{path} lacks the columns {', '.join(sorted(missing))}")
    return columns


def _rows(path: str, columns: CsvColumns, *names: str) -> Iterator[tuple[float, ...]]:
    """Yield the numbers of each row in these columns. Raises DataDamaged."""
    rows = zip(*map(columns.numbers, names), strict=True)
    for line, numbers in zip(columns.lines, rows, strict=True):
        if not all(map(isfinite, numbers)):
            raise DataDamaged(f"{path}:{line}: expected numbers in the columns {', '.join(names)}")
        yield tuple(map(float, numbers))
