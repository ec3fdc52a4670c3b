"""The landing page, and the redirect to the main board."""

from collections.abc import Sequence
from datetime import datetime
from typing import Any
from urllib.parse import urlencode

from django.conf import settings
from django.contrib.auth.models import AnonymousUser
from django.http import Http404, HttpRequest, HttpResponse, HttpResponseRedirect
from django.shortcuts import render
from django.urls import reverse
from django.utils import timezone
from django.views.decorators.http import require_safe

from leaderboard.boards import snapshots
from leaderboard.boards.listing import rules_of
from leaderboard.boards.snapshots import splits_of
from leaderboard.models import Split, User
from leaderboard.quotas import admissions
from leaderboard.web.boards import board_query
from leaderboard.web.charts import chart_views, profile_chart
from leaderboard.web.charts.range_leaders import range_leaders
from leaderboard.web.landing.leaders import N_LEADERS, lead_words, leaders
from leaderboard.web.landing.news import latest
from leaderboard.web.submissions.forms import offers_for


@require_safe
def home(request: HttpRequest) -> HttpResponse:
    splits = splits_of(request)
    main, now = main_split(splits), timezone.now()
    in_order = [main, *splits] if main else []
    open_split = next((split for split in in_order if admissions.is_open(split, now=now)), None)
    context = {
        "open_split": open_split,
        "submit_words": _submit_words(open_split, main=main) if open_split else "",
        "facts": [*_counts(in_order), *settings.BENCHMARK.landing.facts, *_ranges(main)],
        "dates": _dates(splits, reader=request.user, now=now),
        "news": latest(splits),
        "edition_split": next((split.pk for split in in_order if split.current_edition), ""),
    }
    return render(request, "landing/home.html", context | (_leading(main, now=now) if main else {}))


@require_safe
def main_board(request: HttpRequest) -> HttpResponse:
    """Redirect to the main board with the query of the address."""
    main = main_split(splits_of(request))
    if main is None:
        raise Http404("There is no board yet.")
    asked = {name: request.GET[name] for name in board_query.NAMES if request.GET.get(name)}
    address = reverse("board", args=[main.pk])
    return HttpResponseRedirect(f"{address}?{urlencode(asked)}" if asked else address)


def main_split(splits: Sequence[Split]) -> Split | None:
    """Return the benchmark's first board, else the first split."""
    name = settings.BENCHMARK.default_split
    return next((split for split in splits if split.pk == name), next(iter(splits), None))


def _submit_words(open_split: Split, *, main: Split | None) -> str:
    """Name the button that leads to the form of submissions."""
    if open_split == main:
        return "Submit"
    if open_split.is_simulated:
        return f"Try a submission ({open_split.title.lower()})"
    return f"Submit to {open_split.title}"


def _counts(splits: Sequence[Split]) -> list[tuple[str, str]]:
    """Count the sequences and recordings of the first real ground truth."""
    for split in splits:
        if split.current_edition is not None and not split.is_simulated:
            truth = split.current_edition.ground_truth
            sequences = (f"{truth.n_sequences:,}", f"sequences in {split.title}")
            return [sequences, (f"{truth.n_recordings:,}", "recordings")]
    return []


def _ranges(main: Split | None) -> list[tuple[str, str]]:
    ranges = rules_of(main.current_edition if main else None).ranges
    return [(f"{len(ranges)} TTC ranges", ", ".join(each.ends for each in ranges) + " s")]


def _dates(
    splits: Sequence[Split], *, reader: User | AnonymousUser, now: datetime
) -> list[tuple[Split, str]]:
    """Say when each split takes submissions; to members also what their team has left."""
    if reader.is_authenticated:
        return [(offer.split, offer.sentence) for offer in offers_for(reader, now=now)]
    return [
        (split, admissions.sentence_of(split, now=now) or f"Submissions to {split.title} are open.")
        for split in splits
    ]


def _leading(main: Split, *, now: datetime) -> dict[str, Any]:
    # Only what everybody sees, for every reader.
    board = snapshots.board(split=main, viewer=AnonymousUser())
    return {
        "board": board,
        "leaders": leaders(board),
        "lead": lead_words(board),
        "range_leaders": range_leaders(board)[1:],  # who leads overall stands above
        "profile": profile_chart.profile(board.entries[:N_LEADERS], n_metrics=2),
        "progress": chart_views.progress(board, now=now),
    }
