"""`graspsense tradeoff`: recognition, or the accuracy of the simulator, against what it costs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import click
from attrs import asdict

from graspsense.cli.experiment import experiment
from graspsense.cli.options import pipeline_options, settings_of
from graspsense.cli.output import echo_found, echo_values, json_option, page_to_write
from graspsense.cli.progress import ProgressLine
from graspsense.cli.terminal import Subcommands, echo, echo_entry
from graspsense.report.html import Page, Section, facts
from graspsense.report.write import write_html


@click.group(cls=Subcommands)
def tradeoff() -> None:
    """Measure recognition, or the accuracy of the simulator, against its cost."""


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
@click.option("--out", metavar="DIR", help="Write the page DIR/report.html as well.")
@json_option()
def simulation(
    scenes: tuple[str, ...],
    seeds: int,
    instances: int,
    out: str | None,
    **asked: Any,
) -> None:
    """Run the same grasps with several accuracies and step lengths of the simulator.

    Errors of features, peak force and force trace with ideal sensors are relative to a reference that keeps every term
    and halves its steps until nothing changes. Times are measured on the same grasps. Recognition is measured with the
    sensors of the gripper: a classifier learns grasps of each accuracy, and is tested on other grasps of the reference.
    """
    from graspsense.experiments.simulation import SCENES, simulation_table, trade_simulation
    from graspsense.experiments.simulation_recognition import conclusion, with_recognition

    page = None if out is None else page_to_write(out)
    settings = settings_of(**asked)
    wanted = scenes or ((asked["object_name"],) if asked["object_name"] else SCENES)
    first_seed = settings.run.seed
    with ProgressLine() as progress:
        trade = trade_simulation(
            settings, scenes=wanted, seeds=range(first_seed, first_seed + seeds), progress=progress
        )
        if instances:
            trade = with_recognition(trade, settings, instances=instances, progress=progress)
    words, table = conclusion(trade), simulation_table(trade)
    if page is not None:
        made = Section(id="made", title="Provenance", body=facts(list(trade.made.items())))
        sections, title = (table.section(), made), f"Accuracy of {trade.gripper} against its run time"
        write_html(page, Page(kind="Trade-off", title=title, answer=words or table.note, sections=sections))
    echo_values({**asdict(trade), "page": None if page is None else str(page)})
    echo(f"{trade.gripper}, simulated. {table.note}")
    echo(f"{', '.join(f'{key} {value}' for key, value in trade.made.items())}\n")
    echo_found(table)
    if words:
        echo(f"\n{words}")
    if page is not None:
        echo_entry("page", str(page))


EXPERIMENTS: Final[Mapping[str, tuple[str, str]]] = {
    "recognition": ("trade_recognition", "Recognition against all of these, on one page."),
    "time": ("trade_time", "Recognition against the used seconds of a grasp."),
    "force": ("trade_force", "Recognition against the probing force, and the damage it does."),
    "speed": ("trade_speed", "Recognition against the approach speed."),
    "joint": (
        "trade_joint",
        "Recognition of new bottles against approach speed, probing force, rest window and squeezes together.",
    ),
    "squeezes": ("trade_squeezes", "Recognition against the number of squeezes."),
    "sensing": ("trade_sensing", "Recognition against frame rate, noise and number of cells."),
    "physics": ("trade_physics", "Recognition against errors of the physics in the training data."),
    "accuracy": ("trade_accuracy", "Recognition against the accuracy of the simulator."),
}
"""Name to the experiment and what it measures."""


def _command(name: str, file: str, summary: str) -> click.Command:
    """Return the command for an experiment, which takes what `graspsense experiment` takes."""

    def run(**keys: Any) -> None:
        click.get_current_context().invoke(experiment, experiment=file, **keys)

    return click.Command(
        name,
        callback=run,
        params=[param for param in experiment.params if param.name != "experiment"],
        short_help=summary,
        help=f"{summary}\n\nThe same as `graspsense experiment {file}`: resumable, with a page in --out. Simulated.",
    )


for _name, (_file, _summary) in EXPERIMENTS.items():
    tradeoff.add_command(_command(_name, _file, _summary))
