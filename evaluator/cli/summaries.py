"""`--summary FILE`: what became of a submission, as Markdown for the summary page of a CI job."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from evaluator.cli.failures import Failure
from evaluator.cli.gates import Verdict
from evaluator.cli.layout import NO_VALUE, short_name, units
from evaluator.cli.values import rank_in_words
from evaluator.metrics.protocol import split_name
from evaluator.tables.escaping import markdown, markdown_address

if TYPE_CHECKING:
    from evaluator.client.answers import Submission

_WORDS = {True: "**fails**", False: "passes", None: "**cannot be evaluated**"}


@dataclass
class Summary:
    """What is known so far: the submission with its address, and what the gates say."""

    named: str
    submission: Submission | None = None
    address: str = ""
    verdicts: Sequence[Verdict] = ()


@contextmanager
def summarised(path: Path | None, *, named: str) -> Iterator[Summary]:
    """Append what the block learns of a submission to `path` at its end, also when it raises Failure."""
    summary, failure = Summary(named), None
    try:
        yield summary
    except Failure as raised:
        failure = raised
        raise
    finally:
        if path is not None:
            _append(path, "".join(f"{line}\n" for line in lines_of(summary, failure)))


def _append(path: Path, text: str) -> None:
    try:
        with path.open("a", encoding="utf-8") as file:
            file.write(text)
    except OSError as error:  # the exit code is the result's
        click.echo(f"Warning: the summary {path} cannot be written: {error.strerror}.", err=True)


def lines_of(summary: Summary, failure: Failure | None) -> Iterator[str]:
    """The summary as lines of Markdown."""
    submission = summary.submission
    yield f"### {markdown(summary.named)}: {submission.state if submission else 'not submitted'}"
    yield ""
    if failure is not None:
        yield f"**{markdown(failure.message)}**"
        yield ""
        for number, problem in enumerate(failure.problems, start=1):
            yield f"{number}. {markdown(str(problem))}"
        if failure.problems:
            yield ""
        if failure.hint:
            yield from (markdown(failure.hint), "")
    if submission is not None and submission.scores is not None:
        yield from _scores(submission)
        yield from _gates(summary.verdicts)
    for warning in submission.warnings if submission is not None else ():
        yield from (f"Warning: {markdown(warning.message)}", "")
    if summary.address:
        yield from (f"Submission: {markdown_address(summary.address)}", "")


def _gates(verdicts: Sequence[Verdict]) -> Iterator[str]:
    for verdict in verdicts:
        gate = verdict.gate.replace("`", "")
        yield f"- `{gate}` {_WORDS[verdict.is_failing]}: {markdown(verdict.reason)}"
    if verdicts:
        yield ""


def _scores(submission: Submission) -> Iterator[str]:
    if rank := rank_in_words(submission):
        yield from (f"{rank[:1].upper()}{rank[1:]}", "")
    yield from _table(submission)
    yield from ("", units(submission.scores or {}), "")


def _table(submission: Submission) -> Iterator[str]:
    """The scores with their intervals and counts."""
    from evaluator.scoring.results import format_rounded  # noqa: PLC0415 -- loads numpy, which --help can do without

    scores, counts = submission.scores or {}, submission.counts or {}

    def text(value: float | None) -> str:
        return format_rounded(value, decimals=submission.decimals, missing=NO_VALUE)

    ends = [submission.intervals.get(name) for name in scores]
    low_high = [NO_VALUE if e is None or e.low is None else f"{text(e.low)}–{text(e.high)}" for e in ends]
    n_behind = [counts.get(split_name(name)[1]) for name in scores]
    rows = [
        ["", *map(short_name, scores)],
        ["---", *("---:" for _ in scores)],
        ["error", *map(text, scores.values())],
        *([["95%", *low_high]] if set(low_high) != {NO_VALUE} else []),
        ["count", *(NO_VALUE if n is None else f"{n:,}" for n in n_behind)],
    ]
    for row in rows:
        yield f"| {' | '.join(row)} |"
