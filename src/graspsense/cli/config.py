"""`graspsense config`: the settings of a pipeline, where each comes from, whether its parts fit together."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import click

from graspsense.cli.options import pipeline_options, settings_of
from graspsense.cli.output import echo_values, json_option
from graspsense.cli.terminal import Style, Subcommands, echo, echo_as_it_is
from graspsense.core.components.registry import installed
from graspsense.core.pipeline.wiring import check
from graspsense.core.settings.resolved import Settings
from graspsense.core.settings.settings_file import to_toml
from graspsense.core.values.errors import ConfigError, WiringError


@click.group(cls=Subcommands)
def config() -> None:
    """Show or check the settings of a pipeline."""


@config.command()
@click.argument("name", metavar="[PIPELINE]", required=False)
@pipeline_options
@json_option()
def show(name: str | None, **asked: Any) -> None:
    """Print every setting with its meaning, unit, range and default, and with the origin of its value.

    The origin is a default, a line of a file, or a command-line option. The output is a complete pipeline file.
    """
    settings = _settings(name, asked)
    echo_values(
        {
            "pipeline": settings.pipeline,
            "components": settings.components,
            "values": settings.values,
            "origins": settings.origins,
            "keys": {table: settings.keys(table) for table in settings.values},
        }
    )

    echo_as_it_is(to_toml(settings, origins=True), end="")


@config.command()
@click.argument("name", metavar="[PIPELINE]", required=False)
@pipeline_options
@json_option()
def validate(name: str | None, **asked: Any) -> None:
    """Check that the settings are valid and the components fit together, without opening anything."""
    from graspsense.core.pipeline.anytime import anytime_of
    from graspsense.core.pipeline.pipeline import model_for

    settings = _settings(name, asked)
    check(settings)
    notes = []
    model = None
    try:
        model = model_for(settings, installed())
    except WiringError:
        raise
    except ConfigError as error:
        notes.append(f"`collect` works with it, `run` does not yet: {error}")
    else:
        anytime_of(model, settings.features.create(), settings)
    echo_values(
        {"valid": True, "pipeline": settings.pipeline, "components": settings.components, "notes": notes}
    )
    echo(f"{settings.pipeline} is valid: {', '.join(settings.components.values())}", Style.GOOD, indent=2)
    for note in notes:
        echo(f"note: {note}", Style.CAUTION, indent=2)


def _settings(name: str | None, asked: Mapping[str, Any]) -> Settings:
    if name is not None and asked["pipeline"] is not None:
        raise click.UsageError(f"the pipeline is given twice: {name} and --pipeline {asked['pipeline']}")
    return settings_of(**{**asked, "pipeline": name if name is not None else asked["pipeline"]})
