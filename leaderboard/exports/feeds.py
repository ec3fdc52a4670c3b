"""New entries as an Atom feed (RFC 4287), and the sitemap (sitemaps.org)."""

from collections.abc import Iterable
from datetime import UTC, datetime
from typing import Final
from uuid import NAMESPACE_URL, UUID, uuid5
from xml.etree import ElementTree as ET

from django.conf import settings
from django.urls import reverse
from django.utils.feedgenerator import Atom1Feed

from evaluator.metrics.protocol import grouped_names
from evaluator.scoring.results import format_rounded
from evaluator.tables.escaping import one_line
from leaderboard.boards.rows import Entry
from leaderboard.models import Split

MAX_ENTRIES: Final = 50
_SITEMAP: Final = "http://www.sitemaps.org/schemas/sitemap/0.9"
# Of a feed in which nothing has happened yet: when the benchmark was published.
_BEGINNING: Final = datetime(2023, 9, 4, tzinfo=UTC)


def is_news(entry: Entry) -> bool:
    """Tell whether a row is in the feed: it was submitted and is not withdrawn."""
    return entry.kind == "submission" and entry.withdrawn_at is None


class _Feed(Atom1Feed):
    """An Atom feed with the same bytes for as long as its rows are the same."""

    def latest_post_date(self) -> datetime:
        return super().latest_post_date() if self.items else _BEGINNING


def atom(rows: Iterable[tuple[Split, Entry]], *, title: str, address: str, page: str) -> str:
    """Make a feed at `address` of the newest rows; `page` shows the same."""
    feed = _Feed(
        title=one_line(title),
        link=page,
        description=None,
        feed_url=address,
        feed_guid=uuid5(NAMESPACE_URL, address).urn,
    )
    newest = sorted(rows, key=lambda row: (_came_at(row[1]), _id(*row).int), reverse=True)[:MAX_ENTRIES]
    for split, entry in newest:
        texts = {
            metric: format_rounded(entry.scores[name], decimals=entry.decimals)
            for metric, (name, *_) in grouped_names(entry.scores).items()
        }
        primary = next(f"{metric.symbol} {text}" for metric, text in texts.items())
        rank = f"Rank {entry.rank}. " if entry.rank is not None else ""
        values = ", ".join(f"{metric.symbol} {text} {metric.unit}".rstrip() for metric, text in texts.items())
        feed.add_item(
            title=one_line(f"{entry.method} on {split.pk}: {primary}"),
            link=settings.SITE_URL + reverse("method", args=[entry.method_id]),
            description=f"{rank}{values}; lower is better.",
            unique_id=_id(split, entry).urn,
            updateddate=_came_at(entry).replace(microsecond=0),
            author_name=one_line(entry.team),
        )
    return feed.writeString("utf-8")


def _came_at(entry: Entry) -> datetime:
    """Return when the row was first shown, which may be long after it was submitted."""
    return entry.listed_at or _BEGINNING


def _id(split: Split, entry: Entry) -> UUID:
    """Make an id that survives renaming and another score."""
    assert entry.method_id is not None  # noqa: S101 - for the type checker: rows of submissions have one
    return uuid5(entry.method_id, split.pk)


def sitemap(pages: Iterable[tuple[str, datetime | None]]) -> bytes:
    """Make the sitemap of public pages: absolute address and, if known, last change."""
    root = ET.Element("urlset", xmlns=_SITEMAP)
    for address, changed_at in pages:
        element = ET.SubElement(root, "url")
        ET.SubElement(element, "loc").text = address
        if changed_at is not None:
            ET.SubElement(element, "lastmod").text = f"{changed_at.astimezone(UTC):%Y-%m-%d}"
    return b'<?xml version="1.0" encoding="utf-8"?>\n' + ET.tostring(root, encoding="utf-8")
