"""The administration's part of the permission matrix: one rule for all of its models.

Only maintainers come in; everybody else is asked to sign in as one. Nobody adds, changes or deletes anything
there.
"""

from django.contrib import admin
from django.db.models import Model

from tests.security.matrix import Line, all_of, line
from tests.security.routes import Route

# All that it shows: a further model has a page instead, or a reason.
SHOWN = {
    *("account_emailaddress", "leaderboard_apitoken", "leaderboard_invitation", "leaderboard_user"),
}
# Views that are not of a model; a new one needs a line here.
OF_THE_SITE = {
    "admin:index": line(GET="in in in in 200 in in"),
    # Signing in is allauth's, which counts how often somebody guesses; who is somebody else is refused.
    "admin:login": line(GET="in 403 403 403 302 in in", POST="in 403 403 403 200 in in"),
    "admin:logout": line(GET="302 302 302 302 405 302 302", POST=all_of("302")),
    "admin:password_change": line(GET="in in in in 200 in in", POST="in in in in 200 in in"),
    "admin:password_change_done": line(GET="in in in in 200 in in"),
    "admin:autocomplete": line(GET="in in in in 403 in in"),
    "admin:jsi18n": line(GET="in in in in 200 in in"),
    "admin:view_on_site": line(GET="in in in in 404 in in", at={"content_type_id": 0, "object_id": 0}),
    "admin:app_list": line(GET="in in in in 200 in in", at={"app_label": "leaderboard"}),
}
# Django's own catch-all patterns, which have no name: they redirect, or find nothing.
CATCH_ALL = "(?P<url>.*)$"


def admin_line(route: Route) -> Line | None:
    """The line of a route below /admin/; None for a view that no rule knows."""
    if route.name in OF_THE_SITE:
        return OF_THE_SITE[route.name]
    if route.pattern.endswith(CATCH_ALL):
        return line(GET="in in in in 404 in in", at={"url": "nowhere"})
    if route.name.endswith("<path:object_id>/"):
        # An old form of the address of `change`.
        return line(GET="in in in in 302 in in", at={"object_id": "1"})
    model, _, view = route.name.removeprefix("admin:").rpartition("_")
    if model not in SHOWN:
        return None
    # What a maintainer gets for GET and for POST; None: it is not asked.
    answers = {
        "changelist": ("200", None),
        "add": ("403", "403"),
        "change": ("200", "403"),
        "delete": ("403", "403"),
        "history": ("200", None),
    }.get(view)
    if answers is None:
        return None
    asked = dict(zip(("GET", "POST"), answers, strict=True))
    lines = {method: f"in in in in {status} in in" for method, status in asked.items() if status}
    return line(at={"object_id": lambda _: first_of(model)}, **lines)


def first_of(label: str) -> object:
    """The key of some row of a model of the administration; the test's world has one of each."""
    models: dict[str, type[Model]] = {
        f"{model._meta.app_label}_{model._meta.model_name}": model for model in admin.site._registry
    }
    return models[label]._default_manager.values_list("pk", flat=True)[0]
