"""Who gets the response of a view, and who may keep it; answers to conditional requests.

`leaderboard/web/middleware/public_answers.py` reads the mark of what a cache may keep for anonymous readers.
"""

from collections.abc import Callable
from functools import wraps
from typing import Any, Final, ParamSpec, TypeVar

from django.contrib.auth.decorators import login_required
from django.http import HttpRequest, HttpResponseBase, QueryDict
from django.utils.http import parse_etags
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_POST, require_safe

P = ParamSpec("P")
R = TypeVar("R")
View = TypeVar("View", bound=Callable[..., HttpResponseBase])
_MARK: Final = "is_kept"

asks_first = require_http_methods(["GET", "HEAD", "POST"])
"""Of a view that shows a form and takes it."""


def own_page(view: View) -> View:
    """A page for whoever is signed in, that nothing keeps."""
    return login_required(never_cache(require_safe(view)))


def own_form(view: View) -> View:
    """The same with a form."""
    return login_required(never_cache(asks_first(view)))


def own_deed(view: View) -> View:
    """Something that is done for whoever is signed in, from a form on another page."""
    return login_required(never_cache(require_POST(view)))


def cacheable(view: Callable[P, R]) -> Callable[P, R]:
    """What this view answers anybody depends on the known part of its address and on the boards' numbers.

    Of an address that anybody asks for, the view sees what is known alone.
    """

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
