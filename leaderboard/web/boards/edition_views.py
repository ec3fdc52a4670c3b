"""The pages of published editions: the list of them with the changelog, and each at an address that stays."""

from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, render
from django.views.decorators.http import require_safe

from leaderboard import editions as verbs
from leaderboard import snapshots
from leaderboard.web import edition_tables, tables
from leaderboard.web.context import split_or_404
from leaderboard.web.views import draw_board


@require_safe
def editions(request: HttpRequest, split: str) -> HttpResponse:
    """Every edition that ever was a split's board, and why each became it."""
    found = split_or_404(request, split)
    log = verbs.changelog(found)
    rows = edition_tables.past_rows(verbs.history(found, log))
    return render(request, "editions/editions.html", {"split": found, "rows": rows, "changelog": log})


@require_safe
def edition(request: HttpRequest, split: str, number: int) -> HttpResponse:
    """The board of one edition, for ever."""
    found = get_object_or_404(snapshots.editions(), split=split, number=number)
    return draw_board(
        request,
        "editions/edition.html",
        split=found.split,
        edition=found,
        row=edition_tables.past_row(verbs.past(found)),
        intervals=tables.interval_facts(found.ground_truth.counts),
    )
