"""JSON and tables of results on stdout, and options that name a file to write."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeVar

import click

from graspsense.cli.terminal import (
    StyleOf,
    echo_table,
    echo_text_of_values,
    print_values_alone,
    values_alone,
    writes_unicode,
)
from graspsense.core.values.errors import ConfigError
from graspsense.core.values.json_values import json_ready

if TYPE_CHECKING:
    from graspsense.report.found_table import FoundTable

CommandT = TypeVar("CommandT", bound=Callable[..., Any])

_PROBE_BYTES: Final = 1 << 16
"""Size of the file by which is tested whether a folder can be written; more than the smallest model."""


def json_option(text: str = "Print the result as JSON.") -> Callable[[CommandT], CommandT]:
    """Return the decorator that adds --json; `text` says what is printed by it, with `echo_values`."""

    def ask(_context: click.Context, _param: click.Parameter, asked: bool) -> None:
        print_values_alone(asked)

    return click.option("--json", "as_json", is_flag=True, expose_value=False, callback=ask, help=text)


def echo_values(value: object, long: bool = False) -> bool:
    """Print the result of a command as JSON if --json was given, and return whether; its text is then not printed."""
    if values_alone():
        echo_json(value, long)
    return values_alone()


def echo_json(value: object, long: bool = False) -> None:
    """Print a value as JSON. JSON knows no infinities and no NaN: they become `"inf"`, `"-inf"` and null.

    A long one comes in one line, which takes a fifth of the time.
    """
    text = json.dumps(
        json_ready(value),
        indent=None if long else 2,
        ensure_ascii=not writes_unicode(),
        allow_nan=False,
    )
    echo_text_of_values(text)


def echo_found(table: FoundTable, styles: Mapping[str, StyleOf] | None = None) -> None:
    """Print the header and the rows of a table of results; `styles` are by the header, in capitals.

    A unit in square brackets stays as it is.
    """
    names = (name.partition("[") for name in table.header)
    header = tuple(f"{words.upper()}{bracket}{unit}" for words, bracket, unit in names)
    echo_table(header, table.rows, styles)


def file_to_write(*endings: str) -> Callable[[click.Context, click.Parameter, str | None], str | None]:
    """Return the callback of an option that names a file, with one of these endings if there are any, such as `.html`.

    A file that cannot be written is refused before the work and not after. So is a pipe or a device: the file that is
    written takes its place, also where root could replace it.
    """

    def checked(ctx: click.Context, param: click.Parameter, value: str | None) -> str | None:
        if value is None:
            return None
        path = Path(value)
        if endings and path.suffix.lower() not in endings:
            wrong = f"{value}: the name of the file must end in {' or '.join(endings)}"
            raise click.BadParameter(wrong, ctx, param)
        if path.is_dir():
            raise click.BadParameter(f"{value} is a folder: name a file in it", ctx, param)
        if path.exists() and not path.is_file():
            raise click.BadParameter(f"{value} is a pipe or a device: name a file", ctx, param)
        if not path.parent.is_dir():
            raise click.BadParameter(
                f"{value} cannot be written: there is no folder {path.parent}", ctx, param
            )
        try:
            _probe(path.parent)
        except OSError as error:
            raise click.BadParameter(f"{value} cannot be written: {error.strerror}", ctx, param) from error
        return value

    return checked


def _probe(folder: Path) -> None:
    """Raise OSError if no file can be written in this folder."""
    with tempfile.TemporaryFile(dir=folder) as probe:
        probe.write(bytes(_PROBE_BYTES))


def page_to_write(folder: str) -> Path:
    """Return the path of the page in a folder, which is made; refuse it before the work if it cannot be written.

    Raises UsageError, also where it would replace the page of a store or of an experiment.
    """
    from graspsense.experiments.results import EXPERIMENT
    from graspsense.store.opening import FILE

    path = Path(folder)
    if any((path / name).is_file() for name in (FILE, EXPERIMENT)):
        raise click.UsageError(f"{folder} has a page of its own, that of its trials: name another folder")
    try:
        path.mkdir(parents=True, exist_ok=True)
        _probe(path)
    except OSError as error:
        why = "it is no folder" if isinstance(error, FileExistsError) else error.strerror
        raise click.UsageError(f"{folder} cannot be written: {why}. Name a folder for the page") from error
    return path / "report.html"


def check_outputs(*paths: str | None, overwrite: bool, sources: Sequence[str] = ()) -> None:
    """Raise ConfigError if these files cannot be the outputs of a command.

    Two of them must not be the same file, none may be a file that the command reads, and without `overwrite` none may
    exist.
    """
    outputs: list[str] = []
    for path in (name for name in paths if name is not None):
        real = os.path.realpath(path)
        if real in outputs:
            raise ConfigError(f"two options name the same file {path}: name another for one of them")
        if any(os.path.isfile(source) and real == os.path.realpath(source) for source in sources):
            raise ConfigError(f"{path} is what is read here: name another file")
        if os.path.exists(path) and not overwrite:
            raise ConfigError(f"{path} already exists: name another file, or add --overwrite to replace it")
        outputs.append(real)
