"""Addresses of pages name what is set: a form without JavaScript sends its empty fields too.

Links are read and shared: `/board/test/?q=box`, not `/board/test/?q=box&frames=&cameras=&boxes=&…`.
"""

import re
from collections.abc import Callable
from typing import Final
from urllib.parse import urlencode

from django.http import HttpRequest, HttpResponse, HttpResponseRedirect, QueryDict

# Programs' addresses stay as they are: whoever asks for them may not follow redirects.
ELSEWHERE: Final = ("/api/", "/admin/")
_EMPTY = re.compile(r"=(&|$)")


class CleanAddressMiddleware:
    """Leads from a page's address with empty parameters to the same without them."""

    def __init__(self, get_response: Callable[[HttpRequest], HttpResponse]) -> None:
        self._get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponse:
        query = request.META.get("QUERY_STRING", "")
        if not _EMPTY.search(query) or not _is_of_a_page(request):
            return self._get_response(request)
        given = QueryDict(query)
        pairs = [(name, text) for name, texts in given.lists() for text in texts if text]
        return HttpResponseRedirect(request.path + (f"?{urlencode(pairs)}" if pairs else ""))


def _is_of_a_page(request: HttpRequest) -> bool:
    return (
        request.method in {"GET", "HEAD"}
        and request.path_info.endswith("/")
        # A path of two slashes would name another host where it is linked.
        and not request.path_info.startswith(("//", *ELSEWHERE))
        and "HTTP_HX_REQUEST" not in request.META
    )
