"""The page of a board's charts: everything in them stands on the board as well."""

from django.http import HttpRequest, HttpResponse
from django.shortcuts import render
from django.views.decorators.http import require_safe

from leaderboard import snapshots
from leaderboard.web import charts
from leaderboard.web.context import split_or_404

N_PROFILES = 5


@require_safe
def board_charts(request: HttpRequest, split: str) -> HttpResponse:
    """Progress over time, accuracy against latency, and the best methods over the intervals."""
    found = split_or_404(request, split)
    board = snapshots.board(split=found, viewer=request.user)
    shown = [entry for entry in board.entries if entry.is_visible_to_all]
    attempts = snapshots.shown(split=found, edition=board.edition).attempts if board.edition else ()
    context = {
        "board": board,
        "progress": charts.progress(shown, attempts),
        "latency": charts.latency(shown),
        "profile": charts.profile(shown[:N_PROFILES]),
        "n_profiles": N_PROFILES,
    }
    return render(request, "charts/charts.html", context)
