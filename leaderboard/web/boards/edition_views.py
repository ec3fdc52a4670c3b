"""The pages of published editions: the list of them with the changelog, and each at a permanent address."""

from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, render
from django.views.decorators.http import require_safe

from leaderboard.boards import snapshots
from leaderboard.editions import history
from leaderboard.web.boards import edition_tables, tables
from leaderboard.web.boards.board_views import draw_board
from leaderboard.web.context_processors import split_or_404


@require_safe
def editions(request: HttpRequest, split: str) -> HttpResponse:
    """Every edition that ever was a split's board, and why each became it."""
    found = split_or_404(request, split)
    log = history.changelog(found)
    rows = [(past, edition_tables.past_change(past)) for past in history.history(found, log)]
    return render(request, "boards/editions/editions.html", {"split": found, "rows": rows, "changelog": log})


@require_safe
def edition(request: HttpRequest, split: str, number: int) -> HttpResponse:
    """The board of one edition, for ever."""
    found = get_object_or_404(snapshots.editions(), split=split, number=number)
    past = history.record_of(found)
    return draw_board(
        request,
        "boards/editions/edition.html",
        split=found.split,
        edition=found,
        past=past,
        change=edition_tables.past_change(past),
        intervals=tables.counted_ranges(found.rules, found.ground_truth.counts),
    )
