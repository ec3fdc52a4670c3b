"""The pictures that links to boards and methods show elsewhere."""

from uuid import UUID

from django.contrib.auth.models import AnonymousUser
from django.http import Http404, HttpRequest, HttpResponse, HttpResponseRedirect
from django.templatetags.static import static
from django.views.decorators.http import require_safe

from leaderboard.boards import snapshots
from leaderboard.boards.snapshots import splits_of
from leaderboard.exports import cards
from leaderboard.exports.cards import Card
from leaderboard.http import cacheable
from leaderboard.models import Method
from leaderboard.web.context_processors import split_or_404

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
