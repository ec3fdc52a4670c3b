"""Exports of a board: its view as CSV, LaTeX, Markdown and BibTeX.

They have public rows for every reader, since they end up in papers; `mine=1` adds the team's own, marked.
"""

from collections.abc import Callable, Iterator, Sequence
from datetime import date
from typing import Any, Final
from urllib.parse import urlencode

from django.conf import settings
from django.contrib.auth.models import AnonymousUser
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.urls import reverse
from django.urls.converters import StringConverter
from django.utils import timezone
from django.views.decorators.http import require_safe

from evaluator.tables import formats
from evaluator.tables.formats import Format
from leaderboard.boards import snapshots
from leaderboard.boards.listing import Board
from leaderboard.boards.results import Result
from leaderboard.exports import bibtex, eval_results, tables
from leaderboard.models import Edition, Split
from leaderboard.web.boards import board_query
from leaderboard.web.boards.board_query import BoardQuery
from leaderboard.web.lookups import split_or_404

NOBODYS: Final = (
    "The address asks for the rows of your team as well (mine=1), but you are not signed in; sign in, or use "
    "the address without mine=1."
)


class FormatConverter(StringConverter):
    regex = "[a-z]+"

    def to_python(self, value: str) -> Format:  # type: ignore[override]  # Django takes any type
        match = next((each for each in formats.FORMATS if each.suffix == value), None)
        if match is None:
            raise ValueError(value)
        return match


@require_safe
def board(request: HttpRequest, split: str, chosen: Format) -> HttpResponse:
    if chosen.write is None:
        return _api_document(request, "api-board", split)
    return _answer(request, chosen, chosen.write, split=split_or_404(request, split))


@require_safe
def edition(request: HttpRequest, split: str, number: int, chosen: Format) -> HttpResponse:
    if chosen.write is None:
        return _api_document(request, "api-edition-board", split, number)
    row = get_object_or_404(snapshots.editions(), split=split, number=number)
    return _answer(request, chosen, chosen.write, split=row.split, edition=row)


def _api_document(request: HttpRequest, name: str, *of: object) -> HttpResponse:
    query = request.META["QUERY_STRING"]
    return redirect(reverse(name, args=of) + (f"?{query}" if query else ""))


def _answer(
    request: HttpRequest,
    chosen: Format,
    write: Callable[[tables.Export], str],
    *,
    split: Split,
    edition: Edition | None = None,
) -> HttpResponse:
    now = timezone.now()
    try:
        query = board_query.parse(request.GET, now=now, has_time=edition is None)
        has_intervals = tables.is_asked_for("intervals", request.GET.get("intervals", ""))
        is_mine = tables.is_asked_for("mine", request.GET.get("mine", ""))
        if is_mine and not request.user.is_authenticated:
            # Without them it would look like what was asked for.
            raise board_query.BadView("mine", NOBODYS)
        shown = snapshots.board(
            split=split,
            edition=edition,
            viewer=request.user if is_mine else AnonymousUser(),
            sort=query.sort,
            at=query.at,
            filters=query.filters,
        )
    except board_query.FAULTS as fault:
        return render(request, "400.html", {"sentence": str(fault)}, status=400)
    export = tables.export(
        shown,
        address=address(shown, query),
        metric=query.columns,
        has_intervals=has_intervals,
        visited_on=now.date(),
    )
    name = f"tsttc-{split.pk}{f'-edition-{shown.edition.number}' if shown.edition else ''}"
    name += f"{'-with-own' if is_mine else ''}.{chosen.suffix}"
    return HttpResponse(
        write(export),
        content_type=f"{chosen.media_type}; charset=utf-8",
        headers={"Content-Disposition": f'attachment; filename="{name}"'},
    )


def address(board: Board, query: BoardQuery) -> str:
    """Return the permanent address: the edition's page, or the board as of its time."""
    if board.edition is None or query.at is not None:
        path = reverse("board", args=[board.split.pk])
    else:
        path = reverse("edition", args=[board.split.pk, board.edition.number])
    return f"{settings.SITE_URL}{path}{_asked(query)}"


def _asked(query: BoardQuery, **more: str) -> str:
    # A page of the table is no table of its own.
    given = {name: value for name, value in query.given.items() if name != "page"} | more
    return f"?{urlencode(given)}" if given else ""


def of_method(results: Sequence[Result], *, visited_on: date) -> dict[str, str]:
    """Return a method's BibTeX and LaTeX, its result for the Hub, and its split: of the first ranked."""
    first = next((result for result in results if result.entry.rank is not None), None)
    if first is None:
        return {}
    page = settings.SITE_URL + reverse("method", args=[first.entry.method_id])
    return {
        "bibtex": bibtex.of_entry(
            tables.as_printed(first.entry), page=page, edition=first.edition, visited_on=visited_on
        ),
        "latex_row": tables.latex_row(first.entry),
        "latex_with_intervals": tables.latex_row(first.entry, has_intervals=True)
        if first.entry.intervals
        else "",
        "eval_result": "\n".join(eval_results.of_entry(first.entry, edition=first.edition)),
        "badge_split": first.split.pk,
    }


def offers(board: Board, edition: Edition | None, query: BoardQuery) -> dict[str, Any]:
    """Return the exports that a board's page offers, as labels with links, public or with own rows."""
    path = reverse("board", args=[board.split.pk])
    if edition is not None:
        path = reverse("edition", args=[edition.split_id, edition.number])
    has_own = any(tables.mark_of(entry) for entry in board.entries)
    variants: dict[str, dict[str, str]] = {"": {}}
    if any(entry.intervals for entry in board.entries):
        variants["with confidence intervals"] = {"intervals": "1"}

    def links(label: str, about: str, **more: str) -> Iterator[dict[str, Any]]:
        for each in tables.offered():
            if each.has_values or not label:
                # The API's document has the rows of the user who asks, unless it is asked for without.
                public = {"mine": "0"} if has_own and each.write is None and "mine" not in more else {}
                yield {
                    "format": each,
                    "href": f"{path.rstrip('/')}.{each.suffix}{_asked(query, **more, **public)}",
                    "about": ", ".join(filter(None, (f"{each.title}{about}", label))),
                    "file_name": f"tsttc-{board.split.pk}.{each.suffix}",
                }

    def offered(about: str, **own: str) -> list[tuple[str, list[dict[str, Any]]]]:
        return [(label, list(links(label, about, **own, **more))) for label, more in variants.items()]

    return {
        "public": offered(""),
        "with_own": offered(" including your private rows", mine="1") if has_own else [],
    }
