"""One grasp from the CSV file of another program. The user says which columns are time, gap and force:

    FILE.csv?time=T&gap=60-POS [mm]&force=max(F1,F2)&force=F3&effort=I&velocity=V

Each value is an expression over columns (`graspsense.sources.manifest.expression`), or the name of a column, followed
by `*` and a factor if the column is not in SI units. `time`, `gap` and `force` are required. A single `force` stands
for both pads; two are left and right. Without `velocity`, the velocity is the change of the gap from line to line.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final
from urllib.parse import parse_qsl, urlencode

from attrs import evolve

from graspsense.core.values.errors import ConfigError, DataDamaged, suggestion
from graspsense.recording.export_trace import declared_beside
from graspsense.recording.replayable import Recording
from graspsense.sources.columns.grasp_columns import checked_recording
from graspsense.sources.formats.table import ColumnTable
from graspsense.sources.formats.text_format import read_text
from graspsense.sources.manifest.description import QUANTITIES as MAPPED
from graspsense.sources.manifest.description import Manifest, ReadManifest
from graspsense.sources.manifest.expression import Expression, ExpressionError, parse
from graspsense.sources.manifest.notices import notices_of
from graspsense.sources.manifest.samples import samples
from graspsense.sources.recordings.exported_grasp import read_exported, refuse_table_of_store

REQUIRED: Final = ("time", "gap", "force")
QUANTITIES: Final = (*REQUIRED, "effort", "velocity")


def named(path: str, columns: Mapping[str, Sequence[str]]) -> str:
    """Return the file and its columns as one name, in the form that `read_squeeze` reads."""
    pairs = [(quantity, column) for quantity, names in columns.items() for column in names]
    return f"{path}?{urlencode(pairs, safe='*')}"


def read_csv(name: str) -> Recording:
    """Return the grasp of a CSV file whose columns the name lists, or that was exported and declares its own."""
    file, _, columns = name.partition("?")
    exported = not columns and declared_beside(Path(os.path.expanduser(file))).exists()
    return read_exported(file) if exported else read_squeeze(name)


def read_squeeze(name: str) -> Recording:
    """Return the grasp that this name describes. Raises ConfigError, or DataDamaged with the line."""
    file, mark, query = name.rpartition("?")
    columns_of: dict[str, list[str]] = {}
    for quantity, column in parse_qsl(query, keep_blank_values=True) if mark else []:
        if quantity not in QUANTITIES:
            raise ConfigError(
                f"{quantity!r} is not a quantity of a grasp. Known: {', '.join(QUANTITIES)}."
                + suggestion(quantity, QUANTITIES)
            )
        columns_of.setdefault(quantity, []).append(column)
    path = Path(os.path.expanduser(file or name))
    tables = read_text(path)
    missing = [quantity for quantity in REQUIRED if quantity not in columns_of]
    if missing:
        refuse_table_of_store(path, (*tables[0].numbers, *tables[0].texts))
        raise ConfigError(
            f"which column of {file or name} is {' and which '.join(missing)}? Write FILE.csv?time=COLUMN&gap=COLUMN"
            "&force=COLUMN, or give --time, --gap and --force to `import`. If a column is not in s, m or N, add a "
            "factor, as in POS*0.001"
        )
    for quantity, names in columns_of.items():
        allowed = 2 if quantity == "force" else 1
        if len(names) > allowed:
            raise ConfigError(f"{len(names)} columns are given for {quantity}; at most {allowed} can be")
    given = {
        quantity: [_expression(tables[0], quantity, text) for text in names]
        for quantity, names in columns_of.items()
    }
    forces = given.pop("force")
    sides = {"force": forces} if len(forces) == 1 else {"left": forces[:1], "right": forces[1:]}
    described = ReadManifest(
        place=path,
        base=path.parent,
        keys=Manifest(),
        expressions={quantity: tuple((given | sides).get(quantity, ())) for quantity in MAPPED},
    )
    columns = samples(described, tables[0])
    return evolve(checked_recording(columns), notices=tuple(notices_of(columns, described.keys)))


def _expression(table: ColumnTable, quantity: str, text: str) -> Expression:
    """Return the expression that COLUMN, COLUMN*FACTOR or an expression is. Raises ConfigError."""
    name, star, factor = text.rpartition("*")
    known = (*table.numbers, *table.texts)
    if text in known or (star and name in known):
        name, text = (text, f"'{text}'") if text in known else (name, f"'{name}'*{factor}")
        if name in table.texts and name not in table.numbers:
            where = table.not_numbers.get(name, f"it has {table.texts[name][0][:40]!r}")
            raise DataDamaged(f"{table.source}: {name} ({quantity}) is not a column of numbers: {where}")
    try:
        return parse(text)
    except ExpressionError as error:
        raise ConfigError(f"{quantity}: {error}") from None
