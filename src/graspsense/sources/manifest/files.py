"""The files that a manifest names: by patterns with fields, or by a list."""

from __future__ import annotations

import glob
import os
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Final

from attrs import frozen

from graspsense.core.values.errors import ConfigError, listed
from graspsense.core.values.label_text import is_missing_label
from graspsense.sources.formats.csv_columns import CsvColumns
from graspsense.sources.formats.patterns import PatternError, file_template
from graspsense.sources.manifest.description import ReadManifest, texts_of

FIELD: Final = re.compile(r"\{(\w+)\}")
"""A field in a text of a manifest: `{fruit}`."""


@frozen(kw_only=True)
class NamedFile:
    """A file with the facts that its path, or its row of a list, tells.

    `name` is its path from the folder of the manifest. `rows` are the first and the last row that are used, counted
    from 1, if only a part of the file is. `problem` is why the row of a list cannot be used, empty if it can be.
    """

    path: Path
    name: str
    fields: dict[str, str]
    blank: frozenset[str] = frozenset()
    """The columns of a list that are empty in its row."""
    rows: tuple[int, int] | None = None
    problem: str = ""


def files_of(manifest: ReadManifest) -> list[NamedFile]:
    """Return the files in the order of their names, with numbers in them ordered as numbers. Raises ConfigError."""
    if not os.path.isdir(manifest.base):  # of pathlib, it raises for a name that is too long
        raise ConfigError(
            f"{manifest.place}: there is no folder {manifest.base}. The key folder is relative to the manifest"
        )
    keys = manifest.keys
    files = list(_listed(manifest)) if keys.list else list(_matching(manifest, texts_of(keys.files)))
    if not files:
        some = [name for name, _ in tree_below(manifest.base)][:5]
        raise ConfigError(
            f"{manifest.place}: no file in {manifest.base} matches {' or '.join(map(repr, texts_of(keys.files)))}. "
            + (f"It contains, for example: {', '.join(some)}" if some else "The folder is empty")
        )
    return files


def left_out(manifest: ReadManifest) -> Iterator[str]:
    """Yield that files are not used because they have another text where a pattern wants digits. Raises ConfigError."""
    patterns = texts_of(manifest.keys.files)
    wider = [pattern.replace(":d}", "}") for pattern in patterns if ":d}" in pattern]
    if manifest.keys.list or not wider:
        return
    used = {file.name for file in _matching(manifest, patterns)}
    others = [file for file in _matching(manifest, wider) if file.name not in used]
    known = beside(manifest, {file.path.parent for file in others})
    if names := [file.name for file in others if file.path not in known]:
        yield f"not used: {listed(names)}, which have a text where {' or '.join(map(repr, patterns))} wants digits"


def beside(manifest: ReadManifest, folders: Iterable[Path]) -> set[Path]:
    """Return the files in these folders that hold further columns, or values; a field in a name may be any text."""
    names = (*texts_of(manifest.keys.beside), *manifest.value_files.values())
    patterns = ["*".join(map(glob.escape, FIELD.split(name)[::2])) for name in names]
    places = (os.path.join(glob.escape(str(folder)), pattern) for folder in folders for pattern in patterns)
    return {Path(path) for place in places for path in glob.glob(place)}


def _matching(manifest: ReadManifest, patterns: Sequence[str]) -> Iterator[NamedFile]:
    """Yield the files that a pattern matches. Raises ConfigError."""
    try:
        templates = [file_template(pattern) for pattern in patterns]
        for name, path in tree_below(manifest.base):
            if path.name == manifest.place.name and path.resolve() == manifest.place.resolve():
                continue
            spelled = (name, name.removesuffix(path.suffix) + path.suffix.lower())  # such as .CSV
            matches = (template.fields(text) for text in spelled for template in templates)
            fields = next((match for match in matches if match is not None), None)
            if fields is not None:
                yield NamedFile(path=path, name=name, fields=fields)
    except PatternError as error:
        raise ConfigError(f"{manifest.place}: files: {error}") from None


def tree_below(base: Path) -> Iterator[tuple[str, Path]]:
    """Yield every file below a folder by its path from there; the folder of a ROS 2 bag counts as a file."""
    paths = []
    for folder, folders, names in os.walk(base):
        folders[:] = [name for name in folders if not name.startswith(".")]
        if "metadata.yaml" in names:
            folders.clear()
            paths.append(Path(folder))
        else:
            paths += [Path(folder) / name for name in names if not name.startswith(".")]
    shown = [(path.relative_to(base).as_posix(), path) for path in paths]
    return iter(sorted(shown, key=lambda named: natural_key(named[0])))


def natural_key(name: str) -> list[tuple[int, int, str]]:
    """Return the key by which names are sorted so that `data_2` stands before `data_10`."""
    return [(0, int(part), "") if part.isdecimal() else (1, 0, part) for part in re.split(r"(\d+)", name)]


def _listed(manifest: ReadManifest) -> Iterator[NamedFile]:
    """Yield the files of a list. Raises ConfigError, or DataDamaged with the line."""
    place = manifest.place.parent / manifest.keys.list
    columns = CsvColumns(place)
    for k, name in enumerate(columns.complete_column("file", "the file of each grasp")):
        row = {
            column: cells[k]
            for column, cells in columns.cells.items()
            if column != "file" and not is_missing_label(cells[k])
        }
        path, where = manifest.base / name, f"{place}, line {columns.lines[k]}"
        rows, problem = None, "" if os.path.exists(path) else f"{where}: there is no file {path}"
        try:
            rows = _rows(where, row)
        except ConfigError as error:
            problem = str(error)
        blank = frozenset(columns.cells.keys() - row.keys() - {"file"})
        yield NamedFile(path=path, name=name, fields=row, blank=blank, rows=rows, problem=problem)


def _rows(where: str, row: dict[str, str]) -> tuple[int, int] | None:
    given = [row.pop(name, "") for name in ("first_row", "last_row")]
    if not any(given):
        return None
    if not all(cell.isdecimal() and len(cell) < 16 for cell in given) or not 1 <= int(given[0]) <= int(
        given[1]
    ):
        raise ConfigError(
            f"{where}: first_row and last_row are {given[0]!r} and {given[1]!r}: give two numbers of "
            "rows, counted from 1, the first not behind the last"
        )
    return int(given[0]), int(given[1])
