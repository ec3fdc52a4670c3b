"""Decorators of views for signed-in users; nothing caches their answers."""

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
    return login_required(never_cache(require_safe(view)))


def own_form(view: View) -> View:
    return login_required(never_cache(asks_first(view)))


def own_action(view: View) -> View:
    """Decorate an action from a form on another page."""
    return login_required(never_cache(require_POST(view)))
