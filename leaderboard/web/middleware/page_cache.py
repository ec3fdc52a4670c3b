"""The page cache: responses that are the same for all anonymous readers, kept in the process's memory.

Whoever brings neither a session nor a token is anybody. What such a reader is shown changes only with the
version of some split's boards (`leaderboard/versions.py`) and with the day, so one statement tells whether an
answer still holds: none is old but a late one, which says so. A view says with `http.cacheable` that
this is so of its answer. The middleware stands before sessions and accounts, so that anybody's question costs
neither.

An answer is remembered under its path and the query parameters that its view reads, each once, in one order;
what else an address names is dropped before the view is asked, so that no page repeats it. Texts that anybody
can make up any number of (a search, a limit, a time) are answered and not remembered, and answers to queries
have a shelf of their own: however many are asked for, they push out no plain page.

Most answers need no other layer at all: once one has been out through all of them, with the headers that each
adds, `ReadyAnswerMiddleware`, which stands before them, repeats it.

Answers carry a strong ETag, the digest of their bytes, and are compressed for whoever takes gzip. There is no
secret of the reader in them, so that their compressed length betrays none.
"""

import gzip
import hashlib
import io
import re
import sys
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from datetime import date
from functools import lru_cache
from typing import Any, Final, NamedTuple
from urllib.parse import urlencode

from django.conf import settings
from django.contrib.messages.storage.cookie import CookieStorage
from django.core.exceptions import DisallowedHost
from django.http import (
    HttpRequest,
    HttpResponse,
    HttpResponseBase,
    HttpResponseNotModified,
    QueryDict,
    StreamingHttpResponse,
)
from django.urls import Resolver404, resolve
from django.utils import timezone

from leaderboard import versions
from leaderboard.boards.snapshot_store import BoundedCache
from leaderboard.boards.snapshots import numbers_of, state_of
from leaderboard.http import Parameters, is_cacheable, is_known, parameters_of

Next = Callable[[HttpRequest], HttpResponseBase]

MAX_PLAIN_BYTES: Final = 32_000_000
MAX_QUERIES_BYTES: Final = 16_000_000
# What is remembered of an address is what view answers it; a longer one is looked up each time.
MAX_PATHS: Final = 4096
MAX_PATH: Final = 200
# What an answer costs beside its bytes: its headers, in each of its forms, and its place in memory.
OVERHEAD_BYTES: Final = 5000
MIN_COMPRESSED_BYTES: Final = 1000
# A longer answer is kept compressed alone: that of 10,000 rows is 8 MB, and compressed a tenth of it.
MAX_WHOLE_BYTES: Final = 2_000_000
PIECE_BYTES: Final = 65_536
_AS_GZIP: Final = 31  # the frame that zlib writes around: 15 + 16
# "gzip;q=0" asks for anything but that.
_GZIP = re.compile(r"\bgzip\b(?!\s*;\s*q=0(?:\.0*)?\s*(?:,|$))")
# Shared caches may keep it, but ask every time whether it holds.
ANYBODYS: Final = "public, no-cache"
VARY: Final = "Accept-Encoding, Authorization, Cookie, HX-Request"
# Of the headers that a view sets, those that are everybody's. What is left of a rate, say, is one reader's.
SHARED_HEADERS: Final = (
    *("Content-Type", "Content-Disposition", "Content-Language", "Link", "Allow"),
    "Cross-Origin-Resource-Policy",
)
# A browser lets these of a 304 replace what it has kept: left out, a badge would be forbidden elsewhere.
HEADERS_OF_304: Final = frozenset({"Cross-Origin-Resource-Policy"})


# A late answer has this header, and a page this line in place of the mark that `base.html` leaves.
BEHIND: Final = "Board-Behind"
MARK: Final = b"<!--behind-->"
BEHIND_LINE: Final = (
    b'<p class="notice" role="status">A score was added a moment ago, and is not on this page yet. '
    b'<a href="">Load the page again</a> in a few seconds.</p>'
)
MAX_LATE_BYTES: Final = 4_000_000


def is_anybodys(request: HttpRequest) -> bool:
    """Whether nothing about the request says who asks."""
    return (
        request.method in {"GET", "HEAD"}
        and "HTTP_AUTHORIZATION" not in request.META
        and "HTTP_HX_REQUEST" not in request.META
        and settings.SESSION_COOKIE_NAME not in request.COOKIES
        and CookieStorage.cookie_name not in request.COOKIES
        and _is_ours(request)
    )


def _is_ours(request: HttpRequest) -> bool:
    """Whether the site answers to the name that is asked; for another one, the layers refuse."""
    try:
        request.get_host()
    except DisallowedHost:
        return False
    return True


class Form(NamedTuple):
    """In which of its forms an answer is given: what of a request changes the headers."""

    is_compressed: bool
    is_304: bool
    is_secure: bool


@dataclass(frozen=True)
class CachedResponse:
    """An answer's bytes, as they are and compressed, with the headers that its view gave it.

    A long one is kept compressed alone, and `body` is None: who does not take gzip gets it unpacked piece by
    piece. `ready` has the headers of each form as it left the outermost layer, once it has. `numbers` are the
    versions of the boards that it is at least of, by split.
    """

    body: bytes | None
    n_body: int
    compressed: bytes
    etag: str
    headers: tuple[tuple[str, str], ...]
    numbers: Mapping[str, int] = field(default_factory=dict, compare=False)
    ready: dict[Form, dict[str, str]] = field(default_factory=dict, compare=False)

    @property
    def n_bytes(self) -> int:
        """What remembering it costs, but for its address."""
        return OVERHEAD_BYTES + len(self.body or b"") + len(self.compressed)

    @classmethod
    def of(cls, response: HttpResponseBase, *, numbers: Mapping[str, int] | None = None) -> "CachedResponse":
        """The answer that a view made, or makes while it is read here."""
        # The same bytes compress to the same: a moment within would give each process its own ETag.
        digest, packer, n_body = hashlib.sha256(), zlib.compressobj(6, wbits=_AS_GZIP), 0
        kept: list[bytes] = []
        packed: list[bytes] = []
        for piece in _pieces_of(response):
            digest.update(piece)
            packed.append(packer.compress(piece))
            n_body += len(piece)
            if n_body <= MAX_WHOLE_BYTES:
                kept.append(piece)
            else:
                kept.clear()
        packed.append(packer.flush())
        return cls(
            body=b"".join(kept) if n_body <= MAX_WHOLE_BYTES else None,
            n_body=n_body,
            compressed=b"".join(packed) if n_body >= MIN_COMPRESSED_BYTES else b"",
            etag=digest.hexdigest()[:32],
            headers=tuple((name, response[name]) for name in SHARED_HEADERS if response.has_header(name)),
            numbers=numbers or {},
        )

    def form_for(self, request: HttpRequest) -> Form:
        """The form for one reader: 304 if it is known there, compressed if that is taken."""
        accepted = request.META.get("HTTP_ACCEPT_ENCODING", "")
        is_compressed = bool(self.compressed) and _GZIP.search(accepted) is not None
        is_304 = is_known(request, self._etag_of(is_compressed=is_compressed))
        return Form(is_compressed, is_304, request.is_secure())

    def to(self, request: HttpRequest) -> HttpResponseBase:
        """The response to one reader, with the headers that are this answer's own."""
        form = self.form_for(request)
        response = HttpResponseNotModified() if form.is_304 else self._whole(form)
        if request.method == "HEAD" and not form.is_304:
            response = HttpResponse()
        for name, value in self.headers:
            if not form.is_304 or name in HEADERS_OF_304:
                response[name] = value
        if not form.is_304:
            response["Content-Length"] = str(len(self.compressed) if form.is_compressed else self.n_body)
            if form.is_compressed:
                response["Content-Encoding"] = "gzip"
        response["ETag"] = self._etag_of(is_compressed=form.is_compressed)
        response["Cache-Control"] = ANYBODYS
        response["Vary"] = VARY
        return response

    def late(self) -> "CachedResponse":
        """The same with the line that says so, where it has a place for it."""
        if self.body is None or MARK not in self.body:
            return self
        found = late_pages.get(self.etag)
        if found is None:
            page = HttpResponse(self.body.replace(MARK, BEHIND_LINE, 1), headers=dict(self.headers))
            found = late_pages.put(self.etag, CachedResponse.of(page))
        return found

    def ready_for(self, form: Form) -> HttpResponseBase | None:
        """The response with the headers of every layer; None if this form never went through them."""
        headers = self.ready.get(form)
        if headers is None:
            return None
        if form.is_304:
            return HttpResponseNotModified(headers=headers)
        return self._whole(form, headers=headers)

    def _whole(self, form: Form, *, headers: dict[str, str] | None = None) -> HttpResponseBase:
        body = self.compressed if form.is_compressed else self.body
        if body is not None:
            return HttpResponse(body, headers=headers)
        return StreamingHttpResponse(_unpacked(self.compressed), headers=headers)

    def _etag_of(self, *, is_compressed: bool) -> str:
        return f'"{self.etag}-gz"' if is_compressed else f'"{self.etag}"'


def _pieces_of(response: Any) -> Iterator[bytes]:
    """What a response says, as it is made."""
    yield from response.streaming_content if response.streaming else (bytes(response.content),)


def _unpacked(compressed: bytes) -> Iterator[bytes]:
    """The bytes that were compressed, a piece at a time."""
    with gzip.GzipFile(fileobj=io.BytesIO(compressed)) as whole:
        while piece := whole.read(PIECE_BYTES):
            yield piece


# The boards' number, and the day in UTC: rows are new for some days, and ranks have moved since a day.
State = tuple[int, date]


def _today(number: int) -> State:
    return number, timezone.now().date()


def _state(request: HttpRequest) -> State:
    """The state as of which this request is answered, read once: it was asked no earlier."""
    found: State | None = getattr(request, "state_of_boards", None)
    if found is None:
        found = _today(versions.state())
        request.state_of_boards = found  # type: ignore[attr-defined]  # our own, as `user` is Django's
    return found


def _cost(address: str, remembered: tuple[State, CachedResponse]) -> int:
    # Whoever asks chooses the address, and may make it longer than what is answered.
    return sys.getsizeof(address) + remembered[1].n_bytes


class ResponseCache:
    """Answers by address, each with the state of the boards as of which it holds; bounded in bytes.

    Plain pages are on one shelf, answers to queries on another.
    """

    def __init__(self, *, plain_bytes: int, queries_bytes: int) -> None:
        self.plain = BoundedCache[tuple[State, CachedResponse]](plain_bytes, cost=_cost)
        self.queries = BoundedCache[tuple[State, CachedResponse]](queries_bytes, cost=_cost)

    def shelf_of(self, address: str) -> BoundedCache[tuple[State, CachedResponse]]:
        """Where the answer of this address stands."""
        return self.queries if "?" in address else self.plain

    def get(self, address: str) -> tuple[State, CachedResponse] | None:
        """The last answer of this address, and the state as of which it held."""
        return self.shelf_of(address).get(address)

    def clear(self) -> None:
        """Forget everything."""
        self.plain.clear()
        self.queries.clear()


late_pages = BoundedCache[CachedResponse](MAX_LATE_BYTES, cost=lambda _, page: page.n_bytes)
memory = ResponseCache(plain_bytes=MAX_PLAIN_BYTES, queries_bytes=MAX_QUERIES_BYTES)


def _read_by_view(path: str) -> Parameters | None:
    """The query parameters that the view of this path reads; None where nothing is remembered."""
    return _resolved(path) if len(path) > MAX_PATH else _remembered(path)


def _resolved(path: str) -> Parameters | None:
    try:
        return parameters_of(resolve(path).func)
    except Resolver404:
        return None


_remembered = lru_cache(maxsize=MAX_PATHS)(_resolved)


def _normalise(request: HttpRequest, parameters: Parameters) -> bool:
    """Leave of the query what the view reads, in one order; whether its answer is worth remembering."""
    pairs: list[tuple[str, str]] = []
    is_worth_it = True
    for name, parameter in parameters.items():
        texts = request.GET.getlist(name)
        for text in texts if parameter.is_list else texts[-1:]:
            is_known = parameter.is_worth_it(text)
            is_worth_it = is_worth_it and is_known
            if text or not is_known:
                pairs.append((name, text))
    request.GET = QueryDict(urlencode(pairs), encoding=request.encoding)
    request.META["QUERY_STRING"] = request.GET.urlencode()
    return is_worth_it


# Marks a response that is of nobody but of what was remembered. A first answer may bear what is its reader's,
# such as what is left of their rate.
_REPEATS: Final = "repeats"


class ReadyAnswerMiddleware:
    """Repeats to anybody what has left through every layer before, without asking them again.

    It knows only addresses as they are remembered, which `PageCacheMiddleware` has found to be in order. The
    layers between the two look at nothing of the request but its form and at what makes it somebody's.
    """

    def __init__(self, get_response: Next) -> None:
        self._get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponseBase:
        """Answer, or ask the layers, and remember their headers for the next time."""
        found = memory.get(request.get_full_path_info()) if request.method == "GET" else None
        if found is None or not is_anybodys(request) or found[0] != _state(request):
            return self._get_response(request)
        form = found[1].form_for(request)
        ready = found[1].ready_for(form)
        if ready is not None:
            return ready
        response = self._get_response(request)
        if getattr(response, _REPEATS, None) is found[1] and not response.cookies:
            found[1].ready[form] = {sys.intern(name): sys.intern(value) for name, value in response.items()}
        return response


class PageCacheMiddleware:
    """Answers anybody from memory where that holds, and remembers what views of that kind answer."""

    # Where such views are; elsewhere not even the path is looked up.
    PREFIXES: Final = (
        *("/board/", "/methods/", "/compare/", "/feed", "/sitemap", "/api/v1/splits", "/api/v1/methods/"),
    )

    def __init__(self, get_response: Next) -> None:
        self._get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponseBase:
        """Answer, or ask the view."""
        path = request.path_info
        if path != "/" and not path.startswith(self.PREFIXES):
            return self._get_response(request)
        parameters = _read_by_view(path) if is_anybodys(request) else None
        if parameters is None or not _normalise(request, parameters):
            return self._get_response(request)
        address = request.get_full_path_info()
        found = memory.get(address)
        if found is None:
            return self._made(request, address)
        if found[0] != _state(request):
            return _late(request, *found) or self._made(request, address)
        response = found[1].to(request)
        setattr(response, _REPEATS, found[1])
        return response

    def _made(self, request: HttpRequest, address: str) -> HttpResponseBase:
        """Ask the view, and remember what it answers if it says so."""
        # Before the view looks: what it finds may be newer than this state, and is never older.
        state, numbers = _today(state_of(request)), numbers_of(request)
        response: HttpResponseBase = self._get_response(request)
        if not _is_cacheable(response) or request.method == "HEAD":
            return response
        answer = CachedResponse.of(response, numbers=numbers)
        memory.shelf_of(address).put(address, (state, answer))
        return answer.to(request)


def _late(request: HttpRequest, state: State, answer: CachedResponse) -> HttpResponseBase | None:
    """The answer of before, with its own ETag and the word that it is late; None if it may not be."""
    is_todays = state[1] == _state(request)[1]
    if not (settings.BOARD_LAG and is_todays):
        return None
    if not versions.may_be_late(answer.numbers, lag=settings.BOARD_LAG):
        return None
    response = answer.late().to(request)
    response[BEHIND] = "true"
    return response


def _is_cacheable(response: HttpResponseBase) -> bool:
    """Whether a view says so, and the answer is whole and sets nothing for its one reader."""
    return is_cacheable(response) and response.status_code == 200 and not response.cookies
