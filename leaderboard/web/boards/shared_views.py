"""What other places show of public rows: the badge of a README, the feed, the pictures of links."""

from typing import Final
from uuid import UUID

from django.conf import settings
from django.contrib.auth.models import AnonymousUser
from django.http import Http404, HttpRequest, HttpResponse, HttpResponseRedirect
from django.templatetags.static import static
from django.urls import reverse
from django.views.decorators.http import require_safe

from leaderboard.boards import snapshots
from leaderboard.boards.snapshots import splits_of
from leaderboard.exports import badges, cards, feeds
from leaderboard.exports.cards import Card
from leaderboard.http import cacheable, matching
from leaderboard.models import Method, Split
from leaderboard.web.boards.board_views import MAIN_SPLIT
from leaderboard.web.context_processors import split_or_404

PARAMETERS: Final = {"split": matching(r"[a-zA-Z0-9_-]{0,32}")}


@require_safe
def badge(request: HttpRequest, method_id: UUID) -> HttpResponse:
    """Rank and MiD of a method on `?split=`, as a drawing for a README."""
    split = split_or_404(request, request.GET.get("split") or MAIN_SPLIT)
    entries = snapshots.board(split=split, viewer=AnonymousUser()).entries
    entry = next((entry for entry in entries if entry.method_id == method_id), None)
    if entry is None and not Method.objects.shown().filter(pk=method_id).exists():
        raise Http404("There is no such method.")
    drawn = badges.svg(label=f"TSTTC {split.pk}", text=badges.words(entry))
    # Browsers show it on the pages of others, which they may not do with anything else of here.
    others = {"Cross-Origin-Resource-Policy": "cross-origin"}
    return HttpResponse(drawn, content_type="image/svg+xml", headers=others)


@require_safe
def feed(request: HttpRequest, split: str = "") -> HttpResponse:
    """New entries of one split, or of all."""
    rows = [split_or_404(request, split)] if split else splits_of(request)
    where = f": {rows[0].title}" if split else ""
    text = feeds.atom(
        _items(rows),
        title=f"{settings.SITE_NAME}{where}, new entries",
        address=settings.SITE_URL + request.path,
        page=settings.SITE_URL + (reverse("board", args=[split]) if split else reverse("home")),
    )
    return HttpResponse(text, content_type="application/atom+xml; charset=utf-8")


def _items(rows: list[Split]) -> list[feeds.Item]:
    return [
        feeds.Item(split, entry, settings.SITE_URL + reverse("method", args=[entry.method_id]))
        for split, drawn in snapshots.shown_on(rows)
        for entry in drawn.entries
        if feeds.is_news(entry)
    ]


# What links show of every page that has no picture of its own.
EVERY_PAGE = "card.jpg"


@require_safe
def board_card(request: HttpRequest, split: str) -> HttpResponse:
    """The first rows of a board."""
    found = split_or_404(request, split)
    entries = snapshots.board(split=found, viewer=AnonymousUser()).entries
    return _picture(cards.of_board(found, entries))


@require_safe
def method_card(request: HttpRequest, method_id: UUID) -> HttpResponse:
    """A method's place on each board, as everybody sees it."""
    card = cards.of_method(cards.results_of(method_id, splits_of(request)))
    if card is None and not Method.objects.shown().filter(pk=method_id).exists():
        raise Http404("There is no such method.")
    return _picture(card)


def _picture(card: Card | None) -> HttpResponse:
    """The card, or the picture of every page: while no worker has drawn it, or where it cannot be drawn."""
    png = cards.kept(card) if card else None
    return _drawn(png) if png else HttpResponseRedirect(static(EVERY_PAGE))


def _response(png: bytes) -> HttpResponse:
    # Others show it on their pages, which they may not do with anything else of here but badges.
    return HttpResponse(
        png, content_type="image/png", headers={"Cross-Origin-Resource-Policy": "cross-origin"}
    )


# A picture that is drawn holds as long as the boards do; one that is not changes by itself.
_drawn = cacheable(_response)
