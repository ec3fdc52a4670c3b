"""Commands of other packages: the entry points of `tsttc.commands`. A broken one breaks no other."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Final

import click

from evaluator.cli.exits import Exit
from evaluator.cli.failures import Failure
from evaluator.cli.layout import printable

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

GROUP: Final = "tsttc.commands"


@cache
def commands() -> dict[str, EntryPoint]:
    from importlib.metadata import entry_points  # noqa: PLC0415 -- takes as long as the rest of --help

    return {point.name: point for point in entry_points(group=GROUP)}


def loaded(point: EntryPoint) -> click.Command:
    """Load an entry point's command, or a command that explains why it cannot be loaded."""
    try:
        command: click.Command = point.load()
    except Exception as error:  # noqa: BLE001 -- a foreign package may fail at anything
        cause = f"{type(error).__name__}: {error}"
    else:
        return command
    package = point.dist.name if point.dist is not None else point.value
    sentence = printable(f"The command {point.name} of the package {package} cannot be loaded ({cause}).")

    def fail(*_arguments: object) -> None:
        raise Failure(sentence, exit_code=Exit.USAGE, code="broken-command")

    return click.Command(
        point.name,
        callback=fail,
        short_help="Cannot be loaded.",
        help=sentence,
        params=[click.Argument(["arguments"], nargs=-1, type=click.UNPROCESSED, expose_value=False)],
        context_settings={"ignore_unknown_options": True},
    )
