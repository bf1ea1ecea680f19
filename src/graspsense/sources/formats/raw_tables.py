"""The tables in a file: the one place that says which reader is for which ending."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from graspsense.core.values.errors import ConfigError
from graspsense.recording.readable import readable
from graspsense.sources.formats.array_format import ARRAY_SUFFIXES, read_arrays
from graspsense.sources.formats.spreadsheet import SPREADSHEET_SUFFIXES
from graspsense.sources.formats.table import ColumnTable, TableRules
from graspsense.sources.formats.text_table import JSON_LINES, text_suffix

TEXT_SUFFIXES: Final = (
    ".csv",
    ".tsv",
    ".txt",
    ".dat",
    ".data",
    ".asc",
    ".prn",
    ".lvm",
    *JSON_LINES,
    *SPREADSHEET_SUFFIXES,
)
BAG_SUFFIXES: Final = (".bag", ".mcap", ".db3")
PARQUET_SUFFIXES: Final = (".parquet", ".pq")
READ_SUFFIXES: Final = (*TEXT_SUFFIXES, *ARRAY_SUFFIXES, *BAG_SUFFIXES, *PARQUET_SUFFIXES)
_NO_TABLES: Final = (".toml", ".json", ".pdf", ".xml", ".html", ".py", ".m")
"""Endings of texts that are something else than a table."""
_BEGINNING: Final = 4096
"""Bytes in which a file shows whether it is a text."""


def is_text(path: Path) -> bool:
    """Return whether a file is read as a text: by its ending, or else because it has no zero byte."""
    if text_suffix(path) in TEXT_SUFFIXES:
        return True
    if text_suffix(path) in (*READ_SUFFIXES, *_NO_TABLES) or not path.is_file():
        return False
    with readable(path), path.open("rb") as file:
        return b"\0" not in file.read(_BEGINNING)


def raw_tables(path: Path, rules: TableRules | None = None) -> list[ColumnTable]:
    """Return the tables in a file. Without rules, they are as they come: one for each topic of a bag.

    Raises ConfigError, PluginUnavailable, TooLarge, DataDamaged.
    """
    suffix, given = path.suffix.lower(), rules or TableRules()
    if path.is_dir() or suffix in BAG_SUFFIXES:
        from graspsense.sources.formats.ros_format import read_bag, read_topics

        return read_topics(path) if rules is None else read_bag(path, rules.used)
    if suffix in PARQUET_SUFFIXES:
        from graspsense.sources.formats.parquet_format import read_parquet

        return read_parquet(path)
    if suffix in ARRAY_SUFFIXES:
        return read_arrays(path, given)
    if is_text(path):
        from graspsense.sources.formats.text_format import read_text

        return read_text(path, given.start)
    raise ConfigError(
        f"{path}: no reader for {suffix or 'such'} files. Files are read as {', '.join(READ_SUFFIXES)}"
    )
