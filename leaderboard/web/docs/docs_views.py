"""Pages of documentation, those of maintainers, and the wheel.

Most answer without the database. Long pages are compressed here: not every site has a proxy that does so.
"""

import threading
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

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


class NavigationSection(NamedTuple):
    """Some links of the side navigation.

    Each has the value of its `aria-current`: "page", "true" for the page above this one, or nothing.
    """

    title: str
    links: list[tuple[GuideLink, str]]
    is_open: bool


def _navigation(address: str, *, above: str = "") -> list[NavigationSection]:
    """Return the sections, of which the page's own is open; all are, if the page is in none with a title."""
    current = {above: "true", address: "page"}
    sections = []
    for title, links in guides.navigation():
        marked = [(link, current.get(link.address, "")) for link in links]
        sections.append((title, marked, any(mark for _, mark in marked)))
    is_in_one = any(is_open for title, _, is_open in sections if title)
    return [NavigationSection(title, links, is_open or not is_in_one) for title, links, is_open in sections]


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
        "navigation": _navigation(request.path, above=above),
        "guide": guides.guide(guide_name),
        "before": before,
        "after": after,
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
    context = {
        "navigation": _navigation(request.path),
        "query": query,
        "hits": hits,
        "count_words": count_words(len(hits)),
    }
    return render(request, "docs/search.html", context)


def count_words(n_hits: int) -> str:
    """Say how many parts of the guides a search has found.

    >>> count_words(1), count_words(2), count_words(search.MAX_HITS)
    ('1 result', '2 results, best page first', 'The 12 best results, best page first')
    """
    if n_hits == 1:
        return "1 result"
    if n_hits < search.MAX_HITS:
        return f"{n_hits} results, best page first"
    return f"The {search.MAX_HITS} best results, best page first"


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
        "navigation": _navigation(request.path, above=reverse("api_reference")),
        "guide": {"chapters": _chapters(operation)},
        "operation": operation,
        "example": api_examples.shown(operation_id),
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
