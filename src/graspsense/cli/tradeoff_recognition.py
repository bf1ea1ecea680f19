"""`graspsense tradeoff time|force|speed|...`: recognition against what it costs, each an experiment that is shipped."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import click

from graspsense.cli.experiment import experiment

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


def commands() -> list[click.Command]:
    """Return a command for each, which takes what `graspsense experiment` takes."""
    return [_command(name, file, summary) for name, (file, summary) in EXPERIMENTS.items()]


def _command(name: str, file: str, summary: str) -> click.Command:
    def run(**keys: Any) -> None:
        click.get_current_context().invoke(experiment, experiment=file, **keys)

    return click.Command(
        name,
        callback=run,
        params=[param for param in experiment.params if param.name != "experiment"],
        short_help=summary,
        help=f"{summary}\n\nThe same as `graspsense experiment {file}`: resumable, with a page in --out. Simulated.",
    )
