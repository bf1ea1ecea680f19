"""What `graspsense import` tells of files before they are imported: their channels, and a manifest for them."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click
from attrs import asdict

from graspsense.cli.output import echo_values
from graspsense.cli.terminal import Style, echo, echo_as_it_is, echo_entries, echo_entry, echo_rows, talk
from graspsense.core.files.whole_file import write_new
from graspsense.core.values.errors import PluginUnavailable
from graspsense.core.values.units import display_unit

if TYPE_CHECKING:
    from graspsense.sources.columns.channel_facts import ChannelFacts
    from graspsense.sources.manifest.understood import UnderstoodFile


def show_files(sources: Sequence[str], picture: str) -> bool:
    """Print what can be told of files for which neither columns nor a manifest are given, and draw the first.

    Returns False if the sources are other ones. Raises ConfigError, TooLarge, DataDamaged.
    """
    from graspsense.sources.importing.import_sources import is_plain_file
    from graspsense.sources.manifest.understood import understood_file

    if not all(map(is_plain_file, sources)):
        return False
    files = [understood_file(Path(os.path.expanduser(source))) for source in sources]
    echo_values(
        [
            {**asdict(file, filter=lambda field, _: field.name != "courses"), "path": str(file.path)}
            for file in files
        ]
    )
    for file in files:
        _echo_file(file)
    _draw(files[0], Path(picture))
    return True


def suggest_manifest(sources: Sequence[str], name: str) -> None:
    """Write a manifest for a folder or a file, and print it with what it says. Raises ConfigError, SaveFailed."""
    from graspsense.sources.manifest.suggestion import suggested_manifest

    if len(sources) != 1:
        raise click.UsageError("--suggest is for one folder with recordings, or one file")
    path, folder = Path(os.path.expanduser(name)), Path(os.path.expanduser(sources[0]))
    if path.suffix != ".toml":
        raise click.UsageError(f"--suggest {name}: a manifest is a file FILE.toml")
    suggested = suggested_manifest(folder, path.parent)
    write_new(path, suggested.text.encode())
    echo_as_it_is(suggested.text)
    talk(
        f"written to {path}, from {suggested.example}. Correct the lines that say `check`, then: graspsense import "
        f"{path} --check"
    )


def echo_channels(channels: Sequence[ChannelFacts]) -> None:
    """Print a table of channels."""
    echo()
    echo_rows(
        channels,
        {
            "CHANNEL": lambda channel: channel.name,
            "UNIT": lambda channel: display_unit(channel.unit)[0] or "unknown",
            "SAMPLES": lambda channel: str(channel.samples),
            "MISSING": lambda channel: str(channel.missing),
            "RANGE": _range,
            "RESOLUTION": lambda channel: (
                "none"
                if channel.resolution is None
                else f"{display_unit(channel.unit)[1] * channel.resolution:.3g}"
            ),
            "RATE, Hz": lambda channel: _shown(channel.rate_hz),
            "LONGEST GAP, s": lambda channel: _shown(channel.longest_gap_s),
            "AGE, s": lambda channel: _shown(channel.age_s),
        },
    )


def _range(channel: ChannelFacts) -> str:
    if channel.low is None or channel.high is None:
        return "none"
    factor = display_unit(channel.unit)[1]
    return f"{factor * channel.low:.4g} to {factor * channel.high:.4g}"


def _shown(value: float | None) -> str:
    return "unknown" if value is None else f"{value:.4g}"


def _echo_file(file: UnderstoodFile) -> None:
    echo_entry("file", str(file.path))
    echo_entries("", file.notes)
    echo_channels(file.channels)
    echo()
    if file.force:
        echo_entry("squeezes", f"{len(file.squeezes)} in {file.force}")
    else:
        echo_entry("squeezes", "no channel is known to be a force")
    for line in file.suggested:
        echo_entry("" if line is not file.suggested[0] else "most likely", line)
    echo(
        "To import it, name its columns (--time, --gap, --force), or let --suggest write a manifest for its folder"
    )


def _draw(file: UnderstoodFile, picture: Path) -> None:
    from graspsense.report.grasp_picture import channels_png

    changing = {facts.name for facts in file.channels if facts.resolution is not None}
    forces = file.force.split(", ")
    courses = {name: file.courses[name] for name in (*forces, *file.courses) if name in changing}
    try:
        channels_png(picture, courses, file.squeezes)
        talk(f"picture written to {picture}")
    except PluginUnavailable as error:
        echo(f"no picture: {error}", Style.CAUTION, err=True)
