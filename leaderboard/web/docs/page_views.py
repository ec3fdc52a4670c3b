"""The pages that maintainers write, as visitors read them."""

from django.http import HttpRequest, HttpResponse
from django.shortcuts import render
from django.views.decorators.http import require_safe

from leaderboard.pages import pages
from leaderboard.pages.pages import PAGES
from leaderboard.web import markdown


class PageConverter:
    """The name of a page, in an address."""

    regex = "|".join(PAGES)

    def to_python(self, value: str) -> str:
        """The name itself."""
        return value

    def to_url(self, value: str) -> str:
        """The name itself."""
        return value


@require_safe
def site_page(request: HttpRequest, page_name: str) -> HttpResponse:
    """Rules, contact, privacy, imprint or licence."""
    version = pages.current(page_name)
    text = version.text if version else pages.default_text(page_name)
    context = {"page": PAGES[page_name], "version": version, "text": markdown.page(text)}
    return render(request, "pages/page.html", context)
