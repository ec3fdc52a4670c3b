"""Search in the documentation: the parts whose words begin with every word asked for, the best first.

On the server, so that it works without a script and needs nothing that the site's policy forbids. The pages
are few enough to be kept as words in memory.
"""

import math
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Final

from django.urls import reverse
from django.utils.html import format_html, format_html_join
from django.utils.safestring import SafeString

from leaderboard.web.docs import api_reference, guides

MAX_QUERY: Final = 100
MAX_HITS: Final = 20
_MAX_WORDS: Final = 8
_WORD: Final = re.compile(r"[^\W_]+")
# What a word in a title, and in a heading, counts beside one in the text.
_IN_TITLE: Final = 2.0
_IN_HEADING: Final = 3.0
_SNIPPET: Final = 200
_BEFORE: Final = 60


@dataclass(frozen=True)
class _Findable:
    """A part of a page that can be found."""

    title: str
    heading: str
    address: str
    text: str
    words: Counter[str]
    heading_words: frozenset[str]
    title_words: frozenset[str]


@dataclass(frozen=True)
class Hit:
    """A part that was found; the words asked for are marked in the snippet."""

    title: str
    heading: str
    address: str
    snippet: SafeString


def find(query: str) -> list[Hit]:
    """At most `MAX_HITS` parts; those with some of the words where none has all of them."""
    asked = _words(query[:MAX_QUERY])[:_MAX_WORDS]
    if not asked:
        return []
    places = _places()
    weights = [[_weight(place, word) for word in asked] for place in places]
    rare = [math.log(1 + len(places) / (1 + sum(row[n] > 0 for row in weights))) for n in range(len(asked))]
    found = [
        (all(row), sum(weight * value for weight, value in zip(row, rare, strict=True)), place)
        for row, place in zip(weights, places, strict=True)
        if any(row)
    ]
    if any(has_all for has_all, _, _ in found):
        found = [each for each in found if each[0]]
    found.sort(key=lambda each: -each[1])
    return [_hit(place, asked) for _, _, place in found[:MAX_HITS]]


def _weight(place: _Findable, word: str) -> float:
    n_times = sum(n for known, n in place.words.items() if known.startswith(word))
    weight = 1 + math.log(n_times) if n_times else 0.0
    weight += _IN_HEADING * any(known.startswith(word) for known in place.heading_words)
    return weight + _IN_TITLE * any(known.startswith(word) for known in place.title_words)


def _hit(place: _Findable, asked: list[str]) -> Hit:
    return Hit(place.title, place.heading, place.address, _snippet(place.text, asked))


def _snippet(text: str, asked: list[str]) -> SafeString:
    """The text around the first word asked for.

    >>> _snippet("A file has <every> sequence once.", ["every", "seq"])
    'A file has &lt;<mark>every</mark>&gt; <mark>sequence</mark> once.'
    """
    begins = "|".join(map(re.escape, asked))
    marked = re.compile(rf"(?<![^\W_])((?:{begins})[^\W_]*)", re.IGNORECASE)
    first = marked.search(text)
    begin = max(0, first.start() - _BEFORE) if first else 0
    begin = text.rfind(" ", 0, begin) + 1 if begin else 0
    end = text.find(" ", begin + _SNIPPET)
    shown = text[begin:end] if end > 0 else text[begin:]
    pieces = marked.split(shown)
    drawn = format_html_join(
        "", "{}", ((format_html("<mark>{}</mark>", p) if n % 2 else p,) for n, p in enumerate(pieces))
    )
    return format_html("{}{}{}", "… " if begin else "", drawn, " …" if end > 0 else "")


def _words(text: str) -> list[str]:
    return [word.lower() for word in _WORD.findall(text)]


@cache
def _places() -> list[_Findable]:
    return [
        _Findable(
            title=title,
            heading=heading,
            address=address,
            text=text,
            words=Counter(_words(text)),
            heading_words=frozenset(_words(heading)),
            title_words=frozenset(_words(title)),
        )
        for title, heading, address, text in (*_guides(), *_reference())
    ]


def _guides() -> Iterator[tuple[str, str, str, str]]:
    for name in guides.files():
        document = guides.guide(name)
        for part in document.parts:
            is_title = part.heading.level < 2
            place = "" if is_title else f"#{part.heading.anchor}"
            text = " ".join(part.text.split())
            yield document.title, "" if is_title else part.heading.text, _address(name) + place, text


def _address(name: str) -> str:
    return reverse("guide", args=[name])


def _page_of(operation_id: str) -> str:
    return reverse("api_operation", args=[operation_id])


def _reference() -> Iterator[tuple[str, str, str, str]]:
    api = api_reference.reference()
    page = reverse("api_reference")
    for operation in api["operations"]:
        yield "API reference", operation["name"], _page_of(operation["id"]), operation["about"]
    for code, about in (*api["codes"], *api["file_codes"]):
        yield "Problem codes", code, f"{page}#problem-{code}", about.replace("`", "")
