"""The page of a board's charts, and one chart's options for other pages."""

from django.http import HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import render
from django.views.decorators.http import require_safe

from evaluator.tables import sentences
from leaderboard.boards import snapshots
from leaderboard.boards.listing import Board
from leaderboard.http_caching import cacheable
from leaderboard.statistics import comparisons
from leaderboard.statistics.comparisons import Pair
from leaderboard.web.charts import board_charts, profile_chart, significance_chart
from leaderboard.web.charts.chart_options import Chart
from leaderboard.web.lookups import split_or_404

N_PROFILES = 5


@require_safe
def charts(request: HttpRequest, split: str) -> HttpResponse:
    board = snapshots.board(split=split_or_404(request, split), viewer=request.user)
    pairs = comparisons.of_first(board=board)
    # What is being computed changes by itself.
    draw = cacheable(_drawn) if all(pair.differences is not None for pair in pairs) else _drawn
    return draw(request, board, pairs)


def _drawn(request: HttpRequest, board: Board, pairs: tuple[Pair, ...]) -> HttpResponse:
    shown = [entry for entry in board.entries if entry.is_visible_to_all]
    context = {
        "board": board,
        "progress": progress(board),
        "latency": board_charts.latency(shown, metric=board.rules.primary),
        "profile": profile_chart.profile(shown[:N_PROFILES]),
        "n_profiles": N_PROFILES,
        "significance": significance_chart.significance(pairs, split=board.split.pk),
        "n_first": comparisons.N_FIRST,
        "resolution": sentences.resolution(
            [pair.differences or {} for pair in comparisons.neighbours(pairs)],
            decimals=board.edition.decimals if board.edition else 2,
        ),
    }
    return render(request, "charts/charts.html", context)


@require_safe
def progress_options(request: HttpRequest, split: str) -> HttpResponse:
    """Answer a split's progress as ECharts options, fetched once the chart comes into view."""
    board = snapshots.board(split=split_or_404(request, split), viewer=request.user)
    return JsonResponse(progress(board).options)


def progress(board: Board) -> Chart:
    shown = [entry for entry in board.entries if entry.is_visible_to_all]
    attempts = snapshots.shown(split=board.split, edition=board.edition).attempts if board.edition else ()
    return board_charts.progress(shown, attempts, metric=board.rules.primary)
