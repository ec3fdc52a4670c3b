"""Decorators of views: who gets the response, by which methods, and that nothing keeps it."""

from collections.abc import Callable
from typing import TypeVar

from django.contrib.auth.decorators import login_required
from django.http import HttpResponseBase
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_POST, require_safe

View = TypeVar("View", bound=Callable[..., HttpResponseBase])

asks_first = require_http_methods(["GET", "HEAD", "POST"])
"""Decorates a view that shows a form and accepts it."""


def own_page(view: View) -> View:
    """A page of the signed-in user, which nothing keeps."""
    return login_required(never_cache(require_safe(view)))


def own_form(view: View) -> View:
    """The same with a form."""
    return login_required(never_cache(asks_first(view)))


def own_action(view: View) -> View:
    """An action of the signed-in user, from a form on another page."""
    return login_required(never_cache(require_POST(view)))
