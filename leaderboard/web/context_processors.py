"""Context of every page: the benchmark, the section, and the splits."""

from typing import Any

from django.conf import settings
from django.http import HttpRequest
from django.utils import timezone
from django.utils.functional import SimpleLazyObject

from leaderboard.boards.snapshots import site_line_of, splits_of
from leaderboard.models import PageVersion
from leaderboard.people import addresses
from leaderboard.web.lookups import page_before

# The first that a path begins with is its section in the navigation.
_SECTIONS = {
    "/board/": "board",
    "/methods/": "board",
    "/compare/": "board",
    "/submit/": "submit",
    "/submissions/": "submissions",
    "/accounts/logout/": "",
    "/account": "account",
    "/team/": "account",
    "/tokens/": "account",
    "/mails/": "account",
    "/docs/api/": "api",
    "/docs/": "docs",
    "/dist/": "docs",
    "/published/": "published",
    "/maintain/": "maintain",
}


def _board_split(request: HttpRequest) -> str:
    match = getattr(request, "resolver_match", None)
    name = match.kwargs.get("split", "") if match and _section(request) == "board" else ""
    return name if name and any(split.pk == name for split in splits_of(request)) else ""


def site(request: HttpRequest) -> dict[str, Any]:
    # Lazy: only some pages list the splits.
    return {
        "benchmark": settings.BENCHMARK,
        "site_url": settings.SITE_URL,
        "section": _section(request),
        # Those that people can sign in with: the word in addresses, and the name that people know.
        "providers": [(name, set_["APP"]["name"]) for name, set_ in settings.SOCIALACCOUNT_PROVIDERS.items()],
        "proves_addresses": addresses.are_proved(),
        "splits": SimpleLazyObject(lambda: splits_of(request)),
        "announcements": _announcements(request),
        "came_from": SimpleLazyObject(lambda: _came_from(request)),
        # Views of pages that are about a board without its name in their address say it themselves.
        "board_split": _board_split(request),
    }


def _announcements(request: HttpRequest) -> list[tuple[str, str]]:
    """Return the site's announcement without a title, and those of splits with theirs.

    A page of one split has only its own; the form of submissions has each beside its split.
    """
    now, only = timezone.now(), _board_split(request)
    if _section(request) == "submit":
        line = PageVersion.announcement().filter(ends_at__gt=now).values_list("text", flat=True).first()
        lines = [("", line or "")]
    elif hasattr(request, "splits"):
        splits = splits_of(request)
        own = [(each.title, each.announcement_at(now)) for each in splits if only in {"", each.pk}]
        lines = [("", site_line_of(splits, now=now)), *own]
    else:  # no other page asks the database for it
        lines = []
    return [(title, line) for title, line in lines if line]


def _section(request: HttpRequest) -> str:
    return next((name for start, name in _SECTIONS.items() if request.path_info.startswith(start)), "")


def _came_from(request: HttpRequest) -> str:
    path = page_before(request)
    return "" if path == request.get_full_path() else path
