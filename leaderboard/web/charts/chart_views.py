"""The page of a board's charts, and one chart's options for other pages."""

import math
from collections.abc import Sequence
from datetime import datetime

from django.conf import settings
from django.http import HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import render
from django.utils import timezone
from django.views.decorators.http import require_safe

from evaluator.metrics.protocol import grouped_names
from evaluator.scoring.results import format_rounded
from evaluator.tables import sentences
from leaderboard.boards import snapshots
from leaderboard.boards.listing import Board
from leaderboard.boards.rows import Entry
from leaderboard.boards.snapshots import Attempt
from leaderboard.http_caching import cacheable
from leaderboard.statistics import comparisons
from leaderboard.statistics.comparisons import Pair
from leaderboard.web.charts import board_charts, profile_chart, significance_chart
from leaderboard.web.charts.chart_options import Chart
from leaderboard.web.charts.range_leaders import range_leaders, range_words
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
    n_waiting = sum(pair.differences is None for pair in pairs)
    drawn_progress = progress(board, now=timezone.now())
    resolution = _resolution(board, pairs)
    drawn_profile = profile(board)
    n_first = comparisons.N_FIRST if len(pairs) == math.comb(comparisons.N_FIRST, 2) else 0
    context = {
        "board": board,
        "description": f"The {board.split.title} split of {settings.BENCHMARK.name} in charts: "
        "progress over time, accuracy against latency, errors by TTC range.",
        "progress": drawn_progress,
        "latency": board_charts.latency(_public(board), metric=board.rules.primary),
        # It has a line of its own where it would stand beside nothing.
        "is_latency_whole": bool(resolution) != bool(drawn_progress),
        "profile": drawn_profile,
        "profile_note": profile_note(board, drawn_profile),
        "range_leaders": range_leaders(board),
        "significance": significance_chart.significance(pairs, split=board.split.pk),
        "n_pairs": len(pairs),
        "n_waiting": n_waiting,
        # A map of empty cells says less than a sentence.
        "is_early": 2 * n_waiting > len(pairs),
        "cell_words": _cell_words(board.rules.primary.symbol, n_first=n_first),
        "resolution": resolution,
        "alike": significance_chart.alike_words(pairs),
    }
    return render(request, "charts/charts.html", context)


def _cell_words(symbol: str, *, n_first: int) -> str:
    """Say what a cell of the map of pairs is; `n_first` is 0 where it has all submissions."""
    shown = f", for the first {n_first} submissions" if n_first else ""
    return f"Each cell: {symbol} of the row minus {symbol} of the column{shown}. Negative: the row is better."


def _resolution(board: Board, pairs: Sequence[Pair]) -> list[tuple[str, list[str]]]:
    """Return by TTC range the smallest difference that the board can detect, in each metric."""
    tested = [pair.differences for pair in comparisons.neighbours(pairs)]
    # A median of some would change with each that comes.
    known = sentences.resolutions([each for each in tested if each]) if None not in tested else {}
    decimals = board.edition.decimals if board.edition else 2
    rows: dict[str, list[str]] = {}
    for names in grouped_names(board.rules.score_names).values():
        for name in names:
            cells = rows.setdefault(range_words(name), [])
            cells.append(format_rounded(known.get(name), decimals=decimals))
    return list(rows.items()) if known else []


@require_safe
def progress_options(request: HttpRequest, split: str) -> HttpResponse:
    """Answer a split's progress as ECharts options, fetched once the chart comes into view."""
    board = snapshots.board(split=split_or_404(request, split), viewer=request.user)
    return JsonResponse(progress(board, now=timezone.now()).options)


def progress(board: Board, *, now: datetime) -> Chart:
    """Draw the progress of a board; empty with results of fewer than three dates."""
    return board_charts.progress(_public(board), _attempts(board), metric=board.rules.primary, now=now)


def has_progress(board: Board) -> bool:
    return board_charts.has_progress(_public(board), _attempts(board))


def profile(board: Board, *, n_metrics: int | None = None) -> Chart:
    """Draw the errors by TTC range of the first public rows of a board."""
    return profile_chart.profile(_public(board)[:N_PROFILES], n_metrics=n_metrics)


def profile_note(board: Board, drawn: Chart) -> str:
    """Say which rows the chart of errors draws, and what it does not compare."""
    methods = f"The first {N_PROFILES}" if len(_public(board)) > N_PROFILES else "All"
    intervals = ", with 95% confidence intervals where available" if drawn.has_intervals else ""
    note = f"{methods} methods on the board{intervals}."
    if board.rules.primary.name == "mid":
        note += " Do not compare MiD across ranges: at short TTC the image changes faster, so MiD is larger."
    return note


def _public(board: Board) -> list[Entry]:
    # Whatever the reader has filtered or sorted.
    shown = (entry for entry in board.unfiltered if entry.is_visible_to_all)
    return sorted(shown, key=lambda entry: (entry.rank is None, entry.rank, entry.method.casefold()))


def _attempts(board: Board) -> Sequence[Attempt]:
    return snapshots.shown(split=board.split, edition=board.edition).attempts if board.edition else ()
