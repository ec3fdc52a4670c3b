"""Pages of a board, now, as of a time, or of one edition, and the list of editions."""

from dataclasses import replace
from datetime import date, datetime, timedelta
from typing import Any

from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, render
from django.utils import timezone
from django.utils.functional import SimpleLazyObject
from django.views.decorators.http import require_safe

from leaderboard.boards import snapshots
from leaderboard.boards.listing import Board, UnknownColumn
from leaderboard.boards.snapshots import splits_of
from leaderboard.editions import history
from leaderboard.models import Edition, Publication, Split
from leaderboard.quotas import admissions
from leaderboard.web.boards import board_query, edition_tables, export_views, tables
from leaderboard.web.boards.board_changes import changed_rows
from leaderboard.web.boards.board_query import BoardQuery, tools
from leaderboard.web.boards.rank_ladder import rank_ladder
from leaderboard.web.charts import chart_views
from leaderboard.web.lookups import split_or_404


@require_safe
def board(request: HttpRequest, split: str) -> HttpResponse:
    split_row = split_or_404(request, split)
    # Asked for only by a page that tells it: a board of the past does not.
    news = SimpleLazyObject(lambda: edition_tables.news(split_row))
    return render_board(request, "boards/board.html", split=split_row, news=news)


def render_board(
    request: HttpRequest, template: str, *, split: Split, edition: Edition | None = None, **more: Any
) -> HttpResponse:
    """Draw a board as its address says; an edition's has no other time.

    A fault of the address is left out and said at its field.
    """
    now = timezone.now()
    query, faults = board_query.forgiving(request.GET, now=now, has_time=edition is None)
    shown, query = _shown(request, split, edition, query, faults)
    primary = shown.rules.primary.symbol
    ladder = rank_ladder(shown.unfiltered, primary=shown.rules.score_names[0])
    context = {
        "board": shown,
        "table": tables.board_table(shown, query=query, now=now),
        "tools": tools(
            shown,
            query,
            asked=request.GET,
            faults=faults,
            # Today has not ended yet: it is the present board.
            latest_day=_yesterday(now) if edition is None and split.current_edition else None,
        ),
        "ladder": ladder,
        "changes": changed_rows(shown),
        "first_publication": _first_publication(shown),
        "exports": export_views.offers(shown, edition, query),
        # Where one can submit instead, and the chart below: of the present board alone.
        "open_splits": []
        if shown.is_open or shown.at
        else [each for each in splits_of(request) if admissions.is_open(each, now=now)],
        "profile": None
        if shown.at or chart_views.has_progress(shown)
        else chart_views.profile(shown, n_metrics=1 if ladder and not ladder.is_certain else 2),
        "n_profiles": chart_views.n_profiles(shown),
        "progress_label": f"{primary} of each method by date, with the lowest {primary} so far.",
        "n_withdrawn": sum(entry.withdrawn_at is not None for entry in shown.unfiltered),
    }
    # Who types into the form is no program that got its request wrong: the answer stands at the field.
    status = 400 if faults and not request.headers.get("HX-Request") else 200
    return render(request, template, context | more, status=status)


def _shown(
    request: HttpRequest, split: Split, edition: Edition | None, query: BoardQuery, faults: dict[str, str]
) -> tuple[Board, BoardQuery]:
    # In the order of ranks where its protocol lacks the sort column.
    try:
        board = snapshots.board(
            split=split,
            edition=edition,
            viewer=request.user,
            sort=query.sort,
            at=query.at,
            filters=query.filters,
        )
    except UnknownColumn as fault:
        faults[fault.field] = board_query.on_page(fault)
        given = {name: text for name, text in query.given.items() if name != fault.field}
        return _shown(request, split, edition, replace(query, sort="rank", given=given), faults)
    return board, query


def _yesterday(now: datetime) -> date:
    return (now - timedelta(days=1)).date()


def _first_publication(board: Board) -> Publication | None:
    """Return when a split first had a board, where there was none yet at the time that is asked for."""
    return None if board.edition or not board.at else history.changelog(board.split).last()


@require_safe
def editions(request: HttpRequest, split: str) -> HttpResponse:
    split_row = split_or_404(request, split)
    log = history.changelog(split_row)
    rows = [(past, edition_tables.past_change(past)) for past in history.history(split_row, log)]
    context = {"split": split_row, "rows": rows, "changelog": log, "latest_day": _yesterday(timezone.now())}
    return render(request, "boards/editions/editions.html", context)


@require_safe
def edition(request: HttpRequest, split: str, number: int) -> HttpResponse:
    row = get_object_or_404(snapshots.editions(), split=split, number=number)
    past = history.record_of(row)
    return render_board(
        request,
        "boards/editions/edition.html",
        split=row.split,
        edition=row,
        past=past,
        change=edition_tables.past_change(past),
        ttc_ranges=tables.counted_ranges(row.rules, row.ground_truth.counts),
    )
