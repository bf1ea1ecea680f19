"""`graspsense verify`: whether what was kept is there and is what it was."""

from __future__ import annotations

from pathlib import Path

import click

from graspsense.cli.output import echo_json
from graspsense.cli.terminal import Style, echo, echo_entry

EXIT_DAMAGED = 5


@click.command(short_help="Check a store or a recording for damage.")
@click.argument("source", metavar="DIR|FILE")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def verify(source: str, as_json: bool) -> None:
    """Check the store DIR with all its recordings, or one recording FILE. Exit code 5 means damage."""
    from graspsense.cli.progress import ProgressLine
    from graspsense.store.verify import verify_file, verify_store

    if Path(source).is_dir():
        with ProgressLine() as progress:
            found = verify_store(source, lambda done, total: progress("checking", done, total))
    else:
        found = verify_file(source)
    if as_json:
        echo_json(found.as_json())
    else:
        for problem in found.problems:
            echo_entry("damaged", str(problem), Style.BAD)
        for one in found.unfinished:
            echo_entry("unfinished", str(one), Style.CAUTION)
        counts = f"{found.trials} trials, {found.recordings} recordings, {len(found.problems)} damaged"
        echo(counts, Style.BAD if found.problems else Style.GOOD)
        if found.unfinished:
            echo("graspsense recover saves what is unfinished")
    if found.problems:
        raise click.exceptions.Exit(EXIT_DAMAGED)
