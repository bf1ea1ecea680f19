"""`graspsense tradeoff`: speed against accuracy, measured."""

from __future__ import annotations

from typing import Any

import click

from graspsense.cli.options import pipeline_options, settings_of
from graspsense.cli.output import echo_json
from graspsense.cli.progress import ProgressLine
from graspsense.cli.subcommands import Subcommands
from graspsense.cli.terminal import echo, echo_table
from graspsense.cli.tradeoff_recognition import commands


@click.group(cls=Subcommands)
def tradeoff() -> None:
    """Measure recognition, or the accuracy of the simulator, against its cost."""


for _command in commands():
    tradeoff.add_command(_command)


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
@click.option(
    "--instances",
    type=click.IntRange(min=0),
    default=16,
    show_default=True,
    help="Individuals of each object and state, for recognition; 0: leave it out.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def simulation(
    scenes: tuple[str, ...],
    seeds: int,
    instances: int,
    as_json: bool,
    **asked: Any,
) -> None:
    """Run the same grasps with several accuracies and step lengths of the simulator.

    Errors of features, peak force and force trace with ideal sensors are relative to a reference that keeps every term
    and halves its steps until nothing changes. Times are measured on the same grasps. Recognition is measured with the
    sensors of the gripper: a classifier learns grasps of each accuracy, and is tested on other grasps of the reference.
    """
    from graspsense.experiments.simulation import SCENES, simulation_rows, trade_simulation
    from graspsense.experiments.simulation_recognition import conclusion, with_recognition

    settings = settings_of(**asked)
    wanted = scenes or ((asked["object_name"],) if asked["object_name"] else SCENES)
    first_seed = settings.run.seed
    with ProgressLine() as progress:
        trade = trade_simulation(
            settings, scenes=wanted, seeds=range(first_seed, first_seed + seeds), progress=progress
        )
        if instances:
            trade = with_recognition(trade, settings, instances=instances, progress=progress)
    if as_json:
        echo_json(trade.as_json())
        return
    made = ", ".join(f"{key} {value}" for key, value in trade.made.items())
    echo(f"{trade.gripper}, simulated: {', '.join(trade.scenes)}, {len(trade.seeds)} seeds each")
    echo(f"{made}\n")
    echo_table(*simulation_rows(trade))
    if words := conclusion(trade):
        echo(f"\n{words}")
