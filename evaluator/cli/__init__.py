"""The `tsttc` command: one module per kind of subcommand, nothing heavy imported before it is needed."""

from __future__ import annotations

import errno
import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any, Final

import click

import evaluator
from evaluator.cli import plugins
from evaluator.cli.exits import MEANINGS, Exit
from evaluator.cli.failures import Failure

__all__ = ["main"]

COMMANDS: Final = {
    "check": "offline:check",
    "score": "scores:score",
    "plot": "scores:plot",
    "convert": "conversions:convert",
    "manifest": "offline:manifest",
    "truth": "offline:truth",
    "login": "access:login",
    "logout": "access:logout",
    "whoami": "own:whoami",
    "submit": "submissions:submit",
    "status": "submissions:status",
    "submissions": "own:list_submissions",
    "methods": "own:methods",
    "download": "own:download",
    "withdraw": "own:withdraw",
    "move": "own:move",
    "publish": "access:publish",
    "quota": "access:quota",
    "board": "boards:board",
    "published": "published:published",
    "compare": "comparisons:compare",
    "receipt": "receipts:receipt",
    "verify": "receipts:verify",
    "completion": "completion:completion",
}
"""Each command in the order of the help, with its module here and its name there; imported when used."""


DISK_FAULTS: Final = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EIO})


@contextmanager
def _quiet_without_a_reader() -> Iterator[None]:
    """End as other programs do where `head` has read enough: silently, and not as the file's fault."""
    try:
        yield
    except BrokenPipeError:
        _discard_the_rest()
        sys.exit(Exit.CLOSED)


def _discard_the_rest() -> None:
    # What is still buffered would fail once more when Python ends.
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.__stdout__.fileno() if sys.__stdout__ else 1)


class _Group(click.Group):
    """The group `tsttc`: words failures, handles Ctrl-C, replaces characters that a terminal lacks."""

    def main(self, *args: Any, **extra: Any) -> Any:
        try:
            return super().main(*args, **extra)
        except OSError as error:
            if error.errno not in DISK_FAULTS or error.filename is not None:
                raise
            _discard_the_rest()
            click.echo(f"Error: Standard output cannot be written: {error.strerror}.", err=True)
            sys.exit(Exit.USAGE)

    def make_context(self, *args: Any, **extra: Any) -> click.Context:
        with _quiet_without_a_reader():
            return super().make_context(*args, **extra)

    def invoke(self, ctx: click.Context) -> object:
        with _quiet_without_a_reader():
            return self._invoke(ctx)

    def _invoke(self, ctx: click.Context) -> object:
        for stream in (sys.stdout, sys.stderr):
            if isinstance(stream, io.TextIOWrapper):
                stream.reconfigure(errors="replace")
        if os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb":
            ctx.color = False
        try:
            return super().invoke(ctx)
        except Failure as failure:
            failure.show()
            ctx.exit(failure.exit_code)
        except click.BadParameter as fault:
            if not isinstance(fault, click.MissingParameter):
                fault.ctx = None  # the value is at fault, not the form of the call: no usage lines
            raise
        except KeyboardInterrupt:
            click.echo("Interrupted.", err=True)
            ctx.exit(Exit.INTERRUPTED)

    def list_commands(self, ctx: click.Context) -> list[str]:
        # In the order in which they are used, not of the alphabet; those of other packages after them.
        return [*COMMANDS, *(name for name in plugins.commands() if name not in COMMANDS)]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name in COMMANDS:
            return _imported(cmd_name)
        point = plugins.commands().get(cmd_name)
        return None if point is None else plugins.loaded(point)


def _imported(command: str) -> click.Command:
    module, _, name = COMMANDS[command].partition(":")
    click_command: click.Command = getattr(import_module(f"evaluator.cli.{module}"), name)
    return click_command


def own_commands() -> dict[str, click.Command]:
    return {name: _imported(name) for name in COMMANDS}


def _show_version(context: click.Context, _parameter: click.Parameter, wanted: bool) -> None:
    if wanted:
        click.echo(f"tsttc {evaluator.__version__}")
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

    check, score, plot, compare --truth, convert, manifest, truth and published work offline; the other
    commands contact the leaderboard.
    """
