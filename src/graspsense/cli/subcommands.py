"""A command with subcommands, such as `graspsense trials`."""

from __future__ import annotations

import click


class Subcommands(click.Group):
    """A group whose help has the whole first sentence of each subcommand; click cuts it to one line."""

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list of subcommands for the help."""
        with formatter.section("Commands"):
            formatter.write_dl(
                [(name, self.commands[name].get_short_help_str(10_000)) for name in self.list_commands(ctx)]
            )
