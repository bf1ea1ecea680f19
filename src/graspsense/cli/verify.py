"""`graspsense verify`: whether what was kept is there and is what it was."""

from __future__ import annotations

from pathlib import Path

import click

from graspsense.cli.output import echo_json
from graspsense.cli.progress import ProgressLine
from graspsense.cli.sources import named_store
from graspsense.cli.terminal import Style, echo, echo_entries
from graspsense.core.values.errors import ExitCode, counted


@click.command()
@click.argument("source", metavar="DIR|FILE", callback=named_store)
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def verify(source: str, as_json: bool) -> None:
    """Check the store DIR with all its recordings, or one recording FILE.

    Exit code 5 means damage, and 2 that the disk could not be read.
    """
    from graspsense.store.verify import verify_file, verify_store

    if Path(source).is_dir():
        with ProgressLine() as progress:
            verified = verify_store(source, lambda done, total: progress("checking", done, total))
    else:
        verified = verify_file(source)
    if as_json:
        echo_json(verified.as_json())
    else:
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
