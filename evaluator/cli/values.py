"""What the columns of a board say, whatever it is printed as."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evaluator.protocol import SCORE_NAMES

if TYPE_CHECKING:
    from evaluator.answers import BoardEntry


def authors_or_team(entry: BoardEntry, *, mark: str = " (published)") -> str:
    """The team; for a row printed in a paper its authors, and `mark`."""
    team = entry.team or ""
    if entry.kind != "published":
        return team
    first, *others = team.split(",")
    authors = f"{first.split()[-1]} et al." if others and first.split() else team
    return f"{authors}{mark}"


def texts_of(entry: BoardEntry, *, missing: str, scores: tuple[str, ...] = SCORE_NAMES) -> list[str]:
    """A submission's scores with two decimals, a published row's with as many as were printed."""
    from evaluator.report import format_published  # noqa: PLC0415 -- loads numpy, which --help can do without

    known = [value for value in entry.scores.values() if value is not None]
    is_short = entry.kind == "published" and all(round(value, 1) == value for value in known)
    decimals = 1 if is_short else 2
    return [format_published(entry.scores.get(name), decimals=decimals, missing=missing) for name in scores]
