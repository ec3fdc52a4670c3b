"""What `tsttc submit` asks before a file is sent that may cost a slot for nothing."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import click

from evaluator.cli.exits import Exit
from evaluator.cli.failures import Failure
from evaluator.problems import FileWarning


@dataclass(frozen=True, kw_only=True)
class Doubts:
    """Warnings about a file, and the method whose name a new one resembles; both are on the screen."""

    warnings: Sequence[FileWarning]
    similar_method: str | None

    @property
    def sentence(self) -> str:
        """Say in a few words what makes a question of it; empty without a doubt."""
        parts = ["the file has a warning"] if self.warnings else []
        parts += ["the method's name is new, and like another one"] if self.similar_method else []
        return " and ".join(parts)


def require(doubts: Doubts, *, notice: str, yes: bool) -> None:
    """Ask on a terminal; in a job, refuse a file in doubt. Raises `Failure` unless the file may be sent.

    `notice` says who will see the results, if others do: it alone is asked about on a terminal only.
    """
    if yes or not (doubts.sentence or notice):
        return
    is_terminal = sys.stdin.isatty()
    if not is_terminal and not doubts.sentence:
        return
    if is_terminal and click.confirm("Submit anyway?" if doubts.sentence else "Submit?", err=True):
        return
    message = "Nothing was submitted."
    if not is_terminal:
        message = f"Nothing was submitted: {doubts.sentence}."
    raise Failure(
        message,
        exit_code=Exit.UNCONFIRMED if doubts.sentence else Exit.USAGE,
        code="not-confirmed",
        hint="" if is_terminal else "To submit the file all the same, add --yes.",
        more={"warnings": [asdict(warning) for warning in doubts.warnings]},
    )
