"""The `tsttc` command: one small module per kind of subcommand, nothing heavy imported before it is needed.

Exit codes: 0 good, 1 the file is at fault, 2 the command was called wrongly, 3 the server.
"""

from __future__ import annotations

import io
import os
import sys

import click

from evaluator.cli.connection import version
from evaluator.cli.failures import INTERRUPTED, Failure
from evaluator.cli.offline import check, manifest, score
from evaluator.cli.standings import board
from evaluator.cli.submissions import status, submit

__all__ = ["main"]


class _Group(click.Group):
    """Words failures, ends plainly on Ctrl-C, and does without characters that a terminal lacks."""

    def invoke(self, ctx: click.Context) -> object:
        for stream in (sys.stdout, sys.stderr):
            if isinstance(stream, io.TextIOWrapper):
                stream.reconfigure(errors="replace")
        if os.environ.get("NO_COLOR"):
            ctx.color = False
        try:
            return super().invoke(ctx)
        except Failure as failure:
            failure.show()
            ctx.exit(failure.exit_code)
        except KeyboardInterrupt:
            click.echo("Interrupted.", err=True)
            ctx.exit(INTERRUPTED)

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(self.commands)  # in the order in which they are used, not of the alphabet


def _show_version(context: click.Context, _parameter: click.Parameter, wanted: bool) -> None:
    if wanted:
        click.echo(f"tsttc {version()}")
        context.exit()


@click.group(
    cls=_Group,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="Exit codes: 0 good, 1 the file is at fault, 2 wrong usage, 3 the server.",
)
@click.option(
    "--version",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_show_version,
    help="Show the version and exit.",
)
def main() -> None:
    """Check, score and submit time-to-contact predictions for the TSTTC benchmark.

    check, score and manifest need files alone; submit, status and board speak to the leaderboard.
    """


for _command in (check, score, manifest, submit, status, board):
    main.add_command(_command)
