"""A board as a table for papers, notes and spreadsheets: LaTeX and Markdown as the site has them, and CSV."""

from __future__ import annotations

import csv
import io
from typing import TYPE_CHECKING, Final

from evaluator import layouts
from evaluator.cli.values import authors_or_team, texts_of
from evaluator.escaping import one_line
from evaluator.protocol import SCORE_NAMES

if TYPE_CHECKING:
    from evaluator.answers import Board

# A spreadsheet takes a cell that begins like this for a formula and runs it; the wide forms as well.
_FORMULA_STARTS: Final = tuple("=+-@＝＋－＠")


def as_csv(board: Board) -> str:
    """One line for each entry; numbers as they are published, empty where there is none."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["rank", "method", "team", "date", "kind", *SCORE_NAMES])
    for entry in board.entries:
        texts = [_guarded(text or "") for text in (entry.method, entry.team, entry.date)]
        rank = "" if entry.rank is None else str(entry.rank)
        writer.writerow([rank, *texts, entry.kind, *texts_of(entry, missing="")])
    return out.getvalue()


def as_latex(board: Board) -> str:
    """A `tabular` for the package booktabs; the best of a column is bold, the second underlined."""
    return layouts.as_latex(_rows(board), about=_about(board))


def as_markdown(board: Board) -> str:
    """A table of GitHub's Markdown; the best of a column is bold, the second italic."""
    return layouts.as_markdown(_rows(board), about=_about(board))


def _guarded(text: str) -> str:
    """`text` on one line that no spreadsheet takes for a formula, and no terminal for an order.

    >>> _guarded("=1+1"), _guarded("Foo++")
    ("'=1+1", 'Foo++')
    """
    line = one_line(text)
    return f"'{line}" if line.lstrip().startswith(_FORMULA_STARTS) else line


def _rows(board: Board) -> list[layouts.Row]:
    from evaluator.ranking import best_and_second  # noqa: PLC0415 -- only once there is a board to mark

    marks = [best_and_second([entry.scores.get(name) for entry in board.entries]) for name in SCORE_NAMES]
    return [
        layouts.Row(
            rank=layouts.ABSENT if entry.rank is None else str(entry.rank),
            method=entry.method,
            team=authors_or_team(entry, mark=""),
            cells=tuple(
                layouts.Cell(text=text, is_best=i in best, is_second=i in second)
                for text, (best, second) in zip(texts_of(entry, missing=layouts.ABSENT), marks, strict=True)
            ),
        )
        for i, entry in enumerate(board.entries)
        if entry.withdrawn_at is None
    ]


def _about(board: Board) -> list[str]:
    edition = f", edition {board.edition}" if board.edition is not None else ""
    updated = f", updated {board.updated}" if board.updated else ""
    return [f"TSTTC leaderboard, {board.split}{edition}{updated}"]
