"""`graspsense tradeoff`: speed against accuracy, measured."""

from __future__ import annotations

import os
from pathlib import Path

import click

from graspsense.cli.options import pipeline_options, settings_of
from graspsense.cli.output import echo_json, file_to_write
from graspsense.cli.terminal import echo, echo_table, talk
from graspsense.cli.tradeoff_recognition import commands


@click.group(short_help="Measure recognition or accuracy against cost.")
def tradeoff() -> None:
    """Measure recognition, or the accuracy of the simulator, against its cost."""


for _one in commands():
    tradeoff.add_command(_one)


@tradeoff.command(short_help="Accuracy of the simulator against its run time.")
@pipeline_options
@click.option(
    "--scene",
    "scenes",
    metavar="NAME:STATE",
    multiple=True,
    help="Object to grasp. Can be repeated.  [default: six of the catalogue]",
)
@click.option(
    "--seeds", type=click.IntRange(min=1), default=2, show_default=True, help="Grasps of each scene."
)
@click.option("--png", metavar="FILE", callback=file_to_write, help="Draw the result.")
@click.option(
    "--markdown", metavar="FILE", callback=file_to_write, help="Write the tables as a Markdown page."
)
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def simulation(
    scenes: tuple[str, ...],
    seeds: int,
    png: str | None,
    markdown: str | None,
    as_json: bool,
    pipeline: str | None,
    gripper: str | None,
    object_name: str | None,
    options: tuple[str, ...],
    seed: int | None,
    force: bool,
) -> None:
    """Run the same grasps with every scheme and fidelity of the simulator.

    Errors of features, peak force and force trace are relative to a reference that keeps every term and halves its
    steps until nothing changes. Times are measured on the same grasps.
    """
    from graspsense.cli.progress import ProgressLine
    from graspsense.experiments.simulation import SCENES, trade_simulation
    from graspsense.report.simulation import simulation_markdown, simulation_png, simulation_rows

    settings = settings_of(pipeline, gripper, object_name, options, seed, force)
    wanted = scenes or ((object_name,) if object_name else SCENES)
    first = settings.run.seed
    with ProgressLine() as progress:
        found = trade_simulation(
            settings, scenes=wanted, seeds=range(first, first + seeds), progress=progress
        )
    if png:
        simulation_png(found, Path(png))
        talk(f"drawn in {png}")
    if markdown:
        picture = os.path.relpath(png, Path(markdown).parent) if png else None
        try:
            Path(markdown).write_text(simulation_markdown(found, picture), encoding="utf-8")
        except OSError as error:
            raise click.ClickException(f"{markdown} cannot be written: {error.strerror}") from error
        talk(f"written to {markdown}")
    if as_json:
        echo_json(found.as_json())
        return
    made = ", ".join(f"{key} {value}" for key, value in found.made.items())
    echo(f"{found.gripper}, simulated: {', '.join(found.scenes)}, {len(found.seeds)} seeds each\n{made}\n")
    echo_table(*simulation_rows(found))
