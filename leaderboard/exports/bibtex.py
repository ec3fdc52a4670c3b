"""BibTeX of the benchmark, of papers with published results, and of methods."""

import re
import unicodedata
from collections.abc import Iterable, Iterator
from datetime import UTC, date, datetime
from typing import Final

from django.conf import settings

from evaluator.tables import layouts
from evaluator.tables.escaping import latex, one_line
from leaderboard.boards.rows import Entry
from leaderboard.models import Edition

_ARXIV: Final = re.compile(
    r"https?://(?:www\.)?arxiv\.org/(?:abs|pdf)/([0-9]{4}\.[0-9]{4,5})(?:v[0-9]+)?(?:\.pdf)?"
)
# What would end a field, or LaTeX's reading of an address, is written as the address' own escape.
_IN_ADDRESSES: Final = {character: f"%{ord(character):02X}" for character in '{}\\^~"` |<>'}


def references(entries: Iterable[Entry], *, of_board: str = "") -> Iterator[str]:
    """Yield the benchmark's paper if it has one, the board, then an entry for each further paper of a row.

    The note of a row marks one that others see differently.
    """
    paper = settings.BENCHMARK.paper
    yield from filter(None, (paper.bibtex_entry if paper else "", of_board))
    bibtex_by_key = {paper.bibtex_key: ""} if paper else {}
    for entry in entries:
        has_paper = entry.source_title or _own_paper(entry)
        if entry.withdrawn_at is None and has_paper:
            bibtex_by_key.setdefault(key_of(entry), of_entry(entry))
    yield from filter(None, bibtex_by_key.values())


def of_edition(edition: Edition, *, address: str, at: datetime | None, visited_on: date | None = None) -> str:
    """Cite the board of an edition as of a time, at a permanent address."""
    name = settings.BENCHMARK.site_name
    site = latex(name)
    facts = [f"Protocol {edition.protocol}", f"ground truth {edition.ground_truth_id}"]
    facts += [f"as of {at.astimezone(UTC):%Y-%m-%d}"] if at else []
    return _entry(
        f"{_plain(name)}-{_plain(edition.split_id)}-edition-{edition.number}",
        {
            "title": f"{{{site}: {latex(edition.split_id)}, edition {edition.number}}}",
            "author": f"{{{site}}}",
            "year": f"{at.astimezone(UTC):%Y}" if at else "",
            **_address(address),
            "urldate": _day(visited_on),
            "note": latex(", ".join(facts)),
        },
    )


def key_of(entry: Entry) -> str:
    """Return the key: a published result's paper, or a method's name and the start of its id."""
    if entry.kind == "published":
        paper = settings.BENCHMARK.paper
        if paper and entry.source_title == paper.title:
            return paper.bibtex_key
        return _paper_key(entry.team, entry.year or "", entry.source_title)
    name = _plain(entry.method)[:40].strip("-") or "method"
    return f"{name}-{entry.method_id.hex[:6] if entry.method_id else ''}"


def of_entry(
    entry: Entry, *, page: str = "", edition: Edition | None = None, visited_on: date | None = None
) -> str:
    """Cite a row: its team and paper; a method without a paper of its own by its `page`."""
    if entry.kind == "published":
        year = str(entry.year or "")
        return _paper(key_of(entry), entry.source_title, entry.team, year, entry.paper_url)
    mark = layouts.mark_of(visibility=entry.visibility, pseudonym=entry.pseudonym)
    edition_facts = [f"{edition.split_id}, edition {edition.number}"] if edition else []
    return _entry(
        key_of(entry),
        {
            "title": f"{{{latex(entry.method)}}}",
            "author": f"{{{latex(entry.team)}}}",
            "year": f"{entry.date:%Y}" if entry.date else "",
            **_address(_own_paper(entry) or page),
            "urldate": "" if _own_paper(entry) else _day(visited_on),
            "note": layouts.marked(latex(", ".join([settings.BENCHMARK.site_name, *edition_facts])), mark),
        },
    )


def _day(visited_on: date | None) -> str:
    return visited_on.isoformat() if visited_on else ""


def _own_paper(entry: Entry) -> str:
    """Return the address of the team's paper. The benchmark's is not: others wrote it."""
    paper = settings.BENCHMARK.paper
    return "" if paper and entry.paper_url == paper.url else entry.paper_url


def _paper(key: str, title: str, authors: str, year: str, url: str) -> str:
    names = [name.strip() for name in authors.split(",") if name.strip()]
    return _entry(
        key,
        {
            "title": f"{{{latex(title)}}}",
            "author": " and ".join(latex(name) for name in names),
            "year": year,
            **_address(url),
        },
    )


def _address(url: str) -> dict[str, str]:
    fields = {"url": "".join(_IN_ADDRESSES.get(c, c) for c in one_line(url))}
    arxiv = _ARXIV.fullmatch(url)
    return {"eprint": arxiv[1], "archivePrefix": "arXiv", **fields} if arxiv else fields


def _entry(key: str, fields: dict[str, str]) -> str:
    lines = [f"  {name} = {{{value}}}," for name, value in fields.items() if value]
    return "\n".join([f"@misc{{{key},", *lines, "}", ""])


def _paper_key(authors: str, year: object, title: str) -> str:
    first_author = authors.partition(",")[0]
    surname = _plain(first_author.rpartition(" ")[2]) or "paper"
    words = [_plain(word) for word in re.split(r"[\s:-]+", title)]
    word = next((word for word in words if len(word) > 3), "")
    return f"{surname}{year}{word}"


def _plain(text: str) -> str:
    # Letters, digits and hyphens of ASCII: every BibTeX takes these in a key.
    ascii_text = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode().lower()
    return re.sub(r"[^a-z0-9]+", "-", ascii_text).strip("-")
