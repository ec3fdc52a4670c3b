"""A cache of answers that are the same for all anonymous readers (`http_caching.cacheable`).

They change only with the boards' versions and the day, which are in the key, so a cached answer is current.
Each process has two bounded caches, for plain addresses and for those with a query, so that invented queries
push out no plain page. Answers are kept compressed, at an eighth of the memory.
"""

import gzip
import hashlib
import re
from collections.abc import Callable
from typing import Any, Final, NamedTuple
from urllib.parse import urlencode

from django.conf import settings
from django.contrib.messages.storage.cookie import CookieStorage
from django.core.cache import caches
from django.core.exceptions import DisallowedHost
from django.http import HttpRequest, HttpResponse, HttpResponseBase, HttpResponseNotModified
from django.utils import timezone

from leaderboard import board_versions
from leaderboard.boards import filters
from leaderboard.http_caching import is_cacheable, is_known
from leaderboard.web.middleware.sessions import SessionStore

Next = Callable[[HttpRequest], HttpResponseBase]

# Where such views are; elsewhere no request asks for the number.
PREFIXES: Final = (
    *("/board/", "/methods/", "/compare/", "/feed", "/sitemap", "/api/v1/splits", "/api/v1/methods/"),
)
# All that such views read of an address. What else it names is dropped, such as what a social network adds.
KNOWN: Final = frozenset(
    {
        *(
            "at",
            "sort",
            "columns",
            *filters.FILTERS,
            "page",
            "intervals",
            "mine",
            "limit",
            "after",
            "edition",
        ),
        *("split", "m", "with"),
    }
)
MAX_BYTES: Final = 1_000_000  # of an answer that is kept, compressed
# "gzip;q=0" asks for anything but that.
_GZIP: Final = re.compile(r"\bgzip\b(?!\s*;\s*q=0(?:\.0*)?\s*(?:,|$))")
# Boards of other times are drawn for their one reader, and counted; of days there are few.
_DAY: Final = re.compile("[0-9]{4}-[0-9]{2}-[0-9]{2}")
# Shared caches may keep it, but ask every time whether it holds.
ANYBODYS: Final = "public, no-cache"
VARY: Final = "Accept-Encoding, Authorization, Cookie, HX-Request"
# Of the headers that a view sets, those that are everybody's. What is left of a rate, say, is one reader's.
SHARED_HEADERS: Final = (
    *("Content-Type", "Content-Disposition", "Content-Language", "Link", "Allow"),
    "Cross-Origin-Resource-Policy",
)
# A browser lets this one of a 304 replace what it has kept: left out, a badge would be forbidden elsewhere.
HEADER_OF_304: Final = "Cross-Origin-Resource-Policy"


class PublicAnswer(NamedTuple):
    """A cached answer: digest, headers, compressed bytes."""

    digest: str
    headers: dict[str, str]
    packed: bytes


class PublicAnswersMiddleware:
    def __init__(self, get_response: Next) -> None:
        self._get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponseBase:
        path = request.path_info
        if not (path == "/" or path.startswith(PREFIXES)) or not is_cacheable_request(request):
            return self._get_response(request)
        at = request.GET.get("at", "")
        if at and not _DAY.fullmatch(at):
            return self._get_response(request)
        query = urlencode([(name, text) for name in sorted(KNOWN) for text in request.GET.getlist(name)])
        request.known_query = query  # type: ignore[attr-defined]  # our own, as `user` is Django's
        # Before the view looks: what it reads may be newer than this number, and is never older.
        text = f"{path}?{query} {board_versions.sum_of_all()} {timezone.now():%Y-%m-%d}"
        key = hashlib.sha256(text.encode()).hexdigest()
        cache = caches["views" if query else "boards"]
        kept = cache.get(key)
        if kept is None:
            response: Any = self._get_response(request)
            is_whole = is_cacheable(response) and response.status_code == 200 and not response.cookies
            if request.method == "HEAD" or not is_whole:
                return response
            kept = _answer_of(response)
            if len(kept.packed) <= MAX_BYTES:
                cache.set(key, tuple(kept))
        return _response(request, PublicAnswer(*kept))


def is_cacheable_request(request: HttpRequest) -> bool:
    """Tell whether the request is an anonymous GET or HEAD of a whole page, under one of our host names."""
    return (
        request.method in {"GET", "HEAD"}
        and not ("HTTP_AUTHORIZATION" in request.META and request.path_info.startswith("/api/"))
        and _is_ours(request)
        and not _has_message(request)
        and not _has_session(request)
    )


# Anybody can make up a cookie or a header, and a page that is drawn costs twenty times as much as a kept one.
# Pages know nobody by `Authorization`, and none of these answers is a part of a page for htmx.
def _has_session(request: HttpRequest) -> bool:
    key = request.COOKIES.get(settings.SESSION_COOKIE_NAME)
    return key is not None and SessionStore().exists(key)


def _has_message(request: HttpRequest) -> bool:
    return CookieStorage.cookie_name in request.COOKIES and len(CookieStorage(request)) > 0


def _is_ours(request: HttpRequest) -> bool:
    # Other host names are refused by later layers.
    try:
        request.get_host()
    except DisallowedHost:
        return False
    return True


def _answer_of(response: HttpResponse) -> PublicAnswer:
    headers = {name: response[name] for name in SHARED_HEADERS if response.has_header(name)}
    # The same bytes compress to the same: a moment within would give each process its own.
    packed = gzip.compress(response.content, 6, mtime=0)
    return PublicAnswer(hashlib.sha256(response.content).hexdigest()[:32], headers, packed)


def _response(request: HttpRequest, kept: PublicAnswer) -> HttpResponse:
    """Answer one reader: 304 if they have it, compressed if they accept that."""
    is_packed = _GZIP.search(request.META.get("HTTP_ACCEPT_ENCODING", "")) is not None
    etag = f'"{kept.digest}-gz"' if is_packed else f'"{kept.digest}"'
    response: HttpResponse
    if is_known(request, etag):
        response = HttpResponseNotModified()
        if HEADER_OF_304 in kept.headers:
            response[HEADER_OF_304] = kept.headers[HEADER_OF_304]
    else:
        body = kept.packed if is_packed else gzip.decompress(kept.packed)
        response = HttpResponse(b"" if request.method == "HEAD" else body, headers=kept.headers)
        response["Content-Length"] = str(len(body))
        if is_packed:
            response["Content-Encoding"] = "gzip"
    response["ETag"] = etag
    response["Cache-Control"] = ANYBODYS
    response["Vary"] = VARY
    return response
