"""Search in the documentation: the parts that have every word asked for, the best first.

A word also finds what begins with it, as "quot" finds "quota"; a short one only itself and its plural.

On the server, so that it works without a script and needs nothing that the site's policy forbids.
"""

import math
import re
from collections.abc import Collection
from dataclasses import dataclass
from operator import mul
from typing import Final

from django.utils.html import format_html, format_html_join
from django.utils.safestring import SafeString

from leaderboard.web.docs.findable import Place, places, words

MAX_QUERY: Final = 100
MAX_HITS: Final = 20
_MAX_WORDS: Final = 8
# What a word in a title, in a heading, and among what is defined there, counts beside one in the text.
_IN_TITLE: Final = 2.0
_IN_HEADING: Final = 3.0
_IN_TERMS: Final = 3.0
_OF_BEGINNING: Final = 0.5
_SNIPPET: Final = 200
_BEFORE: Final = 60
# A shorter word stands for itself: "to" is not the beginning of "token".
_MIN_BEGINNING: Final = 4
_ENDINGS: Final = ("es", "s", "")
# What people write around the words that they look for.
_FILLERS: Final = frozenset(
    re.findall(
        "[a-z]+",
        "a an and are be by can do does for from get have how i if in is it me my of on or that the there "
        "this to we what when where which who why will with you your",
    )
)


@dataclass(frozen=True)
class Hit:
    """A part that was found; the words asked for are marked in the snippet."""

    title: str
    heading: str
    address: str
    snippet: SafeString


def find(query: str) -> list[Hit]:
    """At most `MAX_HITS` parts; those with some of the words where none has all of them."""
    typed = words(query[:MAX_QUERY])
    asked = ([word for word in typed if word not in _FILLERS] or typed)[:_MAX_WORDS]
    if not asked:
        return []
    known = places()
    weights = [[_weight(place, word) for word in asked] for place in known]
    rare = [math.log(1 + len(known) / (1 + sum(row[n] > 0 for row in weights))) for n in range(len(asked))]
    found = [
        (all(row), place.part.factor * sum(map(mul, row, rare)), place)
        for row, place in zip(weights, known, strict=True)
        if any(row)
    ]
    if any(has_all for has_all, _, _ in found):
        found = [each for each in found if each[0]]
    found.sort(key=lambda each: -each[1])
    return [_hit(place, asked) for _, _, place in found[:MAX_HITS]]


def _weight(place: Place, word: str) -> float:
    n_times = sum(n * _share((known,), word) for known, n in place.words.items() if _fits(known, word))
    weight = math.log(math.e * n_times + 1) if n_times else 0.0
    weight += _IN_TERMS * _share(place.term_words, word)
    weight += _IN_HEADING * _share(place.heading_words, word)
    return weight + _IN_TITLE * _share(place.title_words, word)


def _share(known: Collection[str], word: str) -> float:
    """1 where the word or its plural is, less where it only begins another, as "data" begins "database"."""
    if any(word + ending in known for ending in _ENDINGS):
        return 1.0
    return _OF_BEGINNING * any(_fits(each, word) for each in known)


def _fits(known: str, word: str) -> bool:
    return known.startswith(word) and (len(word) >= _MIN_BEGINNING or known[len(word) :] in _ENDINGS)


def _hit(place: Place, asked: list[str]) -> Hit:
    part = place.part
    is_in_text = any(_fits(known, word) for known in words(part.text) for word in asked)
    text = part.text if is_in_text or not part.code else part.code
    return Hit(part.title, part.heading, part.address, _snippet(text, asked))


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
