"""Pages and documents that are the same for everybody: made once, then answered from this process's memory.

Whoever brings neither a session nor a token is anybody. What such a reader is shown changes only with the
number of some split's boards (`leaderboard/boards.py`), so one statement tells whether an answer still holds:
none is ever old. A view says with `keeping.kept` that this is so of what it answers. The middleware stands
before sessions and accounts, so that anybody's question costs neither.

Answers carry a strong ETag, the digest of their bytes, and are compressed for whoever takes gzip. There is no
secret of the reader in them, so that their compressed length betrays none.
"""

import gzip
import hashlib
import re
import sys
import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from django.conf import settings
from django.contrib.messages.storage.cookie import CookieStorage
from django.http import HttpRequest, HttpResponse, HttpResponseNotModified

from leaderboard import boards
from leaderboard.keeping import is_kept, is_known
from leaderboard.web.context import splits_of

Next = Callable[[HttpRequest], HttpResponse]

MAX_REMEMBERED_BYTES: Final = 48_000_000
# What an answer costs beside its bytes: its headers, and its place in memory.
OVERHEAD_BYTES: Final = 2000
MIN_COMPRESSED_BYTES: Final = 1000
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


def is_anybodys(request: HttpRequest) -> bool:
    """Whether nothing about the request says who asks."""
    return (
        request.method in {"GET", "HEAD"}
        and "HTTP_AUTHORIZATION" not in request.META
        and "HTTP_HX_REQUEST" not in request.META
        and settings.SESSION_COOKIE_NAME not in request.COOKIES
        and CookieStorage.cookie_name not in request.COOKIES
    )


@dataclass(frozen=True)
class Answer:
    """An answer's bytes, as they are and compressed, with the headers that its view gave it."""

    body: bytes
    compressed: bytes
    etag: str
    headers: tuple[tuple[str, str], ...]

    @property
    def n_bytes(self) -> int:
        """What remembering it costs, but for its address."""
        return OVERHEAD_BYTES + len(self.body) + len(self.compressed)

    @classmethod
    def of(cls, response: HttpResponse) -> "Answer":
        """The answer that a view made."""
        body = bytes(response.content)
        # The same bytes compress to the same: a moment within would give each process its own ETag.
        smaller = gzip.compress(body, compresslevel=6, mtime=0) if len(body) >= MIN_COMPRESSED_BYTES else b""
        return cls(
            body=body,
            compressed=smaller,
            etag=hashlib.sha256(body).hexdigest()[:32],
            headers=tuple((name, response[name]) for name in SHARED_HEADERS if response.has_header(name)),
        )

    def to(self, request: HttpRequest) -> HttpResponse:
        """The response to one reader: 304 if it is known there, compressed if that is taken."""
        accepted = request.META.get("HTTP_ACCEPT_ENCODING", "")
        takes_gzip = bool(self.compressed) and _GZIP.search(accepted) is not None
        etag = f'"{self.etag}-gz"' if takes_gzip else f'"{self.etag}"'
        body = self.compressed if takes_gzip else self.body
        response = HttpResponse(b"" if request.method == "HEAD" else body)
        is_304 = is_known(request, etag)
        if is_304:
            response = HttpResponseNotModified()
        for name, value in self.headers:
            if not is_304 or name in HEADERS_OF_304:
                response[name] = value
        if not is_304:
            response["Content-Length"] = str(len(body))
            if takes_gzip:
                response["Content-Encoding"] = "gzip"
        response["ETag"] = etag
        response["Cache-Control"] = ANYBODYS
        response["Vary"] = VARY
        return response


class Memory:
    """Answers by address, each with the state of the boards as of which it holds; bounded in bytes."""

    def __init__(self, *, limit_bytes: int) -> None:
        self._limit_bytes = limit_bytes
        self._lock = threading.Lock()
        self._answers: OrderedDict[str, tuple[int, Answer]] = OrderedDict()
        self._n_bytes = 0

    def get(self, address: str) -> tuple[int, Answer] | None:
        """The last answer of this address, and the state as of which it held."""
        with self._lock:
            if address in self._answers:
                self._answers.move_to_end(address)
            return self._answers.get(address)

    def put(self, address: str, state: int, answer: Answer) -> None:
        """Remember it; what was not asked for longest is forgotten."""
        with self._lock:
            self._forget(address)
            self._answers[address] = (state, answer)
            self._n_bytes += self._cost(address, answer)
            while self._n_bytes > self._limit_bytes:
                self._forget(next(iter(self._answers)))

    def clear(self) -> None:
        """Forget everything."""
        with self._lock:
            self._answers.clear()
            self._n_bytes = 0

    def _forget(self, address: str) -> None:
        old = self._answers.pop(address, None)
        if old is not None:
            self._n_bytes -= self._cost(address, old[1])

    @staticmethod
    def _cost(address: str, answer: Answer) -> int:
        # Whoever asks chooses the address, and may make it longer than what is answered.
        return sys.getsizeof(address) + answer.n_bytes


memory = Memory(limit_bytes=MAX_REMEMBERED_BYTES)


class KeptMiddleware:
    """Answers anybody from memory where that holds, and remembers what views of that kind answer."""

    # Where such views are; elsewhere not even the state is asked for.
    PREFIXES: Final = ("/board/", "/methods/", "/compare/", "/feed", "/api/v1/splits", "/api/v1/methods/")

    def __init__(self, get_response: Next) -> None:
        self._get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponse:
        """Answer, or ask the view."""
        path = request.path_info
        if path != "/" and not path.startswith(self.PREFIXES):
            return self._get_response(request)
        # A board of the past is made for its one reader: there is no end of times to ask for.
        if not is_anybodys(request) or "at" in request.GET:
            return self._get_response(request)
        address = request.get_full_path_info()
        found = memory.get(address)
        if found is None or found[0] != boards.state():
            return self._made(request, address)
        return found[1].to(request)

    def _made(self, request: HttpRequest, address: str) -> HttpResponse:
        """Ask the view, and remember what it answers if it says so."""
        # Before the view looks: what it finds may be newer than this state, and is never older.
        state = boards.state_of(splits_of(request))
        response = self._get_response(request)
        if not _may_be_kept(response) or request.method == "HEAD":
            return response
        answer = Answer.of(response)
        memory.put(address, state, answer)
        return answer.to(request)


def _may_be_kept(response: HttpResponse) -> bool:
    """Whether a view says so, and the answer is whole and sets nothing for its one reader."""
    return (
        is_kept(response) and response.status_code == 200 and not response.streaming and not response.cookies
    )
