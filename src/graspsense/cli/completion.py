"""`graspsense completion`: the script that makes a shell complete our commands and options."""

from __future__ import annotations

import click
from click.shell_completion import get_completion_class

from graspsense.cli.main import COMPLETION_VARIABLE, PROGRAM, cli
from graspsense.cli.terminal import echo_as_it_is


@click.command()
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]))
def completion(shell: str) -> None:
    """Print the completion script for a shell.

    For bash: eval "$(graspsense completion bash)", in ~/.bashrc to keep it. The same for zsh in ~/.zshrc; for
    fish: graspsense completion fish > ~/.config/fish/completions/graspsense.fish
    """
    kind = get_completion_class(shell)
    assert kind is not None, "the choice above names shells that click knows"
    echo_as_it_is(kind(cli, {}, PROGRAM, COMPLETION_VARIABLE).source())
