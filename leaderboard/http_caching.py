"""What a cache may keep of a view's answer, and answers to conditional requests: for pages and API alike."""

from collections.abc import Callable
from functools import wraps
from typing import Any, Final, ParamSpec, TypeVar

from django.http import HttpRequest, QueryDict
from django.utils.http import parse_etags

P = ParamSpec("P")
R = TypeVar("R")
_MARK: Final = "is_kept"


def cacheable(view: Callable[P, R]) -> Callable[P, R]:
    """Mark a view whose answer depends only on the known part of its address and on the boards' versions."""

    @wraps(view)
    def marked(*args: P.args, **kwargs: P.kwargs) -> R:
        request: Any = args[0]
        query: str | None = getattr(request, "known_query", None)
        if query is not None:
            request.GET = QueryDict(query)
            request.META["QUERY_STRING"] = query
        response = view(*args, **kwargs)
        setattr(response, _MARK, True)
        return response

    return marked


def is_cacheable(response: Any) -> bool:
    """Tell whether the view is marked as cacheable."""
    return getattr(response, _MARK, False) is True


def is_known(request: HttpRequest, etag: str) -> bool:
    """Whether the client has the answer of this ETag (with its quotes), so that 304 is enough."""
    header = request.META.get("HTTP_IF_NONE_MATCH")
    if not header:
        return False
    # A proxy that compresses makes a strong tag a weak one; for the question of 304 they are the same.
    known = {tag.removeprefix("W/") for tag in parse_etags(header)}
    return "*" in known or etag in known
