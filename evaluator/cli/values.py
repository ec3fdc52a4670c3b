"""Cells of a board as text, and a result in one line or two."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

from evaluator.cli.layout import printable
from evaluator.metrics.protocol import OVERALL, metric_of, primary_of, split_name
from evaluator.tables import layouts

if TYPE_CHECKING:
    from evaluator.client.answers import BoardEntry, ConfidenceInterval, Submission


def authors_or_team(entry: BoardEntry) -> str:
    team = entry.team or ""
    return f"{layouts.short_authors(team)} (published)" if entry.kind == "published" else team


def overall_of(names: Iterable[str]) -> list[str]:
    return [name for name in dict.fromkeys(names) if split_name(name)[1] == OVERALL]


def texts_of(entry: BoardEntry, *, missing: str, scores: Sequence[str]) -> list[str]:
    from evaluator.scoring.results import format_rounded  # noqa: PLC0415 -- loads numpy, which --help can do without

    decimals = entry.decimals
    return [format_rounded(entry.scores.get(name), decimals=decimals, missing=missing) for name in scores]


def state_in_words(submission: Submission) -> str:
    words = printable(submission.state)
    if submission.withdrawn_at:
        words += ", withdrawn"
    if submission.queue is not None and submission.state == "QUEUED":
        words += f", {submission.queue.ahead:,} ahead"
    return words


def rank_in_words(submission: Submission) -> str:
    """The rank of a scored submission with its rank range; empty if it has none."""
    if submission.rank is None:
        return ""
    interval = submission.intervals.get(primary_of(submission.scores or {}))
    low, high = (interval.rank_low, interval.rank_high) if interval else (None, None)
    would_be = "if published: " if submission.visibility == "PRIVATE" else ""
    return f"{would_be}rank {layouts.rank_text(submission.rank, low=low, high=high)}"


def in_short(submission: Submission) -> Iterator[str]:
    if rank := rank_in_words(submission):
        yield rank
    errors = [
        text
        for name in overall_of(submission.scores or {})
        if (
            text := _interval_text(
                metric_of(name).symbol,
                (submission.scores or {}).get(name),
                submission.intervals.get(name),
                decimals=submission.decimals,
            )
        )
    ]
    if errors:
        yield f"{', '.join(errors)}, in brackets the 95% confidence intervals"
    elif submission.awaits_intervals:
        yield "The confidence intervals are being computed."


def _interval_text(
    label: str, value: float | None, interval: ConfidenceInterval | None, *, decimals: int
) -> str:
    from evaluator.scoring.results import format_rounded  # noqa: PLC0415 -- as above

    if value is None or interval is None or interval.low is None or interval.high is None:
        return ""
    text, low, high = (
        format_rounded(each, decimals=decimals) for each in (value, interval.low, interval.high)
    )
    return f"{label} {text} ({low}–{high})"
