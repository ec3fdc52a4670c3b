"""Pages of documentation, those of maintainers, and the wheel.

Most answer without the database. Long pages are compressed here: not every site has a proxy that does so.
"""

import threading
from collections.abc import Mapping
from typing import Any, Final

from django.http import Http404, HttpRequest, HttpResponse, HttpResponseBase
from django.shortcuts import render
from django.urls import reverse
from django.urls.converters import StringConverter
from django.utils import timezone
from django.utils.text import slugify
from django.views.decorators.gzip import gzip_page
from django.views.decorators.http import require_safe

from leaderboard.boards.snapshots import splits_of
from leaderboard.ops import downloads, rate_limits
from leaderboard.pages import texts
from leaderboard.pages.texts import PAGES
from leaderboard.web import markdown
from leaderboard.web.docs import api_examples, api_reference, guides, reference, search, wheels
from leaderboard.web.docs.guides import GuideLink
from leaderboard.web.markdown import TextHeading

# A search reads every guide, so a process makes few at a time, and has threads left for other pages.
SEARCHES_AT_ONCE: Final = 2
AGAIN_S: Final = 1
_searching: Final = threading.BoundedSemaphore(SEARCHES_AT_ONCE)

_CHAPTERS_OF_API: Final = [
    *(TextHeading(3, title, f"group-{slugify(title)}") for title in api_reference.GROUPS),
    TextHeading(2, "Problem codes", "problems"),
    TextHeading(2, "Objects", "shapes"),
]
_CHAPTERS_AT_A_GLANCE: Final = [
    TextHeading(2, "Submit in four steps", "submit"),
    TextHeading(2, "The prediction file", "format"),
    TextHeading(2, "What is rejected", "problems"),
    TextHeading(2, "Metrics and TTC ranges", "metrics"),
    TextHeading(2, "Protocol", "scoring"),
    TextHeading(2, "Uncertainty", "uncertainty"),
    TextHeading(2, "What is published", "published"),
    TextHeading(2, "API", "api"),
]


def _navigation(address: str) -> list[tuple[str, list[GuideLink], bool]]:
    """Return the sections of the navigation, and whether each is open: the page's own, or all without one."""
    sections = guides.navigation()
    has_page = [any(link.address == address for link in links) for _, links in sections]
    is_in_one = any(has_page[1:])
    return [(*section, has_it or not is_in_one) for section, has_it in zip(sections, has_page, strict=True)]


@gzip_page
@require_safe
def docs(request: HttpRequest) -> HttpResponse:
    facts = reference.docs(splits_of(request), now=timezone.now())
    context = {"navigation": _navigation(request.path), "wheel": wheels.current(), **facts}
    context["guide"] = {"chapters": _CHAPTERS_AT_A_GLANCE}
    return render(request, "docs/docs.html", context)


@gzip_page
@require_safe
def guide(request: HttpRequest, guide_name: str) -> HttpResponse:
    if guide_name not in guides.files():
        raise Http404(f"There is no guide {guide_name!r}.")
    before, after = guides.neighbours(guide_name)
    above = reverse("guide", args=["decisions"]) if guide_name.startswith("adr/") else ""
    context = {
        "navigation": _navigation(above or request.path),
        "guide": guides.guide(guide_name),
        "before": before,
        "after": after,
        "above": above,
    }
    return render(request, "docs/guide.html", context)


@gzip_page
@require_safe
def find(request: HttpRequest) -> HttpResponse:
    query = " ".join(request.GET.get("q", "").replace("\x00", " ").split())[: search.MAX_QUERY]
    if not _searching.acquire(blocking=False):
        sentence = rate_limits.refusal(AGAIN_S)
        response = render(request, "429.html", {"sentence": sentence}, status=429)
        response["Retry-After"] = str(AGAIN_S)
        return response
    try:
        hits = search.find(query) if query else []
    finally:
        _searching.release()
    navigation = _navigation(request.path)
    context = {"navigation": navigation, "query": query, "hits": hits, "most": search.MAX_HITS}
    return render(request, "docs/search.html", context)


def _chapters(operation: Mapping[str, Any]) -> list[TextHeading]:
    parameters = "Parameters and body" if operation["bodies"] else "Parameters"
    return [
        TextHeading(2, "Request", "request"),
        TextHeading(3, parameters, "parameters"),
        TextHeading(2, "Response", "answer"),
        *([TextHeading(2, "Fields", "fields")] if operation["objects"] else []),
        TextHeading(2, "Errors", "errors"),
    ]


@gzip_page
@require_safe
def api_operation(request: HttpRequest, operation_id: str) -> HttpResponse:
    operations = api_reference.reference()["operations"]
    operation = next((each for each in operations if each["id"] == operation_id), None)
    if operation is None:
        raise Http404(f"There is no operation {operation_id!r}.")
    context = {
        "navigation": _navigation(reverse("api_reference")),
        "guide": {"chapters": _chapters(operation)},
        "operation": operation,
        "example": api_examples.shown(operation_id),
        "above": reverse("api_reference"),
    }
    return render(request, "docs/api_operation.html", context)


@gzip_page
@require_safe
def api_page(request: HttpRequest) -> HttpResponse:
    context = {
        "navigation": _navigation(request.path),
        "guide": {"chapters": _CHAPTERS_OF_API},
        "api": api_reference.reference(),
    }
    return render(request, "docs/api_reference.html", context)


class PageConverter(StringConverter):
    regex = "|".join(PAGES)


@require_safe
def site_page(request: HttpRequest, page_name: str) -> HttpResponse:
    version = texts.current(page_name)
    text = version.text if version else texts.default_text(page_name)
    context = {"page": PAGES[page_name], "version": version, "text": markdown.page(text)}
    return render(request, "pages/page.html", context)


@require_safe
def dist(request: HttpRequest) -> HttpResponse:
    wheel = wheels.current()
    context = {"navigation": _navigation(request.path), "wheel": wheel}
    return render(request, "docs/install.html", context, status=200 if wheel else 404)


@require_safe
def dist_file(request: HttpRequest, wheel_name: str) -> HttpResponseBase:
    path = next((each for each in wheels.files() if each.name == wheel_name), None)
    if path is None:
        raise Http404(f"There is no wheel {wheel_name!r}.")
    n_bytes = path.stat().st_size
    return downloads.file_response(
        path.open("rb"), n_bytes=n_bytes, as_attachment=True, content_type="application/zip"
    )
