"""The `tsttc` command: one small module per kind of subcommand, nothing heavy imported before it is needed.

The exit codes are in `exits`.
"""

from __future__ import annotations

import io
import os
import sys

import click

from evaluator.cli import plugins
from evaluator.cli.access import login, logout, publish, quota
from evaluator.cli.boards import board
from evaluator.cli.comparisons import compare
from evaluator.cli.completion import completion
from evaluator.cli.connection import version
from evaluator.cli.conversions import convert
from evaluator.cli.exits import MEANINGS, Exit
from evaluator.cli.failures import Failure
from evaluator.cli.offline import check, manifest, truth
from evaluator.cli.own import download, list_submissions, methods, whoami, withdraw
from evaluator.cli.published import published
from evaluator.cli.receipts import receipt, verify
from evaluator.cli.scores import plot, score
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
            ctx.exit(Exit.INTERRUPTED)

    def list_commands(self, ctx: click.Context) -> list[str]:
        # In the order in which they are used, not of the alphabet; those of other packages after them.
        return [*self.commands, *(name for name in plugins.found() if name not in self.commands)]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        own = self.commands.get(cmd_name)
        if own is not None:
            return own
        point = plugins.found().get(cmd_name)
        return None if point is None else plugins.loaded(point)


def _show_version(context: click.Context, _parameter: click.Parameter, wanted: bool) -> None:
    if wanted:
        click.echo(f"tsttc {version()}")
        context.exit()


EPILOG = """\b
Examples:
  tsttc check predictions.json --manifest manifest.csv
  tsttc submit predictions.json --split val --method "Foo++" --wait

\b
Exit codes:
""" + "\n".join(f"  {code:>3}  {meaning}" for code, meaning in MEANINGS.items())


@click.group(
    cls=_Group,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog=EPILOG,
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

    check, score, plot, compare --truth, convert, manifest, truth and published need files alone; the others
    speak to the leaderboard.
    """


COMMANDS = (
    *(check, score, plot, convert, manifest, truth),
    *(login, logout, whoami, submit, status, list_submissions, methods),
    *(download, withdraw, publish, quota),
    *(board, published, compare, receipt, verify),
    completion,
)
for _command in COMMANDS:
    main.add_command(_command)
