"""The sitemap (sitemaps.org): the addresses of public pages, with the day of the last change if known."""

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Final
from xml.etree import ElementTree as ET

_NAMESPACE: Final = "http://www.sitemaps.org/schemas/sitemap/0.9"
# What the format allows in one file.
MAX_PAGES: Final = 50_000


@dataclass(frozen=True)
class SitemapEntry:
    """A public page: its absolute address, and when it last changed."""

    address: str
    changed_at: datetime | None = None


def xml(entries: Iterable[SitemapEntry]) -> bytes:
    """These pages, at most as many as the format allows."""
    root = ET.Element("urlset", xmlns=_NAMESPACE)
    for page in list(entries)[:MAX_PAGES]:
        element = ET.SubElement(root, "url")
        ET.SubElement(element, "loc").text = page.address
        if page.changed_at is not None:
            ET.SubElement(element, "lastmod").text = f"{page.changed_at.astimezone(UTC):%Y-%m-%d}"
    return b'<?xml version="1.0" encoding="utf-8"?>\n' + ET.tostring(root, encoding="utf-8")
