"""Cards: the pictures that links to boards and methods show elsewhere (`og:image`).

What is on a card is what everybody sees of a board. A worker draws each card once and keeps it under the
digest of what is on it: a card that no longer holds, say of a method that has become anonymous, is found by
nobody, and is removed. Until a card is drawn, pages have a picture that is the same for all.
"""

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass
from datetime import datetime
from typing import Final
from uuid import UUID

import msgspec
from django.contrib.auth.models import AnonymousUser

from evaluator.metrics.protocol import PRIMARY
from evaluator.scoring.report import format_published
from evaluator.tables.escaping import one_line
from leaderboard.boards import snapshots
from leaderboard.boards.rows import Entry, Interval
from leaderboard.models import CardPicture, Split

# Raised when the same words are drawn in another way.
DRAWING: Final = "1"
_N_ROWS: Final = 3


@dataclass(frozen=True)
class CardRow:
    """One line of a card: what stands at its left, in its middle and at its right."""

    rank: str
    name: str
    value: str


@dataclass(frozen=True)
class Card:
    """What is on a card."""

    title: str
    subtitle: str
    rows: tuple[CardRow, ...]

    @property
    def digest(self) -> str:
        """Of all that is on it, and of how it is drawn."""
        return hashlib.sha256(msgspec.json.encode([DRAWING, astuple(self)])).hexdigest()


def of_board(split: Split, entries: Sequence[Entry]) -> Card:
    """The first rows of a board; `entries` are what everybody sees, in the order of their ranks."""
    ranked = [entry for entry in entries if entry.rank is not None]
    edition = f", edition {split.published_edition.number}" if split.published_edition else ""
    count = f"{len(entries)} result{'' if len(entries) == 1 else 's'}{edition}"
    rows = (CardRow(f"{entry.rank}", one_line(entry.method), _value(entry)) for entry in ranked[:_N_ROWS])
    return Card(title=f"{split.title} board", subtitle=count, rows=tuple(rows))


def of_method(results: Sequence[tuple[Split, Entry, int]]) -> Card | None:
    """A method's place on each of its boards, with the number of ranked rows there; None without any."""
    if not results:
        return None
    entry = results[0][1]
    rows = (
        CardRow(
            f"Rank {each.rank}" if each.rank is not None else "–",
            f"of {n_ranked} on {split.title}" if each.rank is not None else f"on {split.title}",
            _value(each),
        )
        for split, each, n_ranked in results[:_N_ROWS]
    )
    return Card(title=one_line(entry.method), subtitle=f"by {one_line(entry.team)}", rows=tuple(rows))


def _value(entry: Entry) -> str:
    if entry.withdrawn_at is not None:
        return "withdrawn"
    value = entry.scores[PRIMARY]
    if value is None:
        return "no MiD"
    found = entry.intervals.get(PRIMARY, Interval())
    interval = ""
    if found.low is not None and found.high is not None:
        low, high = (format_published(end, decimals=entry.decimals) for end in (found.low, found.high))
        interval = f" ({low}–{high})"
    return f"MiD {format_published(value, decimals=entry.decimals)}{interval}"


def results_of(method_id: UUID, splits: Sequence[Split]) -> list[tuple[Split, Entry, int]]:
    """The rows of a method that everybody sees, each with its split and the number of ranked rows there."""
    return _results(splits).get(method_id, [])


def _results(splits: Sequence[Split]) -> dict[UUID, list[tuple[Split, Entry, int]]]:
    found: dict[UUID, list[tuple[Split, Entry, int]]] = {}
    for split, drawn in snapshots.shown_on(splits):
        n_ranked = sum(entry.rank is not None for entry in drawn.entries)
        for entry in drawn.entries:
            if entry.method_id is not None:
                found.setdefault(entry.method_id, []).append((split, entry, n_ranked))
    return found


def present() -> dict[str, Card]:
    """Every card that there should be now, by digest."""
    splits = snapshots.splits()
    boards = (
        of_board(split, snapshots.board(split=split, viewer=AnonymousUser()).entries) for split in splits
    )
    methods = (of_method(results) for results in _results(splits).values())
    return {card.digest: card for card in (*boards, *methods) if card is not None}


# --- keeping ---------------------------------------------------------------------------------------------


def kept(card: Card) -> bytes | None:
    """The picture of a card as PNG; None while it is not drawn."""
    found = CardPicture.objects.filter(digest=card.digest).values_list("png", flat=True).first()
    return None if found is None else bytes(found)


def missing(cards: Iterable[Card]) -> list[Card]:
    """Those of these cards that are not drawn."""
    drawn = set(CardPicture.objects.values_list("digest", flat=True))
    return [card for card in cards if card.digest not in drawn]


def keep(card: Card, png: bytes, *, now: datetime) -> None:
    """Keep the picture of a card; empty where it cannot be drawn."""
    CardPicture.objects.bulk_create(
        [CardPicture(digest=card.digest, png=png, made_at=now)], ignore_conflicts=True
    )


def remove_others(digests: Iterable[str]) -> int:
    """Remove the pictures of all other cards. Returns how many there were."""
    n_removed, _ = CardPicture.objects.exclude(digest__in=list(digests)).delete()
    return n_removed
