"""What the columns of a board say, whatever it is printed as, and a result in one line or two."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from evaluator.protocol import SCORE_NAMES

if TYPE_CHECKING:
    from evaluator.answers import BoardEntry, Interval, Submission


def authors_or_team(entry: BoardEntry, *, mark: str = " (published)") -> str:
    """The team; for a row printed in a paper its authors, and `mark`."""
    team = entry.team or ""
    if entry.kind != "published":
        return team
    first, *others = team.split(",")
    authors = f"{first.split()[-1]} et al." if others and first.split() else team
    return f"{authors}{mark}"


def texts_of(entry: BoardEntry, *, missing: str, scores: tuple[str, ...] = SCORE_NAMES) -> list[str]:
    """A submission's scores as its edition publishes them, a published row's as they were printed."""
    from evaluator.report import format_published  # noqa: PLC0415 -- loads numpy, which --help can do without

    decimals = entry.n_decimals
    return [format_published(entry.scores.get(name), decimals=decimals, missing=missing) for name in scores]


def in_short(submission: Submission) -> Iterator[str]:
    """Where a scored submission stands, and the intervals of its two errors, each where the server knows it.

    "rank 2 (1–3)", and "MiD 14.21 (13.60–14.90), RTE 11.90 (11.20–12.60), in brackets the 95 % confidence
    intervals".
    """
    if submission.rank is not None:
        found = submission.intervals.get("mid")
        within = range_text(found.rank_low, found.rank_high) if found else ""
        would_be = "shown to everybody it would be " if submission.visibility == "PRIVATE" else ""
        yield f"{would_be}rank {submission.rank:,}{within}"
    errors = [
        text
        for name, label in (("mid", "MiD"), ("rte", "RTE"))
        if (
            text := _interval_text(
                label,
                (submission.scores or {}).get(name),
                submission.intervals.get(name),
                decimals=submission.decimals,
            )
        )
    ]
    if errors:
        yield f"{', '.join(errors)}, in brackets the 95 % confidence intervals"
    elif submission.awaits_intervals:
        yield "Intervals are being computed."


def range_text(low: int | None, high: int | None) -> str:
    """Where a row may stand, to stand behind its rank.

    >>> range_text(1, 3), range_text(1, 1), range_text(None, None)
    (' (1–3)', ' (1)', '')
    """
    if low is None or high is None:
        return ""
    return f" ({low})" if low == high else f" ({low}–{high})"


def _interval_text(label: str, value: float | None, found: Interval | None, *, decimals: int) -> str:
    from evaluator.report import format_published  # noqa: PLC0415 -- as above

    if value is None or found is None or found.low is None or found.high is None:
        return ""
    text, low, high = (format_published(each, decimals=decimals) for each in (value, found.low, found.high))
    return f"{label} {text} ({low}–{high})"
