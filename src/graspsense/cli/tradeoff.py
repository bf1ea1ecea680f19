"""`graspsense tradeoff`: speed against accuracy, measured."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from attrs import evolve

from graspsense.cli.options import pipeline_options, settings_of
from graspsense.cli.output import echo_json, file_to_write_as
from graspsense.cli.terminal import echo, echo_table, talk
from graspsense.cli.tradeoff_recognition import commands

if TYPE_CHECKING:
    from collections.abc import Mapping


@click.group()
def tradeoff() -> None:
    """Measure recognition, or the accuracy of the simulator, against its cost."""


for _command in commands():
    tradeoff.add_command(_command)


def _scenes(scenes: tuple[str, ...], asked: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the scenes to grasp: those of --scene, that of --object, or some of the catalogue."""
    from graspsense.experiments.simulation import SCENES

    return scenes or ((asked["object_name"],) if asked["object_name"] else SCENES)


scenes_option = click.option(
    "--scene",
    "scenes",
    metavar="NAME:STATE",
    multiple=True,
    help="Object to grasp. Can be repeated.  [default: six of the catalogue]",
)


markdown_option = click.option(
    "--markdown",
    metavar="FILE.md",
    callback=file_to_write_as(".md"),
    help="Write the tables as a Markdown page.",
)


@tradeoff.command(short_help="How far each feature moves for 1 ppm of a parameter.")
@pipeline_options
@scenes_option
@click.option(
    "--seeds", type=click.IntRange(min=1), default=10, show_default=True, help="Grasps of each scene."
)
@markdown_option
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def condition(
    scenes: tuple[str, ...],
    seeds: int,
    markdown: str | None,
    as_json: bool,
    **asked: Any,
) -> None:
    """Change each parameter of gripper and object by one part in a million, and measure how far features move.

    With ideal sensors, and with the sensors of the gripper. What 1 ppm moves, no accuracy of the simulator can fix in
    a single grasp.
    """
    from graspsense.cli.condition_table import conditions_markdown, print_conditions
    from graspsense.cli.progress import ProgressLine
    from graspsense.experiments.condition import conditions
    from graspsense.experiments.sensors import with_ideal_sensors

    settings = settings_of(**asked)
    wanted = _scenes(scenes, asked)
    names = [scene for scene in wanted for _ in range(seeds)]
    numbers = [settings.run.seed + k for _ in wanted for k in range(seeds)]
    ideal = with_ideal_sensors(settings.gripper)
    grippers = [ideal] if ideal.config == settings.gripper.config else [ideal, settings.gripper]
    with ProgressLine() as progress:
        measured = [
            conditions(evolve(settings, gripper=gripper), names, numbers, progress=progress)
            for gripper in grippers
        ]
    if markdown:
        write_text(markdown, conditions_markdown(measured))
    if as_json:
        echo_json([trade.as_values() for trade in measured])
        return
    echo(f"simulated: {', '.join(wanted)}, {seeds} seeds each")
    for trade in measured:
        print_conditions(trade)


@tradeoff.command(short_help="Accuracy of the simulator against its run time.")
@pipeline_options
@scenes_option
@click.option(
    "--seeds", type=click.IntRange(min=1), default=2, show_default=True, help="Grasps of each scene."
)
@click.option("--png", metavar="FILE.png", callback=file_to_write_as(".png"), help="Draw the result.")
@markdown_option
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def simulation(
    scenes: tuple[str, ...],
    seeds: int,
    png: str | None,
    markdown: str | None,
    as_json: bool,
    **asked: Any,
) -> None:
    """Run the same grasps with several accuracies and step lengths of the simulator.

    Errors of features, peak force and force trace with ideal sensors are relative to a reference that keeps every term
    and halves its steps until nothing changes. Times are measured on the same grasps. What an accuracy does to
    recognition is measured by `graspsense tradeoff accuracy`.
    """
    from graspsense.cli.progress import ProgressLine
    from graspsense.experiments.simulation import trade_simulation
    from graspsense.report.simulation import simulation_markdown, simulation_png, simulation_rows

    settings = settings_of(**asked)
    wanted = _scenes(scenes, asked)
    first_seed = settings.run.seed
    with ProgressLine() as progress:
        trade = trade_simulation(
            settings, scenes=wanted, seeds=range(first_seed, first_seed + seeds), progress=progress
        )
    # What may have taken an hour is printed before a file can fail to be written.
    if as_json:
        echo_json(trade.as_json())
    else:
        made = ", ".join(f"{key} {value}" for key, value in trade.made.items())
        echo(f"{trade.gripper}, simulated: {', '.join(trade.scenes)}, {len(trade.seeds)} seeds each")
        echo(f"{made}\n")
        echo_table(*simulation_rows(trade))
    picture = None
    if png:
        simulation_png(trade, Path(png))
        talk(f"drawn in {png}")
        picture = os.path.relpath(png, Path(markdown or png).parent)
    if markdown:
        write_text(markdown, simulation_markdown(trade, picture))


def write_text(path: str, text: str) -> None:
    """Write a page and say where it is. Raises ClickException if that is not possible."""
    from graspsense.core.files.whole_file import write_whole

    try:
        write_whole(Path(path), text.encode())
    except OSError as error:
        raise click.ClickException(f"{path} cannot be written: {error.strerror}") from error
    talk(f"written to {path}")
