"""`graspsense import`: import recordings of other programs."""

from __future__ import annotations

import click

from graspsense.cli.output import echo_json
from graspsense.cli.terminal import Style, echo


@click.command("import", short_help="Import recordings of other programs.")
@click.argument("sources", nargs=-1, required=True, metavar="FILE.csv|KIND:NAME...")
@click.option("--save", metavar="DIR", required=True, help="Store for the trials.")
@click.option("--label", metavar="CLASS:STATE", help="Label of the object: can:full_open#2.")
@click.option("--time", metavar="COLUMN", help="CSV: column of the time, in s.")
@click.option("--gap", metavar="COLUMN", help="CSV: column of the gap, in m. For mm: POS*0.001.")
@click.option(
    "--force",
    "forces",
    metavar="COLUMN",
    multiple=True,
    help="CSV: column of the force, in N. Repeat it for two pads.",
)
@click.option("--effort", metavar="COLUMN", help="CSV: column of the effort, in N.")
@click.option(
    "--velocity",
    metavar="COLUMN",
    help="CSV: column of the velocity of the gap, in m/s; negative when closing.",
)
@click.option(
    "--pipeline",
    metavar="NAME|FILE",
    default="default",
    help="Pipeline that computes the features.  [default: default]",
)
@click.option(
    "-o",
    "options",
    metavar="TABLE.KEY=VALUE",
    multiple=True,
    help="Set a key of the pipeline: -o controller.probing_force_n=17. Can be repeated.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def import_(
    sources: tuple[str, ...],
    save: str,
    label: str | None,
    time: str | None,
    gap: str | None,
    forces: tuple[str, ...],
    effort: str | None,
    velocity: str | None,
    pipeline: str,
    options: tuple[str, ...],
    as_json: bool,
) -> None:
    """Import recorded grasps as trials, each with its recording, features and label.

    A FILE.csv needs --time, --gap and --force. KIND:NAME is a file of another reader, for example rosbag:FILE.bag.
    """
    from graspsense.core.config import Flag, ImplausibleSettings, resolve
    from graspsense.core.errors import ConfigError
    from graspsense.core.plugins import installed
    from graspsense.core.wiring import check
    from graspsense.sources.grasp_csv import named
    from graspsense.sources.importing import import_recording
    from graspsense.store.labels import labels_of
    from graspsense.store.store import Store

    columns = {"time": time, "gap": gap, "effort": effort, "velocity": velocity}
    given = {what: [one] for what, one in columns.items() if one is not None}
    if forces:
        given["force"] = list(forces)
    labels = {} if label is None else labels_of(label)
    kept = []
    with Store.open(save) as store:
        for source in sources:
            csv = source.lower().endswith((".csv", ".tsv", ".txt")) and ":" not in source
            if given and not csv:
                raise click.UsageError(f"--{next(iter(given))} is for a CSV; {source} is none")
            recording = f"csv:{named(source, given)}" if csv else source
            flags = (
                Flag("--gripper", "gripper.type", "replay"),
                Flag("SOURCE", "gripper.recording", recording),
            )
            try:
                settings = resolve(pipeline, options=options, flags=flags)
            except ImplausibleSettings as error:  # whose advice, --force, names a column here
                raise ConfigError(str(error)) from None
            check(settings)
            trial, number = import_recording(store, settings, installed(), labels)
            kept.append({"source": source, "trial": number, "outcome": trial.outcome.words})
            echo(f"{source}: trial {number}, {trial.outcome.words}", indent=2, err=as_json)
            for note in trial.device.notes:
                echo(f"  {note}", Style.CAUTION, err=as_json)
    if as_json:
        echo_json({"store": save, "trials": kept})
