"""Pages of a board, now, as of a time, or of one edition, and the list of editions."""

from collections.abc import Sequence
from dataclasses import replace
from datetime import date, datetime, timedelta
from typing import Any

from django.conf import settings
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, render
from django.utils import timezone
from django.utils.functional import SimpleLazyObject
from django.views.decorators.http import require_safe

from evaluator.counting import counted
from leaderboard.boards import snapshots
from leaderboard.boards.listing import Board, UnknownColumn
from leaderboard.boards.snapshots import splits_of
from leaderboard.editions import history
from leaderboard.models import Edition, Publication, Split
from leaderboard.quotas import admissions
from leaderboard.web.boards import board_query, edition_tables, export_views, tables
from leaderboard.web.boards.board_changes import changed_rows
from leaderboard.web.boards.board_query import BoardQuery, tools
from leaderboard.web.boards.legend import legend
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
    table = tables.board_table(shown, query=query, now=now)
    is_filtered = query.filters.is_set
    ladder = rank_ladder(shown.unfiltered, primary=shown.rules.score_names[0])
    profile = None
    if not shown.at and not chart_views.has_progress(shown):
        profile = chart_views.profile(shown, n_metrics=1 if ladder and not ladder.is_certain else 2)
    ladder_note = ""
    if ladder:
        ladder_note = ladder.note(by=primary if table.is_ranked_by_another else "", is_filtered=is_filtered)
    context = {
        "board": shown,
        **_descriptions(shown, is_of_edition=edition is not None),
        "table": table,
        "table_legend": legend(shown, table, ladder=ladder),
        "tools": tools(
            shown,
            query,
            asked=request.GET,
            faults=faults,
            # Today has not ended yet: it is the present board.
            latest_day=_yesterday(now) if edition is None and split.current_edition else None,
        ),
        "ladder": ladder,
        "ladder_note": ladder_note,
        "changes": changed_rows(shown),
        "first_publication": _first_publication(shown),
        "exports": export_views.offers(shown, edition, query),
        # Where one can submit instead, and the chart below: of the present board alone.
        "open_splits": []
        if shown.is_open or shown.at
        else _listed([each for each in splits_of(request) if admissions.is_open(each, now=now)]),
        "profile": profile,
        "profile_note": chart_views.profile_note(shown, profile) if profile else "",
        "progress_note": _progress_note(shown, is_filtered=is_filtered),
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


def _descriptions(board: Board, *, is_of_edition: bool) -> dict[str, str]:
    """Describe a page to search engines, and its contents to whom its address is sent."""
    title, benchmark = board.split.title, settings.BENCHMARK.name
    results = counted(board.n_in_all, "result")
    if is_of_edition and board.edition:
        named = f"The {title} board of {benchmark} in edition {board.edition.number}"
        return {"description": f"{named}, at a permanent address.", "contents": f"{named}: {results}."}
    metrics = ", ".join(metric.title for metric in board.rules.metrics)
    edition = f", edition {board.edition.number}" if board.edition else ""
    return {
        "description": f"Ranked results on the {title} split of {benchmark}: {metrics}.",
        "contents": f"{results} on the {title} split of {benchmark}{edition}.",
    }


def _listed(splits: Sequence[Split]) -> list[tuple[Split, str]]:
    """Return splits, each with what follows it in a sentence."""
    last = len(splits) - 1
    separators = {last: "", last - 1: " and"}
    return [(split, separators.get(i, ",")) for i, split in enumerate(splits)]


def _progress_note(board: Board, *, is_filtered: bool) -> str:
    filtered = ", also those that the filter hides" if is_filtered else ""
    quoted = ", and rows quoted from papers" if board.n_submissions < board.n_in_all else ""
    return f"All public submissions to {board.split.title}{filtered}{quoted}."


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
    context = {
        "split": split_row,
        "description": f"Every edition of the {split_row.title} board of {settings.BENCHMARK.name}, "
        "with its ground truth, and why each replaced the one before.",
        "rows": rows,
        "changelog": log,
        "latest_day": _yesterday(timezone.now()),
    }
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
