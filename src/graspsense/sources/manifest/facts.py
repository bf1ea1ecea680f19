"""What is known of a grasp beside its samples: label, individual object, time of recording, order, and properties."""

from __future__ import annotations

import os
import re
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from graspsense.core.values.errors import ConfigError, DataDamaged, listed
from graspsense.core.values.label_text import label_text
from graspsense.core.values.written_numbers import number_in
from graspsense.recording.readable import readable
from graspsense.sources.formats.numpy_files import npy_array
from graspsense.sources.formats.table import ColumnTable
from graspsense.sources.manifest.available import AvailableColumns
from graspsense.sources.manifest.description import ReadManifest
from graspsense.sources.manifest.files import FIELD, NamedFile

_NOT_IN_LABELS: Final = re.compile(r"[\s#,]+")
_DOTTED: Final = re.compile(r"(\d\d?)\.(\d\d?)\.(\d{4})\b,?")
"""A German date: `4.3.2024`."""
_STAMP: Final = re.compile(r"(\d{4})-?(\d\d)-?(\d\d)[T _-]?(\d\d):?(\d\d):?(\d\d)(?:\.\d+)?")


def filled(manifest: ReadManifest, key: str, template: str, table: ColumnTable) -> str:
    """Return a template filled from the facts and columns of a table. Raises ConfigError, DataDamaged."""

    def value(match: re.Match[str]) -> str:
        text = table.value(match[1])
        if text is None:
            known = listed((*table.fields, *table.texts, *table.numbers, *table.about))
            raise ConfigError(
                f"{manifest.place}: {key}: {table.source} has no field or column {match[1]!r}. It has: {known}"
            )
        return text

    return FIELD.sub(value, template)


def _given(manifest: ReadManifest, key: str, table: ColumnTable) -> str:
    """Return what the manifest says for this key, or the field of that name."""
    template = getattr(manifest.keys, key)
    return filled(manifest, key, template, table) if template else table.fields.get(key, "")


def label_of(manifest: ReadManifest, table: ColumnTable) -> str:
    """Return the label of a grasp, with `_` for spaces. Raises ConfigError, DataDamaged."""
    text = _NOT_IN_LABELS.sub("_", label_text(_given(manifest, "label", table)))
    if not text:
        raise ConfigError(f"{manifest.place}: {table.source} has no label")
    return text


def instance_of(manifest: ReadManifest, table: ColumnTable) -> str:
    """Return what identifies the individual object, empty if that is not known. Raises ConfigError, DataDamaged."""
    return _NOT_IN_LABELS.sub("_", label_text(_given(manifest, "instance", table))).replace(":", "_")


def order_of(manifest: ReadManifest, table: ColumnTable) -> float | None:
    """Return the place of a grasp in the order of recording. Raises ConfigError, DataDamaged."""
    text = _given(manifest, "order", table)
    number = number_in(text)
    if text and number is None:
        raise ConfigError(f"{manifest.place}: order: {text!r} of {table.source} is not a number")
    return number


def recorded_at_of(manifest: ReadManifest, table: ColumnTable) -> str:
    """Return the time of the recording in ISO 8601, from a time stamp or a number of seconds since 1970."""
    text = _given(manifest, "recorded", table)
    if not text:
        return ""
    try:
        return iso_time(text)
    except (ValueError, OverflowError, OSError):
        raise ConfigError(
            f"{manifest.place}: recorded: {text!r} of {table.source} is not a time: write 2024-11-24T15:13:19, "
            "20241124_151319, or seconds since 1970"
        ) from None


def iso_time(text: str) -> str:
    """Return a time in ISO 8601. Raises ValueError, OverflowError or OSError for a text that is none."""
    text = _DOTTED.sub(lambda date: f"{date[3]}-{date[2]:>02}-{date[1]:>02}", text)
    stamp, number = _STAMP.fullmatch(text.removesuffix("Z")), number_in(text)
    if stamp is not None:
        return datetime(*(int(group) for group in stamp.groups()), tzinfo=UTC).isoformat()  # type: ignore[misc, arg-type]
    if number is not None:
        while number > 1e11:  # milliseconds, microseconds or nanoseconds
            number /= 1e3
        return datetime.fromtimestamp(number, UTC).isoformat()
    return datetime.fromisoformat(text).isoformat()


@np.errstate(all="ignore")  # of infinite values
def values_of(manifest: ReadManifest, file: NamedFile, table: ColumnTable) -> dict[str, float]:
    """Return the properties of a grasp, under their names with units. Raises ConfigError, DataDamaged."""
    columns = AvailableColumns(manifest, table)
    values = {}
    for name, expression in manifest.values.items():
        column = columns.computed(f"values.{name}", partial(expression.numbers, columns, len(table)))
        if np.ptp(column) > 0.0:
            raise ConfigError(
                f"{manifest.place}: values.{name} changes during {table.source}: take peak(...), "
                "first(...) or last(...)"
            )
        values[f"{name} [{expression.unit}]" if expression.unit else name] = float(column[0])
    for name, beside in manifest.value_files.items():
        number = _number_beside(file.path.parent / filled(manifest, f"values.{name}", beside, table))
        if number is not None:
            values[name] = number
    return values


def _number_beside(path: Path) -> float | None:
    """Return the single number in a file, None if there is no such file. Raises DataDamaged."""
    if not os.path.isfile(path):  # of pathlib, it raises for a name that is too long
        return None
    if path.suffix == ".npy":
        with readable(path):
            return float(npy_array(path).reshape(()))
    text = path.read_text(encoding="utf-8", errors="replace").strip()
    number = number_in(text)
    if number is None:
        raise DataDamaged(f"{path} does not hold a single number, but {text[:40]!r}")
    return number
