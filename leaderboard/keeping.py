"""How a view says that anybody may be answered from memory (see `leaderboard/web/kept.py`), and how a reader
says what is known already.
"""

from collections.abc import Callable
from functools import wraps
from typing import Any, Final, ParamSpec, TypeVar

from django.http import HttpRequest
from django.utils.http import parse_etags

P = ParamSpec("P")
R = TypeVar("R")
_MARK: Final = "is_kept"


def kept(view: Callable[P, R]) -> Callable[P, R]:
    """What this view answers anybody depends on its address and on what the boards' numbers count alone."""

    @wraps(view)
    def marked(*args: P.args, **kwargs: P.kwargs) -> R:
        response = view(*args, **kwargs)
        setattr(response, _MARK, True)
        return response

    return marked


def is_kept(response: Any) -> bool:
    """Whether the view that made it says so."""
    return getattr(response, _MARK, False) is True


def is_known(request: HttpRequest, etag: str) -> bool:
    """Whether whoever asks has the answer of this ETag (with its quotes), so that 304 says enough."""
    header = request.META.get("HTTP_IF_NONE_MATCH")
    if not header:
        return False
    # A proxy that compresses makes a strong tag a weak one; for the question of 304 they are the same.
    known = {tag.removeprefix("W/") for tag in parse_etags(header)}
    return "*" in known or etag in known
