"""Boards to take along: the same view of a board as its page, as CSV, LaTeX, Markdown and BibTeX.

They hold what everybody sees, whoever takes them, since they end up in papers. `mine=1` adds the rows of
one's own that others do not see, or not under their name, each marked.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final
from urllib.parse import urlencode

from django.conf import settings
from django.contrib.auth.models import AnonymousUser
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, render
from django.urls import reverse
from django.urls.converters import StringConverter
from django.utils import timezone
from django.views.decorators.http import require_safe

from leaderboard import citations, exports, snapshots
from leaderboard.methods import Result
from leaderboard.models import Edition, Split
from leaderboard.standings import Board
from leaderboard.web import board_query
from leaderboard.web.board_query import BoardQuery
from leaderboard.web.context import split_or_404

# What of a page's address changes what is taken along; a page of it is no table of its own.
_NOT_OURS: Final = ("page",)
_NAMES: Final = {"csv": "CSV", "json": "JSON", "tex": "LaTeX", "md": "Markdown", "bib": "BibTeX"}
PARAMETERS: Final = {**board_query.PARAMETERS, "intervals": exports.YES_OR_NO, "mine": exports.YES_OR_NO}
NOBODYS: Final = (
    "The address asks for your own rows as well (mine=1), and nobody is signed in; expected a session, or "
    "the address without it."
)


def _csv(board: Board, query: BoardQuery, has_intervals: bool) -> str:
    return exports.board_csv(board, has_intervals=has_intervals)


def _tex(board: Board, query: BoardQuery, has_intervals: bool) -> str:
    return exports.board_latex(
        board, address=address(board, query), metrics=query.metrics, has_intervals=has_intervals
    )


def _md(board: Board, query: BoardQuery, has_intervals: bool) -> str:
    return exports.board_markdown(
        board, address=address(board, query), metrics=query.metrics, has_intervals=has_intervals
    )


def _bib(board: Board, query: BoardQuery, has_intervals: bool) -> str:
    return citations.board_bibtex(board.entries)


FORMS: Final[Mapping[str, tuple[str, Callable[[Board, BoardQuery, bool], str]]]] = {
    "csv": ("text/csv; charset=utf-8", _csv),
    "tex": ("application/x-tex; charset=utf-8", _tex),
    "md": ("text/markdown; charset=utf-8", _md),
    "bib": ("application/x-bibtex; charset=utf-8", _bib),
}
"""By the end of the address: its media type, and what makes the text."""


class FormConverter(StringConverter):
    """The end of an address that names a form."""

    regex = "|".join(FORMS)


@require_safe
def board(request: HttpRequest, split: str, form: str) -> HttpResponse:
    """The board of a split, as its page would show all of its rows."""
    return _answer(request, form, split=split_or_404(request, split))


@require_safe
def edition(request: HttpRequest, split: str, number: int, form: str) -> HttpResponse:
    """The board of an edition, for ever."""
    found = get_object_or_404(snapshots.editions(), split=split, number=number)
    return _answer(request, form, split=found.split, edition=found)


def _answer(request: HttpRequest, form: str, *, split: Split, edition: Edition | None = None) -> HttpResponse:
    try:
        query = board_query.parse(request.GET, now=timezone.now(), has_time=edition is None)
        has_intervals = exports.has_intervals(request.GET.get("intervals", ""))
        is_mine = exports.is_asked_for("mine", request.GET.get("mine", ""))
    except board_query.FAULTS as fault:
        return render(request, "400.html", {"sentence": str(fault)}, status=400)
    if is_mine and not request.user.is_authenticated:
        # Without them it would look like what was asked for.
        return render(request, "400.html", {"sentence": NOBODYS}, status=400)
    shown = snapshots.board(
        split=split,
        edition=edition,
        viewer=request.user if is_mine else AnonymousUser(),
        sort=query.sort,
        at=query.at,
        filters=query.filters,
    )
    media_type, make = FORMS[form]
    name = f"tsttc-{split.pk}{f'-edition-{shown.edition.number}' if shown.edition else ''}"
    disposition = {"Content-Disposition": f'inline; filename="{name}{"-with-own" if is_mine else ""}.{form}"'}
    return HttpResponse(make(shown, query, has_intervals), content_type=media_type, headers=disposition)


def address(board: Board, query: BoardQuery) -> str:
    """Where this very table can be found again: at its edition's page, or as of its time."""
    given = {name: value for name, value in query.given.items() if name not in _NOT_OURS}
    if board.edition is None or query.at is not None:
        path = reverse("board", args=[board.split.pk])
    else:
        path = reverse("edition", args=[board.split.pk, board.edition.number])
    return f"{settings.SITE_URL}{path}{'?' + urlencode(given) if given else ''}"


def of_method(results: Sequence[Result]) -> dict[str, str]:
    """How a method is cited, and the split that its badge is about: the first on which it has a rank."""
    first = next((result for result in results if result.entry.rank is not None), None)
    if first is None:
        return {}
    page = settings.SITE_URL + reverse("method", args=[first.entry.method_id])
    return {"bibtex": citations.of_entry(first.entry, page=page), "badge_split": first.split.pk}


@dataclass(frozen=True)
class Offer:
    """Some forms of a view: what stands before them, and for each its name, its address and what it is."""

    label: str
    links: tuple[tuple[str, str, str], ...]


@dataclass(frozen=True)
class Offers:
    """What a board's page offers to take along: what everybody sees, and for a team its own rows as well."""

    everybodys: tuple[Offer, ...]
    with_own: tuple[Offer, ...]


def offers(board: Board, edition: Edition | None, query: BoardQuery) -> Offers:
    """Every form of the same view. `board` is it as the reader sees it."""
    path = reverse("board", args=[board.split.pk])
    if edition is not None:
        path = reverse("edition", args=[edition.split_id, edition.number])
    given = {name: value for name, value in query.given.items() if name not in _NOT_OURS}
    has_intervals = any(entry.intervals for entry in board.entries)
    has_own = any(exports.mark_of(entry) for entry in board.entries)

    def offered(label: str, about: str, but: frozenset[str], **more: str) -> Offer:
        asked = urlencode({**given, **more})
        return Offer(
            label=label,
            links=tuple(
                (name, f"{path.rstrip('/')}.{form}{'?' if asked else ''}{asked}", f"{name}{about}")
                for form, name in _NAMES.items()
                if form not in but
            ),
        )

    def variants(about: str, but: frozenset[str], **more: str) -> tuple[Offer, ...]:
        plain = offered("", about, but, **more)
        if not has_intervals:
            return (plain,)
        # A bibliography has no values.
        sure = offered("with intervals", f"{about}, with intervals", but | {"bib"}, **more, intervals="1")
        return (plain, sure)

    # The API's document has the rows of whoever asks, marked: for whom there are any, it is with those.
    return Offers(
        everybodys=variants("", frozenset({"json"}) if has_own else frozenset()),
        with_own=variants(" with your own rows", frozenset(), mine="1") if has_own else (),
    )
