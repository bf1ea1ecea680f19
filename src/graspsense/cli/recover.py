"""`graspsense recover`: save what a killed program left."""

from __future__ import annotations

from pathlib import Path

import click

from graspsense.cli.output import echo_json
from graspsense.cli.sources import named_store
from graspsense.cli.terminal import echo, talk
from graspsense.core.values.errors import ExitCode
from graspsense.store.opening import RECORDINGS


@click.command()
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
        if not (Path(source) / RECORDINGS).is_dir():
            Store.read(source).close()
        with Store.open(source) as store:
            rebuilt = not store.recording_names()
            recovered = recover_store(store)
        if rebuilt and any(trial.what == "added" for trial in recovered):
            talk(
                "note: the database was built anew from the recordings. Labels are as recorded, and no trial is set "
                "aside: repeat the changes of `graspsense trials`"
            )
    else:
        recovered = [recover_file(source, out)]
    if as_json:
        echo_json({"files": [trial.as_json() for trial in recovered]})
    else:
        for trial in recovered:
            where = f" as trial {trial.trial}" if trial.trial is not None else f" in {trial.recording}"
            why = f": {trial.why}" if trial.why else ""
            echo(
                f"{trial.file.name}: {trial.what}{where if trial.recording else ''}, {trial.ticks} ticks{why}",
                indent=2,
            )
        if not recovered:
            echo("nothing to recover")
    if any(trial.what == "failed" for trial in recovered):
        raise click.exceptions.Exit(ExitCode.DAMAGED)
