"""JSON on stdout, and options that name a file to write."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Final

import click

from graspsense.cli.terminal import echo_as_it_is

_PROBE_BYTES: Final = 1 << 16
"""Size of the file by which is tested whether a folder can be written; more than the smallest model."""


def echo_json(value: object, long: bool = False) -> None:
    """Print a value as JSON. JSON knows no infinities and no NaN: they become `"inf"`, `"-inf"` and null.

    A long one comes in one line, which takes a fifth of the time.
    """
    # Imported here: what is imported above is loaded by `graspsense --help`.
    from graspsense.core.json_values import json_ready

    echo_as_it_is(
        json.dumps(json_ready(value), indent=None if long else 2, ensure_ascii=False, allow_nan=False)
    )


def file_to_write(ctx: click.Context, param: click.Parameter, value: str | None) -> str | None:
    """Callback of an option that names a file: refuse a file that cannot be written, before the work and not after."""
    if value is not None and Path(value).is_dir():
        raise click.BadParameter(f"{value} is a folder: name a file in it", ctx, param)
    if value is not None and not Path(value).parent.is_dir():
        raise click.BadParameter(
            f"{value} cannot be written: there is no folder {Path(value).parent}", ctx, param
        )
    if value is not None:
        try:
            with tempfile.TemporaryFile(dir=Path(value).parent) as probe:
                probe.write(bytes(_PROBE_BYTES))
        except OSError as error:
            raise click.BadParameter(f"{value} cannot be written: {error.strerror}", ctx, param) from error
    return value


def file_to_write_as(ending: str) -> Callable[[click.Context, click.Parameter, str | None], str | None]:
    """Return the callback of an option that names a file of one format, given by its ending such as `.html`."""

    def checked(ctx: click.Context, param: click.Parameter, value: str | None) -> str | None:
        if value is not None and Path(value).suffix.lower() != ending:
            raise click.BadParameter(f"{value}: the name of the file must end in {ending}", ctx, param)
        return file_to_write(ctx, param, value)

    return checked


def refuse_existing(*paths: str | None) -> None:
    """Raise ConfigError if one of these files exists already."""
    from graspsense.core.errors import ConfigError

    for path in paths:
        if path is not None and Path(path).exists():
            raise ConfigError(f"{path} already exists: name another file, or add --overwrite to replace it")
