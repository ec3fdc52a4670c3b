"""What happened last, on all boards: editions that were published or rolled back, and new entries."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from django.urls import reverse

from evaluator.metrics.protocol import PRIMARY
from evaluator.scoring.report import format_published
from leaderboard.boards import snapshots
from leaderboard.boards.rows import Entry
from leaderboard.editions import history
from leaderboard.exports import feeds
from leaderboard.models import Publication, Split
from leaderboard.web.boards import edition_tables

N_NEWS: Final = 5


@dataclass(frozen=True)
class NewsItem:
    """One thing that happened: `name` is a link to `href`, `words` go on."""

    at: datetime
    name: str
    href: str
    words: str


def latest(splits: Sequence[Split]) -> list[NewsItem]:
    """The newest first, of these splits; what everybody sees of them, under the names that everybody sees."""
    items = [*_editions(), *_entries(splits)]
    return sorted(items, key=lambda item: (item.at, item.href), reverse=True)[:N_NEWS]


def _editions() -> Iterator[NewsItem]:
    for publication in history.latest_changes(N_NEWS):
        split, edition = publication.split, publication.edition
        yield NewsItem(
            at=publication.at,
            name=f"{split.title}, edition {edition.number}",
            href=reverse("edition", args=[split.pk, edition.number]),
            words=_change(publication),
        )


def _change(publication: Publication) -> str:
    former = publication.replaced
    if former is None:
        return "published"
    if publication.kind == Publication.Kind.ROLLED_BACK:
        return f"current again: edition {former.number} was rolled back"
    change = edition_tables.change_words(former, publication.edition)
    return f"replaced edition {former.number}" + (f": {change}" if change else "")


def _entries(splits: Sequence[Split]) -> Iterator[NewsItem]:
    for split, drawn in snapshots.shown_on(splits):
        told = [entry for entry in drawn.entries if feeds.is_news(entry) and entry.listed_at]
        for entry in sorted(told, key=_came_at, reverse=True)[:N_NEWS]:
            yield NewsItem(
                at=_came_at(entry),
                name=entry.method,
                href=reverse("method", args=[entry.method_id]),
                words=f"by {entry.team}, {_result(entry)} on {split.title}",
            )


def _came_at(entry: Entry) -> datetime:
    assert entry.listed_at is not None  # noqa: S101 - for the type checker: the others are left out
    return entry.listed_at


def _result(entry: Entry) -> str:
    value = entry.scores[PRIMARY]
    if entry.rank is None or value is None:
        return "no MiD"
    return f"rank {entry.rank}, MiD {format_published(value, decimals=entry.decimals)}"
