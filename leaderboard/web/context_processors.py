"""What every page knows: the site's name, where the reader is, and the splits to go to."""

from typing import Any

from django.conf import settings
from django.http import Http404, HttpRequest
from django.utils.functional import SimpleLazyObject

from leaderboard import snapshots
from leaderboard.models import Split

_SECTIONS = {
    "home": "board",
    "board": "board",
    "edition": "board",
    "editions": "board",
    "method": "board",
    "compare": "board",
    "charts": "board",
    "submit": "submit",
    "submissions": "submissions",
    "submission": "submissions",
    "analysis": "submissions",
    "withdraw": "submissions",
    "method_edit": "board",
    "method_visibility": "board",
    "team": "account",
    "join_team": "account",
    "invite": "account",
    "tokens": "account",
    "docs": "docs",
    "api_reference": "api",
}
_PREFIXES = {"account_": "account", "maintain": "maintain"}


def splits_of(request: HttpRequest) -> list[Split]:
    """Every split, with what is kept of its board; asked for once a request."""
    found: list[Split] | None = getattr(request, "splits", None)
    if found is None:
        found = snapshots.splits()
        request.splits = found  # type: ignore[attr-defined]  # our own, as `user` is Django's
    return found


def split_or_404(request: HttpRequest, name: str) -> Split:
    """The split of that name."""
    found = next((split for split in splits_of(request) if split.pk == name), None)
    if found is None:
        raise Http404(f"There is no split {name!r}.")
    return found


def site(request: HttpRequest) -> dict[str, Any]:
    """The frame's context. The splits are asked for only by pages that list them."""
    match = getattr(request, "resolver_match", None)
    name = (match.url_name or "") if match else ""
    return {
        "site_name": settings.SITE_NAME,
        "site_url": settings.SITE_URL,
        "section": next(
            (section for prefix, section in _PREFIXES.items() if name.startswith(prefix)),
            _SECTIONS.get(name, ""),
        ),
        "splits": SimpleLazyObject(lambda: splits_of(request)),
    }
