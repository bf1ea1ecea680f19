"""Printing: JSON and text for programs and people on stdout, talk on stderr."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import click


def echo_json(value: object, long: bool = False) -> None:
    """Print a value as JSON. JSON knows no infinities and no NaN: they become `"inf"`, `"-inf"` and null.

    A long one comes in one line, which takes a fifth of the time.
    """
    # Imported here: what is imported above is loaded by `graspsense --help`.
    from graspsense.core.json_values import json_ready

    click.echo(json.dumps(json_ready(value), indent=None if long else 2, ensure_ascii=False, allow_nan=False))


def file_to_write(ctx: click.Context, param: click.Parameter, value: str | None) -> str | None:
    """Callback of an option that names a file: its folder is there, found out before minutes of work and not after."""
    if value is not None and Path(value).is_dir():
        raise click.BadParameter(f"{value} is a folder: name a file in it", ctx, param)
    if value is not None and not Path(value).parent.is_dir():
        raise click.BadParameter(
            f"{value} cannot be written: there is no folder {Path(value).parent}", ctx, param
        )
    return value


def talk(text: str) -> None:
    """Say something that is no result, on stderr."""
    click.echo(text, err=True)


def echo_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print rows of text in columns."""
    widths = [max(len(row[i]) for row in (header, *rows)) for i in range(len(header))]
    for row in (header, *rows):
        line = "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        click.echo(line.rstrip())
