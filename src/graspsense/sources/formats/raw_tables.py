"""The tables in a file as they are, without a manifest."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from graspsense.core.values.errors import ConfigError
from graspsense.recording.readable import refuse_devices
from graspsense.sources.formats.table import ColumnTable
from graspsense.sources.formats.text_table import JSON_LINES, text_suffix

TEXT_SUFFIXES: Final = (".csv", ".tsv", ".txt", ".dat", ".data", *JSON_LINES)
BAG_SUFFIXES: Final = (".bag", ".mcap", ".db3")
PARQUET_SUFFIXES: Final = (".parquet", ".pq")


def raw_tables(path: Path) -> list[ColumnTable]:
    """Return the tables in a file: one for each topic of a bag. Raises ConfigError, TooLarge, DataDamaged."""
    refuse_devices(path)
    suffix = path.suffix.lower()
    if path.is_dir() or suffix in BAG_SUFFIXES:
        from graspsense.sources.formats.ros_format import read_topics

        return read_topics(path)
    if suffix in PARQUET_SUFFIXES:
        from graspsense.sources.formats.parquet_format import read_parquet

        return read_parquet(path)
    from graspsense.sources.formats.array_format import ARRAY_SUFFIXES, read_arrays
    from graspsense.sources.formats.text_format import read_text

    if suffix in ARRAY_SUFFIXES:
        return read_arrays(path)
    if text_suffix(path) in TEXT_SUFFIXES:
        return read_text(path)
    raise ConfigError(f"{path}: no reader for {suffix or 'such'} files")
