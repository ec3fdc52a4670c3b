"""Decorators of views for signed-in users; nothing caches their answers."""

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.http import HttpRequest, HttpResponseBase
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_POST, require_safe

View = TypeVar("View", bound=Callable[..., HttpResponseBase])

SESSION_ENDED = "Your session has ended, and the form was not sent. Sign in, then send it again."

asks_first = require_http_methods(["GET", "HEAD", "POST"])
"""Decorates a view that shows a form and accepts it."""


def own_page(view: View) -> View:
    return login_required(never_cache(require_safe(view)))


def own_form(view: View) -> View:
    return _sent_by_a_user(login_required(never_cache(asks_first(view))))


def own_action(view: View) -> View:
    """Decorate an action from a form on another page."""
    return _sent_by_a_user(login_required(never_cache(require_POST(view))))


def _sent_by_a_user(view: View) -> View:
    """Say on the sign-in page that a form came from nobody: its session has ended."""

    @wraps(view)
    def guarded(request: HttpRequest, *args: Any, **kwargs: Any) -> HttpResponseBase:
        if request.method == "POST" and not request.user.is_authenticated:
            messages.error(request, SESSION_ENDED)
        return view(request, *args, **kwargs)

    return cast("View", guarded)
