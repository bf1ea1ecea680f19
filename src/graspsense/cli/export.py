"""`graspsense export`: trials and recordings for other programs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from graspsense.cli.output import echo_values, json_option
from graspsense.cli.sources import named_store
from graspsense.cli.terminal import echo
from graspsense.core.components.firstparty import provider
from graspsense.core.values.errors import ConfigError


@click.command()
@click.argument("source", metavar="DIR|DIR#NUMBER|FILE.mcap", callback=named_store)
@click.option(
    "--to",
    "target",
    required=True,
    metavar="FILE",
    help="File to write. Its suffix is the format: .csv .npz .arff .parquet .mcap .toml. Or NAME:FOLDER, a data set of "
    "a plugin.",
)
@click.option(
    "--pictures", is_flag=True, help="Add the tactile images as pictures for Foxglove (.mcap of one grasp)."
)
@json_option()
def export(source: str, target: str, pictures: bool) -> None:
    """Write the trials of the store DIR as a table (.csv .npz .arff .parquet), or one recorded grasp, tick by tick.

    One grasp is a trial of a store, DIR#NUMBER, or a FILE.mcap. Its formats are .csv, .npz, .parquet,
    .mcap (a copy of the recording) and .toml (its settings). NAME:FOLDER is a data set that a plugin writes, as
    lerobot:FOLDER. Existing files are never overwritten.
    """
    from graspsense.recording import export_trace
    from graspsense.recording.reader import read_recorded
    from graspsense.sources.recordings.dataset_recordings import datasets_to_write, write_dataset
    from graspsense.store import export_table
    from graspsense.store.stored_grasps import stored_grasp

    path = Path(target)
    table = Path(source).is_dir()
    kind, _, place = target.partition(":")
    if place and (kind in datasets_to_write() or provider("data set", kind)):
        if not table or pictures:
            wrong = "--pictures is for one grasp" if table else f"{source} is not a folder"
            raise ConfigError(
                f"{target!r}: {wrong}. A data set is written from the folder of a store, without --pictures"
            )
        echo_written(target, write_dataset(kind, place, source))
        return
    writers = export_table.WRITERS if table else export_trace.WRITERS
    if path.suffix not in writers:
        what = "the table of a store" if table else "one grasp"
        sets = "".join(f", or as {name}:FOLDER" for name in datasets_to_write() if table)
        raise ConfigError(f"{target!r}: {what} can be written as {', '.join(writers)}{sets}")
    if pictures and (table or path.suffix != ".mcap"):
        raise ConfigError(
            f"{target!r}: --pictures is for one grasp as .mcap: graspsense export DIR#12 --to g.mcap --pictures"
        )
    if table:
        trials = export_table.trial_table(source)
        export_table.WRITERS[path.suffix](path, trials)
        written = {
            "trials": len(trials.features),
            "features": list(trials.features.names),
            "set_aside": trials.set_aside,
        }
    else:
        grasp = read_recorded(source) if source.endswith(".mcap") else stored_grasp(source)
        if pictures:
            export_trace.write_pictures(path, grasp)
        else:
            export_trace.WRITERS[path.suffix](path, grasp)
        written = {"ticks": len(grasp), "images": grasp.images}
        if path.suffix == ".toml":
            echo_values({"file": target, **written})
            echo(f"{target}: the settings of {source}")
            return
    echo_written(target, written)


def echo_written(target: str, written: Mapping[str, Any]) -> None:
    """Print what was written."""
    echo_values({"file": target, **written})
    counts = ("trials", "ticks", "images", "frames")
    echo(f"{target}: {', '.join(f'{written[key]} {key}' for key in counts if key in written)}")
    if written.get("set_aside"):
        echo(f"note: trials that are set aside and left out: {written['set_aside']}")
    if written.get("unreadable"):
        echo(f"note: files that cannot be read and are as they were: {written['unreadable']}")
