"""What every page knows: the site's name, where the reader is, and the splits to go to."""

from typing import Any

from django.conf import settings
from django.http import HttpRequest

from leaderboard.models import Split

_SECTIONS = {
    "home": "board",
    "board": "board",
    "edition": "board",
    "editions": "board",
    "method": "board",
    "submit": "submit",
    "submissions": "submissions",
    "submission": "submissions",
    "withdraw": "submissions",
    "tokens": "account",
    "docs": "docs",
    "api_reference": "api",
}
_PREFIXES = {"account_": "account", "maintain": "maintain"}


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
        "splits": Split.objects.select_related("published_edition"),
    }
