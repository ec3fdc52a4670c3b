"""Reads what an answer left unread of a request, so that the answer arrives.

A refusal such as 401, 413 or 503 is made before the body is read. If the server then closed the connection,
the proxy that is still sending would answer 502 in its place.
"""

from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Any, Final

Application = Callable[[dict[str, Any], Any], Iterable[bytes]]

# More than any proxy of `deploy/` lets through.
MAX_BYTES: Final = 64_000_000
_CHUNK: Final = 1 << 16


def reading_to_the_end(application: Application) -> Application:
    """Wrap a WSGI application; servers that do not end the body themselves are left alone."""

    def wrapped(environ: dict[str, Any], start_response: Any) -> Iterable[bytes]:
        answer = application(environ, start_response)
        if environ.get("wsgi.input_terminated"):
            # Whoever stops sending gets no answer anyway.
            with suppress(OSError):
                _read(environ["wsgi.input"])
        return answer

    return wrapped


def _read(body: Any) -> None:
    n_bytes = 0
    while n_bytes < MAX_BYTES:
        chunk = body.read(_CHUNK)
        if not chunk:
            return
        n_bytes += len(chunk)
