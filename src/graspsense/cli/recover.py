"""`graspsense recover`: save what a killed program left."""

from __future__ import annotations

from pathlib import Path

import click

from graspsense.cli.output import echo_json
from graspsense.cli.sources import named_store
from graspsense.cli.terminal import echo, talk

EXIT_DAMAGED = 5


@click.command(short_help="Complete recordings of a killed program.")
@click.argument("source", metavar="DIR|FILE", callback=named_store)
@click.option("--out", metavar="FILE", help="With a FILE: file for the recovered recording.")
@click.option("--json", "as_json", is_flag=True, help="Print the result for each file as JSON.")
def recover(source: str, out: str | None, as_json: bool) -> None:
    """Complete the interrupted recordings of the store DIR, or write the readable part of a FILE to a new file.

    Nothing is deleted: the original of an interrupted recording stays as .cut. Exit code 5 means that some data could
    not be recovered.
    """
    from graspsense.store.recover import recover_file, recover_store
    from graspsense.store.store import Store

    if Path(source).is_dir():
        if out is not None:
            raise click.UsageError("--out is for a FILE; in a store everything has its place")
        with Store.open(source) as store:
            rebuilt = not store.recording_names()
            found = recover_store(store)
        if rebuilt and any(one.what == "added" for one in found):
            talk(
                "note: the database was built anew from the recordings. Labels are as recorded, and no trial is set "
                "aside: repeat the changes of `graspsense trials`"
            )
    else:
        found = [recover_file(source, out)]
    if as_json:
        echo_json({"files": [one.as_json() for one in found]})
    else:
        for one in found:
            where = f" as trial {one.trial}" if one.trial is not None else f" in {one.recording}"
            why = f": {one.why}" if one.why else ""
            echo(
                f"{one.file.name}: {one.what}{where if one.recording else ''}, {one.ticks} ticks{why}",
                indent=2,
            )
        if not found:
            echo("nothing to recover")
    if any(one.what == "failed" for one in found):
        raise click.exceptions.Exit(EXIT_DAMAGED)
