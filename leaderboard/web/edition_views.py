"""The pages of published editions: the list of them with the changelog, and each at an address that stays."""

from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, render
from django.views.decorators.http import require_safe

from leaderboard import editions as verbs
from leaderboard.models import Edition, Split
from leaderboard.web import edition_tables, tables
from leaderboard.web.views import draw_board


@require_safe
def editions(request: HttpRequest, split: str) -> HttpResponse:
    """Every edition that ever was a split's board, and why each became it."""
    found = get_object_or_404(Split.objects.select_related("published_edition"), pk=split)
    rows = edition_tables.past_rows(verbs.history(found))
    log = verbs.changelog(found)
    return render(request, "editions/editions.html", {"split": found, "rows": rows, "changelog": log})


@require_safe
def edition(request: HttpRequest, split: str, number: int) -> HttpResponse:
    """The board of one edition, for ever."""
    rows = Edition.objects.exclude(published_at=None)
    rows = rows.select_related("split__published_edition", "ground_truth")
    found = get_object_or_404(rows, split=split, number=number)
    return draw_board(
        request,
        "editions/edition.html",
        split=found.split,
        edition=found,
        row=edition_tables.past_row(verbs.past(found)),
        intervals=tables.interval_facts(found.ground_truth.counts),
    )
