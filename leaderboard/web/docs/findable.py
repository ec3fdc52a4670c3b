"""What the search in the documentation finds: parts of guides, the API, the paper's tables, other pages.

They are few enough to be kept as words in memory.
"""

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from html.parser import HTMLParser
from typing import Final

from django.template.loader import render_to_string
from django.urls import reverse
from django.utils import timezone

from evaluator.tables import published
from leaderboard.pages.pages import PAGES, default_text
from leaderboard.web.docs import api_reference, guides, reference

_WORD: Final = re.compile(r"[^\W_]+")
# What explains why something is as it is counts less than what explains how to use it.
_BACKGROUND: Final = ("adr/", "changelog")
_OF_BACKGROUND: Final = 0.4


@dataclass(frozen=True)
class Findable:
    """A part of a page, as texts. `terms` are what it defines, `code` its examples."""

    title: str
    heading: str
    address: str
    text: str
    terms: str = ""
    code: str = ""
    factor: float = 1.0


@dataclass(frozen=True)
class Place:
    """A part and its words."""

    part: Findable
    words: Counter[str]  # an example has each of its words once
    term_words: frozenset[str]
    heading_words: frozenset[str]
    title_words: frozenset[str]


def words(text: str) -> list[str]:
    """The words of a text, small."""
    return [word.lower() for word in _WORD.findall(text)]


@cache
def places() -> list[Place]:
    """All that can be found."""
    return [
        Place(
            part=part,
            words=Counter(words(part.text)) | Counter(set(words(part.code))),
            term_words=frozenset(words(part.terms)),
            # What stands below the title alone is about it.
            heading_words=frozenset(words(part.heading or part.title)),
            title_words=frozenset(words(part.title)),
        )
        for part in (*_glance(), *_guides(), *_reference(), *_tables(), *_site_pages())
    ]


def _guides() -> Iterator[Findable]:
    for name in guides.files():
        document = guides.guide(name)
        for part in document.parts:
            is_title = part.heading.level < 2
            yield Findable(
                title=document.title,
                heading="" if is_title else part.heading.text,
                address=reverse("guide", args=[name]) + ("" if is_title else f"#{part.heading.anchor}"),
                text=" ".join(part.text.split()).removesuffix(" ·"),
                code=" ".join(part.code.split()),
                factor=_OF_BACKGROUND if name.startswith(_BACKGROUND) else 1.0,
            )


def _reference() -> Iterator[Findable]:
    api = api_reference.reference()
    page = reverse("api_reference")
    for operation in api["operations"]:
        address = reverse("api_operation", args=[operation["id"]])
        yield Findable("API reference", operation["name"], address, operation["about"])
    for code, about in (*api["codes"], *api["file_codes"]):
        yield Findable("Problem codes", code, f"{page}#problem-{code}", about.replace("`", ""))


def _tables() -> Iterator[Findable]:
    page = reverse("published")
    for shown in published.printed_tables():
        cells = (cell for row in shown.rows for cell in row.cells)
        yield Findable(
            title="Tables of the paper",
            heading=shown.title,
            address=f"{page}#{shown.table.name}",
            text=" ".join([shown.caption, *shown.table.notes]),
            code=" ".join([*shown.headings, *cells]),
        )


def _site_pages() -> Iterator[Findable]:
    """The pages that maintainers write. Words that they have from the start find them, and are not shown."""
    for page in PAGES.values():
        address = reverse("site_page", args=[page.name])
        yield Findable(page.title, "", address, page.about, terms=default_text(page.name))


# --- the first page, which is a template -------------------------------------------------------------------


def _glance() -> Iterator[Findable]:
    """The parts of the page "At a glance", as it is while a split takes submissions."""
    facts = {**reference.docs((), now=timezone.now()), "is_open": True}
    reader = _Parts()
    reader.feed(render_to_string("docs/docs.html", {"navigation": (), "wheel": None, **facts}))
    page = reverse("docs")
    for anchor, texts in reader.parts.items():
        heading, text, terms, code = (" ".join(" ".join(texts[kind]).split()) for kind in _KINDS)
        yield Findable("Documentation", heading, f"{page}#{anchor}", text, terms, code)


_KINDS: Final = ("heading", "text", "terms", "code")
# Where a text is something else than running text.
_KIND_OF: Final = {"h2": "heading", "strong": "terms", "dt": "terms", "pre": "code", "math": "code"}


class _Parts(HTMLParser):
    """Texts below the headings of the second level, by their anchors and kinds; terms are text as well."""

    def __init__(self) -> None:
        super().__init__()
        self.parts: dict[str, dict[str, list[str]]] = {}
        self._open: list[str] = []
        self._texts: dict[str, list[str]] | None = None

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag == "h2":
            self._texts = self.parts[dict(attrs)["id"] or ""] = {kind: [] for kind in _KINDS}
        if tag in _KIND_OF:
            self._open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag in self._open:
            self._open.remove(tag)
        if tag == "article":
            self._texts = None

    def handle_data(self, data: str) -> None:
        if self._texts is None:
            return
        kind = _KIND_OF[self._open[-1]] if self._open else "text"
        self._texts[kind].append(data)
        if kind == "terms":
            self._texts["text"].append(data)
