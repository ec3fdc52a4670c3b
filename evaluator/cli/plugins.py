"""Commands of other packages: the entry points of the group `tsttc.commands`, found when they are asked for.

A package adds a command in its pyproject.toml:

    [project.entry-points."tsttc.commands"]
    name = "module:command"

A broken one is shown as such, and breaks no other.
"""

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
def found() -> dict[str, EntryPoint]:
    """The entry points by name; of two with one name the first."""
    from importlib.metadata import entry_points  # noqa: PLC0415 -- takes as long as the rest of --help

    points: dict[str, EntryPoint] = {}
    for point in entry_points(group=GROUP):
        points.setdefault(point.name, point)
    return points


def loaded(point: EntryPoint) -> click.Command:
    """The command of an entry point; for one that cannot be had, a command that says why."""
    try:
        command = point.load()
    except Exception as error:  # noqa: BLE001 -- a foreign package may fail at anything
        return _broken(point, f"{type(error).__name__}: {error}")
    if not isinstance(command, click.Command):
        return _broken(point, f"{point.value} is a {type(command).__name__}")
    return command


def _broken(point: EntryPoint, cause: str) -> click.Command:
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
