"""The table of what has changed on a board since a time."""

from collections.abc import Callable
from typing import NamedTuple

from evaluator.scoring.results import format_rounded
from leaderboard.boards import movement, snapshots
from leaderboard.boards.listing import Board
from leaderboard.boards.movement import Change
from leaderboard.boards.rows import Entry
from leaderboard.web.boards.tables import ABSENT


class ChangedRow(NamedTuple):
    """A changed row: what happened, and its rank and ranking score before and now."""

    entry: Entry
    is_new: bool
    words: str
    rank: str
    value: str


def changed_rows(board: Board) -> list[ChangedRow]:
    """Compare a board of the past with what everybody sees now."""
    edition = board.split.current_edition
    if board.at is None or edition is None:
        return []
    before = [entry for entry in board.unfiltered if entry.is_visible_to_all]
    now, name = snapshots.shown(split=board.split, edition=edition).entries, edition.rules.primary.name
    return [
        ChangedRow(
            entry=change.entry,
            is_new=change.before is None,
            words=_words(change, symbol=edition.rules.primary.symbol),
            rank=_then_now(change, lambda entry: str(entry.rank or ABSENT)),
            value=_then_now(
                change, lambda entry: format_rounded(entry.scores.get(name), decimals=entry.decimals)
            ),
        )
        for change in movement.changes(before, now)
    ]


def _words(change: Change, *, symbol: str) -> str:
    before, after = change.before, change.after
    if after is None:
        return "removed"
    if after.withdrawn_at:
        return "withdrawn"
    if before is None:
        return ""
    words = []
    if before.rank and after.rank and before.rank != after.rank:
        n_down = after.rank - before.rank
        words.append(f"down {n_down}" if n_down > 0 else f"up {-n_down}")
    if before.value != after.value:
        words.append(f"{symbol} changed")
    return ", ".join(words)


def _then_now(change: Change, text: Callable[[Entry], str]) -> str:
    texts = [text(entry) for entry in (change.before, change.after) if entry]
    return " → ".join(dict.fromkeys(texts))
