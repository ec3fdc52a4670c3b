"""Search in the documentation: the parts that have every word asked for, the best first.

A word also finds what begins with it, as "quot" finds "quota"; a short one only itself and its plural.

On the server, so that it works without a script and needs nothing that the site's policy forbids. The pages
are few enough to be kept as words in memory.
"""

import math
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from operator import mul
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
# A shorter word stands for itself: "to" is not the beginning of "token".
_MIN_BEGINNING: Final = 4
_ENDINGS: Final = ("es", "s", "")
# What people write around the words that they look for.
_FILLERS: Final = frozenset(
    [
        *(
            "a",
            "an",
            "and",
            "are",
            "be",
            "by",
            "can",
            "do",
            "does",
            "for",
            "from",
            "how",
            "i",
            "if",
            "in",
            "is",
        ),
        *("it", "my", "of", "on", "or", "that", "the", "this", "to", "what", "when", "where", "which", "who"),
        *("why", "will", "with"),
    ]
)
# What explains why something is as it is counts less than what explains how to use it.
_BACKGROUND: Final = ("adr/", "changelog")
_OF_BACKGROUND: Final = 0.4


@dataclass(frozen=True)
class _Findable:
    """A part of a page that can be found."""

    title: str
    heading: str
    address: str
    text: str
    factor: float
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
    words = _words(query[:MAX_QUERY])
    asked = ([word for word in words if word not in _FILLERS] or words)[:_MAX_WORDS]
    if not asked:
        return []
    places = _places()
    weights = [[_weight(place, word) for word in asked] for place in places]
    rare = [math.log(1 + len(places) / (1 + sum(row[n] > 0 for row in weights))) for n in range(len(asked))]
    found = [
        (all(row), place.factor * sum(map(mul, row, rare)), place)
        for row, place in zip(weights, places, strict=True)
        if any(row)
    ]
    if any(has_all for has_all, _, _ in found):
        found = [each for each in found if each[0]]
    found.sort(key=lambda each: -each[1])
    return [_hit(place, asked) for _, _, place in found[:MAX_HITS]]


def _weight(place: _Findable, word: str) -> float:
    n_times = sum(n for known, n in place.words.items() if _fits(known, word))
    weight = 1 + math.log(n_times) if n_times else 0.0
    weight += _IN_HEADING * any(_fits(known, word) for known in place.heading_words)
    return weight + _IN_TITLE * any(_fits(known, word) for known in place.title_words)


def _fits(known: str, word: str) -> bool:
    return known.startswith(word) and (len(word) >= _MIN_BEGINNING or known[len(word) :] in _ENDINGS)


def _hit(place: _Findable, asked: list[str]) -> Hit:
    return Hit(place.title, place.heading, place.address, _snippet(place.text, asked))


def _snippet(text: str, asked: list[str]) -> SafeString:
    """The text around the first word asked for.

    >>> _snippet("A file has <every> sequence once.", ["every", "sequ"])
    'A file has &lt;<mark>every</mark>&gt; <mark>sequence</mark> once.'
    """
    endings = f"(?:{'|'.join(_ENDINGS)})(?![^\\W_])"
    asked_for = (re.escape(each) + (r"[^\W_]*" if len(each) >= _MIN_BEGINNING else endings) for each in asked)
    marked = re.compile(rf"(?<![^\W_])({'|'.join(asked_for)})", re.IGNORECASE)
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
            factor=factor,
            words=Counter(_words(text)),
            heading_words=frozenset(_words(heading)),
            title_words=frozenset(_words(title)),
        )
        for title, heading, address, text, factor in (*_guides(), *_reference())
    ]


def _guides() -> Iterator[tuple[str, str, str, str, float]]:
    for name in guides.files():
        factor = _OF_BACKGROUND if name.startswith(_BACKGROUND) else 1.0
        document = guides.guide(name)
        for part in document.parts:
            is_title = part.heading.level < 2
            place = "" if is_title else f"#{part.heading.anchor}"
            text = " ".join(part.text.split())
            heading = "" if is_title else part.heading.text
            yield document.title, heading, _address(name) + place, text, factor


def _address(name: str) -> str:
    return reverse("guide", args=[name])


def _page_of(operation_id: str) -> str:
    return reverse("api_operation", args=[operation_id])


def _reference() -> Iterator[tuple[str, str, str, str, float]]:
    api = api_reference.reference()
    page = reverse("api_reference")
    for operation in api["operations"]:
        yield "API reference", operation["name"], _page_of(operation["id"]), operation["about"], 1.0
    for code, about in (*api["codes"], *api["file_codes"]):
        yield "Problem codes", code, f"{page}#problem-{code}", about.replace("`", ""), 1.0
