"""Who gets the response of a view, and who may keep it; answers to conditional requests.

`leaderboard/web/middleware/page_cache.py` reads the mark of what a cache may keep for anonymous readers.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import wraps
from typing import Any, Final, ParamSpec, TypeVar

from django.contrib.auth.decorators import login_required
from django.http import HttpRequest, HttpResponseBase
from django.utils import timezone
from django.utils.http import parse_etags
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_POST, require_safe

P = ParamSpec("P")
R = TypeVar("R")
View = TypeVar("View", bound=Callable[..., HttpResponseBase])
_MARK: Final = "is_kept"
_PARAMETERS: Final = "query_parameters"

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


@dataclass(frozen=True)
class Parameter:
    """A query parameter that a view reads, and which texts of it are worth remembering an answer for.

    To be worth it an empty text has to mean the same as none at all.
    """

    is_worth_it: Callable[[str], bool]
    is_list: bool = False  # the view reads every one of that name, in their order; else the last one


Parameters = Mapping[str, Parameter]
NOTHING: Final[Parameters] = {}


def one_of(*texts: str) -> Parameter:
    """Worth remembering: these texts, exactly."""
    return Parameter(frozenset(texts).__contains__)


def matching(pattern: str, *, is_list: bool = False) -> Parameter:
    """Worth remembering: texts like this, of which the view answers few with 200."""
    wanted = re.compile(pattern)
    return Parameter(lambda text: wanted.fullmatch(text) is not None, is_list=is_list)


ANYTHING: Final = matching("")
"""A parameter of which anybody can think of any number of texts: remembered is only where it is empty."""

NEVER: Final = one_of()
"""The same, where an empty text is not the same as none."""

_DAY: Final = re.compile("[0-9]{4}-[0-9]{2}-[0-9]{2}")
A_PAST_DAY: Final = Parameter(
    lambda text: _DAY.fullmatch(text) is not None and text < f"{timezone.now():%Y-%m-%d}"
)
"""Worth remembering: days in UTC that are over. Of one that is not, the answer changes when it ends."""


def takes(view: Callable[P, R], parameters: Parameters = NOTHING) -> Callable[P, R]:
    """A view that reads these query parameters and no others: what else an address names is dropped."""
    setattr(view, _PARAMETERS, parameters)
    return view


def parameters_of(view: object) -> Parameters | None:
    """The query parameters that it reads; None for a view that does not say."""
    return getattr(view, _PARAMETERS, None)


def cacheable(view: Callable[P, R], parameters: Parameters = NOTHING) -> Callable[P, R]:
    """What this view answers anybody depends on its path, on these parameters and on the boards' numbers."""

    @wraps(view)
    def marked(*args: P.args, **kwargs: P.kwargs) -> R:
        response = view(*args, **kwargs)
        setattr(response, _MARK, True)
        return response

    return takes(marked, parameters)


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
