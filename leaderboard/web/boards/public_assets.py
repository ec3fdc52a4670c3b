"""Public rows on other sites: badge and feed."""

from uuid import UUID

from django.conf import settings
from django.contrib.auth.models import AnonymousUser
from django.http import Http404, HttpRequest, HttpResponse
from django.urls import reverse
from django.views.decorators.http import require_safe

from leaderboard.boards import snapshots
from leaderboard.boards.snapshots import splits_of
from leaderboard.exports import badges, feeds
from leaderboard.models import Method
from leaderboard.web.lookups import split_or_404


@require_safe
def badge(request: HttpRequest, method_id: UUID) -> HttpResponse:
    """Draw rank and score of a method on `?split=`."""
    split = split_or_404(request, request.GET.get("split") or settings.BENCHMARK.default_split)
    entries = snapshots.board(split=split, viewer=AnonymousUser()).entries
    entry = next((entry for entry in entries if entry.method_id == method_id), None)
    if entry is None and not Method.objects.shown().filter(pk=method_id).exists():
        raise Http404("There is no such method.")
    drawn = badges.svg(label=f"{settings.BENCHMARK.name} {split.pk}", text=badges.words(entry))
    # Browsers show it on the pages of others, which they may not do with anything else of here.
    others = {"Cross-Origin-Resource-Policy": "cross-origin"}
    return HttpResponse(drawn, content_type="image/svg+xml", headers=others)


@require_safe
def feed(request: HttpRequest, split: str = "") -> HttpResponse:
    rows = [split_or_404(request, split)] if split else splits_of(request)
    where = f": {rows[0].title}" if split else ""
    text = feeds.atom(
        (
            (split, entry)
            for split, shown in snapshots.shown_on(rows)
            for entry in shown.entries
            if feeds.is_news(entry)
        ),
        title=f"{settings.BENCHMARK.site_name}{where}, new entries",
        address=settings.SITE_URL + request.path,
        page=settings.SITE_URL + (reverse("board", args=[split]) if split else reverse("home")),
    )
    return HttpResponse(text, content_type="application/atom+xml; charset=utf-8")
