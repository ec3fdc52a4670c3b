"""How the command line fails: one exception with an exit code, in words and, with --json, as a document."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import click

from evaluator.cli.exits import Exit
from evaluator.cli.layout import printable
from evaluator.problems import Problem, Rejected, n_problems_in_words


class Failure(Exception):
    """The end of a command: message, problems of the file, next step, and `document` for --json."""

    def __init__(
        self,
        message: str,
        *,
        exit_code: Exit,
        code: str,
        problems: Sequence[Problem] = (),
        n_problems: int | None = None,
        hint: str = "",
        document: dict[str, Any] | None = None,
        more: Mapping[str, Any] | None = None,
    ) -> None:
        super().__init__(message)
        self.message = message
        self.exit_code = exit_code
        self.problems = tuple(problems)
        self.hint = hint
        context = click.get_current_context(silent=True)  # gone by the time that show() is called
        self.as_json = bool(context and context.params.get("as_json"))
        self.document = document or {
            "title": message,
            "code": code,
            **Rejected(self.problems, n_problems=n_problems).as_dict(),
            **(more or {}),
        }

    def show(self) -> None:
        """Print the message on standard error, with --json also the document on standard output."""
        click.echo(f"Error: {printable(self.message)}", err=True)
        for line in numbered(self.problems):
            click.echo(line, err=True)
        if self.hint:
            click.echo(self.hint, err=True)
        if self.as_json:
            echo_json(self.document)


def rejected(name: str, fault: Rejected, *, hint: str = "") -> Failure:
    return Failure(
        f"{name} is rejected: {n_problems_in_words(fault.n_problems, n_lines=len(fault.problems))}",
        exit_code=Exit.REJECTED,
        code="rejected",
        problems=fault.problems,
        n_problems=fault.n_problems,
        hint=hint,
    )


def numbered(problems: Sequence[Problem]) -> Iterator[str]:
    for number, problem in enumerate(problems, start=1):
        yield f"{number:>3}. {printable(str(problem))}"


def echo_json(document: object) -> None:
    click.echo(json.dumps(document, ensure_ascii=False, indent=2))
