"""Files with fixed names: robots.txt, sitemap.xml, favicon.ico."""

from collections.abc import Iterator, Sequence
from datetime import datetime
from typing import Final

from django.conf import settings
from django.http import HttpRequest, HttpResponse, HttpResponseRedirect
from django.templatetags.static import static
from django.urls import reverse
from django.views.decorators.http import require_safe

from leaderboard.boards import snapshots
from leaderboard.boards.snapshots import splits_of
from leaderboard.exports import feeds
from leaderboard.models import Edition, Split, Visibility
from leaderboard.pages import texts
from leaderboard.web.docs import api_examples, guides

# Public pages that are about no board.
_NAMED: Final = ("home", "docs", "api_reference")
# Pages of one's own, and views of a page that the page itself offers: its orders, filters and days.
_NOT_FOR_CRAWLERS: Final = (
    "/account/",
    "/accounts/",
    "/admin/",
    "/api/",
    "/maintain/",
    "/submissions/",
    "/team/",
    "/tokens/",
    "/*?",
)


@require_safe
def robots(request: HttpRequest) -> HttpResponse:
    lines = [
        "User-agent: *",
        *(f"Disallow: {path}" for path in _NOT_FOR_CRAWLERS),
        f"Sitemap: {settings.SITE_URL}{reverse('sitemap')}",
    ]
    return HttpResponse("\n".join([*lines, ""]), content_type="text/plain; charset=utf-8")


@require_safe
def favicon(request: HttpRequest) -> HttpResponse:
    return HttpResponseRedirect(static("favicon.ico"))


@require_safe
def sitemap(request: HttpRequest) -> HttpResponse:
    # Private and anonymous methods and withdrawn rows are left out.
    fixed = [
        *map(_absolute, _NAMED),
        *([_absolute("published")] if settings.BENCHMARK.has_paper_tables else []),
        *(_absolute("site_page", name) for name in texts.PAGES),
        *(_absolute("guide", name) for name in guides.files()),
        *(_absolute("api_operation", name) for name in api_examples.EXAMPLES),
    ]
    addresses = [*((address, None) for address in fixed), *_of_boards(splits_of(request))]
    return HttpResponse(feeds.sitemap(addresses), content_type="application/xml; charset=utf-8")


def _of_boards(splits: Sequence[Split]) -> Iterator[tuple[str, datetime | None]]:
    for split in splits:
        for name in ("board", "charts", "editions"):
            yield _absolute(name, split.pk), None
    editions = Edition.objects.filter(split__in=splits).exclude(published_at=None).order_by("split", "number")
    for split_id, number, published_at in editions.values_list("split", "number", "published_at"):
        yield _absolute("edition", split_id, number), published_at
    methods: dict[str, datetime | None] = {}
    for _, drawn in snapshots.shown_on(splits):
        methods |= {
            str(entry.method_id): entry.listed_at
            for entry in drawn.entries
            if entry.method_id and entry.visibility == Visibility.PUBLIC and entry.withdrawn_at is None
        }
    for method_id, listed_at in sorted(methods.items()):
        yield _absolute("method", method_id), listed_at


def _absolute(name: str, *args: object) -> str:
    return settings.SITE_URL + reverse(name, args=args)
