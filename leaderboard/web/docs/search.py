"""Search in the guides: parts with every word, those with it in a heading first."""

import re
from typing import Final, NamedTuple

from django.urls import reverse
from django.utils.html import format_html, format_html_join
from django.utils.safestring import SafeString
from django.utils.text import Truncator

from leaderboard.web.docs import guides, python_reference
from leaderboard.web.markdown import Part

MAX_QUERY: Final = 100
# Each word is looked for in every part of every guide.
MAX_WORDS: Final = 8
MAX_HITS: Final = 12
_MAX_COUNT: Final = 8
_SNIPPET: Final = 200
_BEFORE_CODE: Final = 12  # words
# Pages of names, where a word is often a name: what explains it comes first.
_REFERENCES: Final = frozenset({"cli", *python_reference.SECTIONS})
_WORD: Final = re.compile(r"[^\W_]+")
# A name such as "fail-if" or "bag_stamp" is asked for as a whole.
_ASKED: Final = re.compile(r"[^\W_]+(?:[-_][^\W_]+)*")
# A longer word also finds what begins with it: "quot" finds "quota", but "to" does not find "token".
_MAX_SHORT: Final = 3
# Its ending does not count: "truncation" finds "truncated".
_ENDINGS: Final = r"(?:(?:at)?(?:ions?|ings?|e[ds]?)|(?<!s)s)"
_ENDING: Final = re.compile(rf"(?<=[^\W_]{{4}}){_ENDINGS}$")
_FILLERS: Final = frozenset(
    _WORD.findall(
        "a an and are be by can do does for from get have how i if in is it me my of on or that the there "
        "this to we what when where which who why will with you your"
    )
)


class Hit(NamedTuple):
    """A part of a guide; its beginning has no heading. The snippet marks the words."""

    title: str
    heading: str
    address: str
    snippet: SafeString


def find(query: str) -> list[Hit]:
    """Return at most `MAX_HITS` parts, those of one guide together; parts with some words if none has all.

    The first `MAX_WORDS` words count, those with hyphens by their parts; words of one letter do not.
    """
    words = _words(query)
    if not words:
        return []
    asked = [_pattern(word) for word in words]
    exact = [_pattern(word, is_exact=True) for word in words]
    # Most parts have none of the words, which is cheap to see.
    beginnings = [re.split("[-_]", _ENDING.sub("", word))[0] for word in words]
    ranked = []
    for name in guides.files():
        guide = guides.guide(name)
        # Decisions and changes say why something is as it is: they come after what says how to use it.
        is_background = name.startswith("adr/") or name == "changelog"
        for part in guide.parts:
            heading, text = part.heading, " ".join(part.text.split())
            own = f"{heading.text} {text}"
            folded = own.lower()
            if not any(beginning in folded for beginning in beginnings):
                continue
            everything = f"{guide.title} {own}"
            counts = [len(word.findall(everything)) for word in asked]
            if any(word.search(own) for word in asked):
                n_beginnings = sum(word.search(everything) is None for word in exact)
                score = _score(heading.text, guide.title, asked) - 4 * (name in _REFERENCES)
                score += sum(min(count, _MAX_COUNT) for count in counts)
                rank = (counts.count(0), n_beginnings, is_background, -score)
                ranked.append((rank, name, part))
    apart = " ".join(_WORD.findall(query))
    if not ranked and apart != query:
        return find(apart)
    has_all = [each for each in ranked if each[0][0] == 0]
    best = sorted(has_all or ranked, key=lambda each: each[0])[:MAX_HITS]
    hits = [_hit(name, part, asked) for _, name, part in best]
    titles = [hit.title for hit in hits]
    return sorted(hits, key=lambda hit: titles.index(hit.title))


def _hit(name: str, part: Part, asked: list[re.Pattern[str]]) -> Hit:
    anchor = f"#{part.heading.anchor}" if part.heading.level > 1 else ""
    address = reverse("guide", args=[name]) + anchor
    heading = part.heading.text if anchor else ""
    return Hit(guides.guide(name).title, heading, address, _snippet(part, asked))


def _words(query: str) -> list[str]:
    typed: list[str] = []
    for name in _ASKED.findall(query.lower()):
        parts = _WORD.findall(name)
        long_ones = [part for part in parts if len(part) > 1]
        typed += [name] if long_ones and len(parts) <= MAX_WORDS else long_ones
    words: set[str] = set()
    n_parts = 0
    for word in [word for word in typed if word not in _FILLERS] or typed:
        n_parts += len(_WORD.findall(word))
        if n_parts > MAX_WORDS:
            break
        words.add(word)
    return sorted(words)


def _score(heading: str, title: str, asked: list[re.Pattern[str]]) -> float:
    """Say how well a heading, in a guide with a title, names what is asked for."""
    in_heading = sum(bool(word.search(heading)) for word in asked)
    n_words = len(set(_WORD.findall(heading.lower())) - _FILLERS) or 1
    return 8 * in_heading * (1 + in_heading / n_words) + 4 * sum(bool(word.search(title)) for word in asked)


def _pattern(word: str, *, is_exact: bool = False) -> re.Pattern[str]:
    beginning = _ENDING.sub("", word)
    if len(word) <= _MAX_SHORT:
        end = r"(?:e?s)?(?![^\W_])"
    else:
        end = rf"{_ENDINGS}?(?![^\W_])" if is_exact else r"[^\W_]*"
    beginning = r"[-_\s]".join(map(re.escape, re.split("[-_]", beginning)))
    return re.compile(rf"(?<![^\W_]){beginning}{end}", re.IGNORECASE)


def _snippet(part: Part, asked: list[re.Pattern[str]]) -> SafeString:
    """Return the prose, the row of a table or the line of code with most of the words."""
    marked = re.compile("(" + "|".join(word.pattern for word in asked) + ")", re.IGNORECASE)
    pieces = (part.prose, *part.text.splitlines())
    best = max(pieces, key=lambda piece: sum(bool(word.search(piece)) for word in asked))
    text = " ".join((best or part.text).split())
    is_code = part.prose and best != part.prose and " · " not in best
    if is_code:  # a line of code says little alone, and one that goes on nothing
        goes_on = text.endswith(("(", "{", ","))
        text = part.prose if goes_on else f"{Truncator(part.prose).words(_BEFORE_CODE)} {text}"
    first = marked.search(text)
    begin = text.rfind(" ", 0, max(0, first.start() - 60)) + 1 if first and not is_code else 0
    end = len(text) if len(text) <= begin + _SNIPPET else text.rfind(" ", 0, begin + _SNIPPET)
    cut = enumerate(marked.split(text[begin:end].strip(" ·")))
    drawn = format_html_join("", "{}", ([format_html("<mark>{}</mark>", p) if n % 2 else p] for n, p in cut))
    return format_html("{}{}{}", "… " if begin else "", drawn, " …" if end < len(text) else "")
