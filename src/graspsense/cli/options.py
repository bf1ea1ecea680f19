"""The options by which every command that needs a pipeline is told which one."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import Any, Final

import click

from graspsense.cli.output import CommandT, file_to_write
from graspsense.core.settings.layers import Flag
from graspsense.core.settings.resolved import Settings, resolve
from graspsense.report.write import require_matplotlib

DEFAULT_PIPELINE: Final = "default"
SEED: Final = click.IntRange(0, 2**32 - 1)
"""The seeds of trials and folds; simulated trials have seeds of their own, up to a million times as large."""
GRIPPER_ALONE: Final = ("classifier.type=none",)
"""Before the options of a command that is about the gripper: a classifier that is missing must not stop it."""


class Finite(click.FloatRange):
    """A number in a range; NaN is none, which a range of click takes."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the number, or refuse it."""
        number = float(super().convert(value, param, ctx))
        if number != number:
            self.fail(f"{number} is not a number", param, ctx)
        return number


def time_range(longest_s: float | None = None) -> Finite:
    """Return the type of an option that takes a time above 0 s, at most `longest_s`."""
    return Finite(0.0, longest_s, min_open=True)


def timeout_option(default_s: float, text: str) -> Callable[[CommandT], CommandT]:
    """Return the decorator that adds --timeout, a time for each plugin; `text` says what of."""
    kind, text = time_range(), f"{text} for each plugin, in seconds."
    return click.option("--timeout", "timeout_s", type=kind, default=default_s, show_default=True, help=text)


def option_group(*options: Callable[[Any], Any]) -> Callable[[CommandT], CommandT]:
    """Return the decorator that adds these options, in their order."""

    def add(command: CommandT) -> CommandT:
        for option in reversed(options):
            command = option(command)
        return command

    return add


def keys_option(
    text: str, metavar: str = "TABLE.KEY=VALUE", *, required: bool = False
) -> Callable[[CommandT], CommandT]:
    """Return the decorator that adds -o, which can be repeated; `text` says what it sets."""
    return click.option(
        "-o", "options", metavar=metavar, multiple=True, required=required, help=f"{text} Can be repeated."
    )


def target_option(text: str) -> Callable[[CommandT], CommandT]:
    """Return the decorator that adds --target; `text` says what it is good for."""
    targets = click.Choice(["both", "class", "state"])
    return click.option("--target", type=targets, default="both", show_default=True, help=text)


def pipeline_option(text: str, default: str | None = DEFAULT_PIPELINE) -> Callable[[CommandT], CommandT]:
    """Return the decorator that adds --pipeline; `text` says what it is for."""
    return click.option("--pipeline", metavar="NAME|FILE", default=default, help=text)


force_option = click.option("--force", is_flag=True, help="Accept settings outside of their plausible range.")
pipeline_options = option_group(
    pipeline_option(f"Name of a pipeline, or a .toml file.  [default: {DEFAULT_PIPELINE}]", default=None),
    click.option("--gripper", metavar="NAME", help="Gripper: sim, pr2, replay, ... (gripper.type)"),
    click.option(
        "--object",
        "object_name",
        metavar="NAME:STATE",
        help="Object of a simulated gripper: odwalla:full_open. (gripper.object)",
    ),
    keys_option("Set any other key: -o controller.probing_force_n=17."),
    click.option("--seed", type=int, help="Seed of all random numbers. (run.seed)"),
    force_option,
)
"""The options whose values are what `settings_of` takes."""


def _picture_to_write(ctx: click.Context, param: click.Parameter, value: str | None) -> str | None:
    if value is not None:
        require_matplotlib()
    return file_to_write(".png")(ctx, param, value)


plot_option = click.option(
    "--plot",
    metavar="FILE.png",
    callback=_picture_to_write,
    help="Draw the grasp: forces, gap, phases, features, prediction.",
)
"""The picture of a grasp, which is refused before the grasp if it cannot be drawn or written."""


def sets_key(options: Sequence[str], key: str) -> bool:
    """Return whether an option -o gives this key."""
    return any(option.partition("=")[0].strip() == key for option in options)


def names_object(object_name: str | None, options: Sequence[str]) -> bool:
    """Return whether these options say which object a simulated gripper holds."""
    return object_name is not None or sets_key(options, "gripper.object")


def typed() -> list[str]:
    """Return the names of the parameters of the running command that the user has typed, in their order."""
    context, by_user = click.get_current_context(), click.core.ParameterSource.COMMANDLINE
    names = [str(param.name) for param in context.command.params]
    return [name for name in names if context.get_parameter_source(name) is by_user]


def dashed(name: str) -> str:
    """Return an option as it is typed, given the name of its parameter."""
    return f"--{name.replace('_', '-')}"


def refuse_typed(names: Collection[str], why: str) -> None:
    """Raise UsageError for an option among these that the user has typed: `--png` and why not."""
    for name in typed():
        if name in names:
            raise click.UsageError(f"{dashed(name)} {why}", click.get_current_context())


def contradiction(settings: Settings, label: str) -> click.UsageError:
    """Return the error for a label that contradicts the object of a simulated gripper."""
    return click.UsageError(
        f"the label {label} contradicts the object {settings.held}, which this simulated gripper is told to hold. An "
        "object that it knows has its own name as the label; one from a file has any other name, as in my-cup#1. Or "
        "leave out --object to grasp what the label says"
    )


def settings_of(
    pipeline: str | None = None,
    gripper: str | None = None,
    object_name: str | None = None,
    options: Sequence[str] = (),
    seed: int | None = None,
    force: bool = False,
) -> Settings:
    """Return the settings that these options ask for. Raises ConfigError with every error at once."""
    flags = (
        Flag("--gripper", "gripper.type", gripper),
        Flag("--object", "gripper.object", object_name),
        Flag("--seed", "run.seed", seed),
    )
    return resolve(
        pipeline if pipeline is not None else DEFAULT_PIPELINE,
        options=options,
        flags=flags,
        force=force,
    )
