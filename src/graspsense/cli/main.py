"""The command `graspsense`: its subcommands from a table, and what becomes of an error.

The table holds names and import strings only, so that `--help` imports no plugin, no numpy and no command.
"""

from __future__ import annotations

import os
import re
import sys
import traceback
import warnings
from collections.abc import Sequence
from contextlib import nullcontext, suppress
from importlib import import_module
from io import TextIOWrapper
from typing import Any, Final, NoReturn

import click

from graspsense import __version__
from graspsense.cli.terminal import Style, echo, echo_as_it_is, has_colour, results_alone_on_stdout, talk
from graspsense.core.compiling.compile_notice import tell_compiling
from graspsense.core.components.caller import command_line
from graspsense.core.grasp.interrupts import ended_like_ctrl_c
from graspsense.core.values.errors import ExitCode, GraspsenseError, PluginUnavailable, exits_raise

PROGRAM: Final = "graspsense"
COMPLETION_VARIABLE: Final = "_GRASPSENSE_COMPLETE"
TRACEBACK_VARIABLE: Final = "GRASPSENSE_TRACEBACK"

COMMANDS: Final[dict[str, tuple[str, str]]] = {
    "run": ("graspsense.cli.run:run", "Perform one grasp."),
    "hold": ("graspsense.cli.hold:hold", "Hold an object with little force, without letting it slip."),
    "collect": ("graspsense.cli.collect:collect", "Collect labelled trials with an operator."),
    "replay": ("graspsense.cli.replay:replay", "Process a recording with a pipeline."),
    "recover": ("graspsense.cli.recover:recover", "Complete recordings of a killed program."),
    "verify": ("graspsense.cli.recover:verify", "Check a store or a recording for damage."),
    "trials": ("graspsense.cli.trials:trials", "List, relabel and set aside stored trials."),
    "export": ("graspsense.cli.export:export", "Export trials or a recording."),
    "import": ("graspsense.cli.import_:import_", "Import recordings of other programs."),
    "identify": ("graspsense.cli.identify:identify", "Identify an object from recorded squeezes."),
    "features": ("graspsense.cli.features:features", "Extract the features of a store again."),
    "train": ("graspsense.cli.train:train", "Train a model on labelled trials."),
    "predict": ("graspsense.cli.predict:predict", "Predict the labels of trials."),
    "evaluate": ("graspsense.cli.evaluate:evaluate", "Measure the recognition rate by cross-validation."),
    "compare": ("graspsense.cli.compare:compare", "Compare classifiers and feature sets."),
    "experiment": ("graspsense.cli.experiment:experiment", "Run or resume an experiment from a file."),
    "tradeoff": ("graspsense.cli.tradeoff:tradeoff", "Measure recognition or accuracy against cost."),
    "report": ("graspsense.cli.report:report", "Write the report page of a store or an experiment."),
    "calibrate": (
        "graspsense.cli.calibrate:calibrate",
        "Calibrate the zero, force and friction of a gripper.",
    ),
    "config": ("graspsense.cli.config:config", "Show or check the settings of a pipeline."),
    "plugins": ("graspsense.cli.plugins:plugins", "List, check, disable and create plugins."),
    "devices": ("graspsense.cli.devices:devices", "List connected grippers."),
    "doctor": ("graspsense.cli.doctor:doctor", "Diagnose plugins, permissions and devices."),
    "emulate": ("graspsense.cli.emulate:emulate", "Emulate a gripper as a device of this machine."),
    "completion": ("graspsense.cli.main:completion", "Print the completion script for a shell."),
}
"""Name to import string and summary of each command of our own."""


class Commands(click.Group):
    """The commands of the table, and those of plugins, which are loaded when one of them is called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of our own commands."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return a command. Raises UnknownName, PluginUnavailable."""
        if cmd_name in COMMANDS:
            module, _, name = COMMANDS[cmd_name][0].partition(":")
            return _with_full_texts(getattr(import_module(module), name))
        return None if ctx.resilient_parsing or cmd_name.startswith("-") else _plugin_command(cmd_name)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list of commands for the help, from the table."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, summary) for name, (_, summary) in COMMANDS.items()])

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[Any]:
        """Return the commands that begin so, without importing them."""
        from click.shell_completion import CompletionItem

        commands = [
            CompletionItem(name, help=summary)
            for name, (_, summary) in COMMANDS.items()
            if name.startswith(incomplete)
        ]
        return [*commands, *click.Command.shell_complete(self, ctx, incomplete)]


class FullText(click.types.StringParamType):
    """The text of an option that is not empty, as it is where a variable of the shell is not set."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the text, or refuse it."""
        if not str(value).strip():
            self.fail("it is empty: give a value, or leave the option out", param, ctx)
        return super().convert(value, param, ctx)


def _with_full_texts(command: click.Command) -> click.Command:
    """Return a command whose options, also those of its subcommands, take no empty text unless that is the default."""
    for param in command.params:
        if isinstance(param, click.Option) and param.type is click.STRING and param.default != "":
            param.type = FullText()
    for below in getattr(command, "commands", {}).values():
        _with_full_texts(below)
    return command


def _plugin_command(name: str) -> click.Command:
    from graspsense.core.components.entries import CommandEntry
    from graspsense.core.components.registry import installed

    resource = installed().resource(CommandEntry, name, COMMANDS)
    command = resource.load()
    if not isinstance(command, click.Command):
        raise PluginUnavailable(
            f"command {name!r} of {resource.distribution} {resource.version} cannot be used here: "
            f"{resource.entry.target} is not a click command"
        )
    return command


@click.group(
    cls=Commands,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="Plugins may add commands: see `graspsense plugins list`.",
)
@click.version_option(__version__, prog_name=PROGRAM)
@click.pass_context
def cli(ctx: click.Context) -> None:
    """Recognise grasped objects and their state by touch."""
    if ctx.invoked_subcommand is None:
        echo_as_it_is(ctx.get_help())


@click.command()
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]))
def completion(shell: str) -> None:
    """Print the completion script for a shell.

    For bash: eval "$(graspsense completion bash)", in ~/.bashrc to keep it. The same for zsh in ~/.zshrc; for
    fish: graspsense completion fish > ~/.config/fish/completions/graspsense.fish
    """
    from click.shell_completion import get_completion_class

    kind = get_completion_class(shell)
    assert kind is not None, "the choice above names shells that click knows"
    echo_as_it_is(kind(cli, {}, PROGRAM, COMPLETION_VARIABLE).source())


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run the command line and exit with its code; no argument means the process's own."""
    if isinstance(sys.stdout, TextIOWrapper) and sys.stdout.errors == "strict":
        sys.stdout.reconfigure(
            errors="backslashreplace"
        )  # as stderr: a label may have what the encoding lacks
    with ended_like_ctrl_c(), command_line(), warnings.catch_warnings():
        warnings.showwarning = _Notes()
        code = _exit_code(list(sys.argv[1:] if arguments is None else arguments))
    sys.exit(code)


def _exit_code(arguments: list[str]) -> int:
    instruction = os.environ.get(COMPLETION_VARIABLE)
    if instruction:
        from click.shell_completion import shell_complete

        return shell_complete(cli, {}, PROGRAM, COMPLETION_VARIABLE, instruction)
    tell_compiling(talk)
    try:
        with cli.make_context(PROGRAM, arguments) as ctx:
            if not has_colour(sys.stdout):
                ctx.color = False  # for the commands of plugins, which print through click
            # click prints a help itself, as do the commands of plugins.
            ours = _is_own(arguments) and not {"-h", "--help"} & set(arguments)
            with results_alone_on_stdout() if ours else nullcontext(), exits_raise():
                cli.invoke(ctx)
        if sys.stdout is None:
            echo_as_it_is(
                f"{PROGRAM}: standard output is closed, so nothing that was to be printed came out", err=True
            )
            return ExitCode.WRONG_USE
        sys.stdout.flush()
        return 0
    except click.exceptions.Exit as ended:
        return ended.exit_code
    except (
        click.exceptions.NoArgsIsHelpError
    ) as error:  # a group without a subcommand: the message is its help
        echo_as_it_is(error.format_message(), err=True)
        return ExitCode.WRONG_USE
    except (click.Abort, KeyboardInterrupt) as ended:
        with suppress(OSError):  # the terminal may have gone
            echo_as_it_is("\n  ".join(["interrupted", *getattr(ended, "__notes__", ())]), err=True)
        _flush_stdout()
        return ExitCode.INTERRUPTED
    except BrokenPipeError:
        _give_up_stdout()  # the reader of the pipe has gone
        return ExitCode.BROKEN_PIPE
    except SystemExit as error:
        if not _is_own(arguments):
            raise  # the command of a plugin may choose its exit code
        return _report(_plugin_exit(error), arguments)
    except BaseException as error:  # of a plugin, also what is no Exception
        return _report(error, arguments)


def _is_own(arguments: Sequence[str]) -> bool:
    """Return whether these are the arguments of a command of our own."""
    return next((argument for argument in arguments if not argument.startswith("-")), "") in COMMANDS


class _Notes:
    """Shows each warning of a library once as a note, without the line of its source."""

    def __init__(self) -> None:
        self._told: set[str] = set()

    def __call__(
        self, message: Warning | str, category: type[Warning], filename: str, *_place: object, **_more: object
    ) -> None:
        from graspsense.evaluation.gathered_warnings import in_words

        words = in_words(message, category, filename)
        if words not in self._told:
            self._told.add(words)
            talk(f"note: {words}")


def _plugin_exit(error: SystemExit) -> PluginUnavailable:
    """Return the error for a plugin that tried to end the program in the middle of one of our commands."""
    *_, last = traceback.extract_tb(error.__traceback__)
    unusable = PluginUnavailable(
        f"a plugin tried to end the program: SystemExit: {error.code} in {last.name}, {last.filename}:{last.lineno}. "
        "Correct the plugin, or choose another component"
    )
    unusable.__cause__ = error
    return unusable


def _report(error: BaseException, arguments: Sequence[str]) -> int:
    """Tell of an error, on stderr and with --json on stdout too, and return the exit code."""
    if isinstance(error, GraspsenseError):
        message, code = str(error), error.exit_code
    elif isinstance(error, click.ClickException):
        from graspsense.cli.wrong_use import message_of

        message, code = message_of(error), ExitCode.WRONG_USE
        if isinstance(error, click.UsageError) and error.ctx is not None:
            below = ", ".join(getattr(error.ctx.command, "commands", ()))
            message += f"\n  {error.ctx.command_path} --help shows what there is{below and f': {below}'}"
    elif isinstance(error, OSError):
        place = f": {error.filename}" if error.filename else ""
        message, code = f"{error.strerror or error}{place}", ExitCode.WRONG_USE
    else:
        message, code = f"{type(error).__name__}: {error}", ExitCode.BUG
    notes = list(getattr(error, "__notes__", ()))
    if code == ExitCode.WRONG_USE:
        from graspsense.cli.wrong_use import advice

        notes = [*advice(error, arguments), *notes]
    told = "\n  ".join([message, *notes])
    if code == ExitCode.BUG and not isinstance(error, GraspsenseError):
        told = f"internal error: {told}\n  This is a bug, {_whose(error)}."
        if os.environ.get(TRACEBACK_VARIABLE) != "1":
            told += f" Run it again with {TRACEBACK_VARIABLE}=1 to see where it happened."
    if os.environ.get(TRACEBACK_VARIABLE) == "1":
        told = "".join(traceback.format_exception(error)) + told
    with suppress(OSError):  # the terminal may have gone
        if told.startswith("Traceback"):
            echo_as_it_is(told, err=True)
        else:
            echo(f"{PROGRAM}: {told}", Style.BAD, indent=2, err=True)
    if "--json" in arguments:
        from graspsense.cli.output import echo_json

        with suppress(OSError):  # it may be what the error is about
            echo_json({"error": {"kind": type(error).__name__, "message": message, "exit_code": code}})
    _flush_stdout()
    return code


def _whose(error: BaseException) -> str:
    """Return whose bug an error is: that of the plugin whose code is nearest to it, with the place, or ours."""
    from graspsense.core.components.registry import installed

    try:
        named = [(status.module, status.distribution) for status in installed().statuses]
        named += [(part.entry.target, part.distribution) for part in installed().components()]
    except Exception:  # with GRASPSENSE_STRICT_PLUGINS, the error may be that of loading them
        named = []
    places = {}
    for name, distribution in named:
        module = sys.modules.get(re.split("[.:]", name)[0])
        file = getattr(module, "__file__", None)
        if file and module is not sys.modules["graspsense"]:
            places[os.path.dirname(file) + os.sep if hasattr(module, "__path__") else file] = distribution
    for frame in reversed(traceback.extract_tb(error.__traceback__)):
        for place, distribution in places.items():
            if frame.filename.startswith(place):
                return (
                    f"probably of the plugin {distribution}: {frame.filename}:{frame.lineno} in {frame.name}"
                )
    return "ours or a plugin's"


def _flush_stdout() -> None:
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError:
        _give_up_stdout()


def _give_up_stdout() -> None:
    """Send what is still to be flushed nowhere: the interpreter's last flush would complain of it."""
    if sys.stdout is not None:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
