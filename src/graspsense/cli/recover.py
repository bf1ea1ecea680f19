"""`graspsense recover` and `verify`: save what a killed program left, and tell whether what was kept is what it was."""

from __future__ import annotations

from pathlib import Path

import click

from graspsense.cli.output import echo_values, json_option
from graspsense.cli.progress import ProgressLine
from graspsense.cli.sources import named_store
from graspsense.cli.terminal import Style, echo, echo_entries, talk
from graspsense.core.values.errors import ExitCode, counted
from graspsense.store.opening import RECORDINGS


@click.command()
@click.argument("source", metavar="DIR|FILE", callback=named_store)
@click.option("--out", metavar="FILE", help="With a FILE: file for the recovered recording.")
@json_option("Print the result for each file as JSON.")
def recover(source: str, out: str | None) -> None:
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
    echo_values({"files": [trial.as_json() for trial in recovered]})
    for trial in recovered:
        echo(trial.words, indent=2)
    if not recovered:
        echo("nothing to recover")
    if any(trial.what == "failed" for trial in recovered):
        raise click.exceptions.Exit(ExitCode.DAMAGED)


@click.command()
@click.argument("source", metavar="DIR|FILE", callback=named_store)
@json_option()
def verify(source: str) -> None:
    """Check the store DIR with all its recordings, or one recording FILE.

    Exit code 5 means damage, and 2 that the disk could not be read.
    """
    from graspsense.store.verify import verify_file, verify_store

    if Path(source).is_dir():
        with ProgressLine() as progress:
            verified = verify_store(source, lambda done, total: progress("checking", done, total))
    else:
        verified = verify_file(source)
    echo_values(verified.as_json())
    echo_entries("damaged", map(str, verified.problems), Style.BAD)
    echo_entries("not read", map(str, verified.unread), Style.CAUTION)
    echo_entries("unfinished", map(str, verified.unfinished), Style.CAUTION)
    counts = (
        f"{counted(verified.trials, 'trial')}, {counted(verified.recordings, 'recording')}, "
        f"{len(verified.problems)} damaged"
    )
    counts += f", {len(verified.unread)} not read" if verified.unread else ""
    echo(counts, Style.BAD if verified.problems else Style.CAUTION if verified.unread else Style.GOOD)
    if verified.unread:
        echo(
            "nothing is known of what could not be read, which may be whole: check its permissions and the disk"
        )
    if verified.unfinished:
        echo("graspsense recover saves what is unfinished")
    if verified.problems:
        raise click.exceptions.Exit(ExitCode.DAMAGED)
    if verified.unread:
        raise click.exceptions.Exit(ExitCode.WRONG_USE)
