"""The latest news of boards without simulated data: published editions, rollbacks and new entries."""

from collections.abc import Iterator, Sequence
from datetime import datetime
from operator import itemgetter
from typing import Final

from django.urls import reverse

from leaderboard.boards import snapshots
from leaderboard.editions import history
from leaderboard.exports import badges, feeds
from leaderboard.models import Publication, Split
from leaderboard.web.boards import edition_tables

N_NEWS: Final = 5
News = tuple[datetime, str, str, str]
"""When, the address of a link, its text, and the words behind it."""


def latest(splits: Sequence[Split]) -> list[News]:
    """Return public news of those splits that are not simulated, newest first."""
    real = [split for split in splits if not split.is_simulated]
    return sorted([*_entries(real), *_editions(real)], key=itemgetter(0), reverse=True)[:N_NEWS]


def _editions(splits: Sequence[Split]) -> Iterator[News]:
    for publication in history.latest_changes(splits, N_NEWS):
        split, edition = publication.split, publication.edition
        href = reverse("edition", args=[split.pk, edition.number])
        yield publication.at, href, f"{split.title}, edition {edition.number}", _change(publication)


def _change(publication: Publication) -> str:
    former = publication.replaced
    if former is None:
        return "published"
    if publication.kind == Publication.Kind.ROLLED_BACK:
        return f"current again: edition {former.number} was rolled back"
    change = edition_tables.change_words(former, publication.edition)
    return f"replaced edition {former.number}" + (f": {change}" if change else "")


def _entries(splits: Sequence[Split]) -> Iterator[News]:
    for split, shown in snapshots.shown_on(splits):
        for entry in shown.entries:
            if feeds.is_news(entry) and entry.listed_at:
                href = reverse("method", args=[entry.method_id])
                words = f"by {entry.team}, {badges.words(entry)} on {split.title}"
                yield entry.listed_at, href, entry.method, words
