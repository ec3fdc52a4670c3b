"""What others fetch now and then: new entries as an Atom feed (RFC 4287), and the sitemap (sitemaps.org).

The feed says what everybody sees, under the names that everybody sees.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Final
from uuid import NAMESPACE_URL, UUID, uuid5
from xml.etree import ElementTree as ET

from evaluator.metrics.protocol import grouped_names
from evaluator.scoring.report import format_published
from evaluator.tables.escaping import one_line
from leaderboard.boards.rows import Entry
from leaderboard.models import Split

MAX_ENTRIES: Final = 50
_ATOM: Final = "http://www.w3.org/2005/Atom"
_SITEMAP: Final = "http://www.sitemaps.org/schemas/sitemap/0.9"
# What the format of sitemaps allows in one file.
MAX_PAGES: Final = 50_000
# Of a feed in which nothing has happened yet: when the benchmark was published.
_BEGINNING: Final = datetime(2023, 9, 4, tzinfo=UTC)


@dataclass(frozen=True)
class Item:
    """A row of a board, and where it is told of."""

    split: Split
    entry: Entry
    address: str

    @property
    def at(self) -> datetime:
        """When it came: a method that was private has been tried long before anybody could see it."""
        return self.entry.listed_at or _BEGINNING

    @property
    def id(self) -> UUID:
        """The same as long as the method is on the board, whatever it is called and has scored."""
        assert self.entry.method_id is not None  # noqa: S101 - for the type checker: rows of submissions have one
        return uuid5(self.entry.method_id, self.split.pk)


def is_news(entry: Entry) -> bool:
    """Whether a row is told of: one that somebody submitted, and that still stands."""
    return entry.kind == "submission" and entry.withdrawn_at is None


def atom(items: Iterable[Item], *, title: str, address: str, page: str) -> bytes:
    """The newest of these as a feed at `address`, which tells of what `page` shows."""
    newest = sorted(items, key=lambda item: (item.at, item.id.int), reverse=True)[:MAX_ENTRIES]
    feed = ET.Element("feed", xmlns=_ATOM)
    _text(feed, "id", uuid5(NAMESPACE_URL, address).urn)
    _text(feed, "title", title)
    _text(feed, "updated", _moment(newest[0].at if newest else _BEGINNING))
    ET.SubElement(feed, "link", rel="self", type="application/atom+xml", href=address)
    ET.SubElement(feed, "link", rel="alternate", type="text/html", href=page)
    for item in newest:
        _entry(feed, item)
    return b'<?xml version="1.0" encoding="utf-8"?>\n' + ET.tostring(feed, encoding="utf-8")


def _entry(feed: ET.Element, item: Item) -> None:
    entry = item.entry
    element = ET.SubElement(feed, "entry")
    _text(element, "id", item.id.urn)
    texts = {
        metric: format_published(entry.scores[name], decimals=entry.decimals)
        for metric, (name, *_) in grouped_names(entry.scores).items()
    }
    primary = next(f"{metric.symbol} {text}" for metric, text in texts.items())
    _text(element, "title", f"{entry.method} on {item.split.pk}: {primary}")
    _text(element, "updated", _moment(item.at))
    _text(ET.SubElement(element, "author"), "name", entry.team)
    ET.SubElement(element, "link", rel="alternate", type="text/html", href=item.address)
    rank = f"Rank {entry.rank}. " if entry.rank is not None else ""
    values = ", ".join(f"{metric.symbol} {text} {metric.unit}".rstrip() for metric, text in texts.items())
    _text(element, "summary", f"{rank}{values}; lower is better.")


def _text(parent: ET.Element, name: str, text: str) -> None:
    ET.SubElement(parent, name).text = one_line(text)


def _moment(at: datetime) -> str:
    return at.astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


@dataclass(frozen=True)
class SitemapEntry:
    """A public page: its absolute address, and when it last changed."""

    address: str
    changed_at: datetime | None = None


def xml(entries: Iterable[SitemapEntry]) -> bytes:
    """These pages, at most as many as the format allows."""
    root = ET.Element("urlset", xmlns=_SITEMAP)
    for page in list(entries)[:MAX_PAGES]:
        element = ET.SubElement(root, "url")
        ET.SubElement(element, "loc").text = page.address
        if page.changed_at is not None:
            ET.SubElement(element, "lastmod").text = f"{page.changed_at.astimezone(UTC):%Y-%m-%d}"
    return b'<?xml version="1.0" encoding="utf-8"?>\n' + ET.tostring(root, encoding="utf-8")
