"""What every answer says to browsers and caches, at every address, to visitors and to people."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from django.http import HttpResponse
from django.test import Client

from leaderboard.models import User
from tests import pages
from tests.security.matrix import Line
from tests.security.people import World
from tests.security.routes import routes
from tests.security.test_permissions import address, line_of, once
from tests.services import environment_of_its_own

pytestmark = pytest.mark.slow

ALWAYS = {
    "X-Frame-Options": "DENY",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
}
# What somebody who is nobody in particular may get: asked for anew each time, or for a while.
ANYBODYS = re.compile(r"public, (?:no-cache|max-age=\d+)|max-age=\d+, public")
# Pages that are about one visitor even if nobody has signed in: forms with a token of their own, and figures.
PERSONAL = re.compile(r"^/(?:accounts|admin|healthz|healthy|readyz|metrics)")


ROLES = ("anonymous", "owner", "maintainer", "expired token")
Answers = list[tuple[str, str, HttpResponse]]
_asked: Answers = []


@pytest.fixture
def answers(request: pytest.FixtureRequest) -> Answers:
    """The answer to GET of every route to each of these roles, with its address; asked once for all."""
    if not _asked:
        world: World = request.getfixturevalue("world")
        for route in routes():
            line = line_of(route) or Line({})  # that it has none the permission matrix says
            path = address(route, world, line)
            _asked.extend((role, path, once(world, role, "GET", path, line)) for role in ROLES)
    assert len(_asked) > 100 * len(ROLES)
    return _asked


def test_every_answer_has_the_headers_of_a_careful_site(answers: Answers) -> None:
    for role, path, response in answers:
        about = f"{role} {path} {response.status_code}"
        assert {name: response.headers.get(name) for name in ALWAYS} == ALWAYS, about
        assert response.headers["Cross-Origin-Resource-Policy"] in {"same-origin", "cross-origin"}, about
        assert "camera=()" in response.headers["Permissions-Policy"], about
        policy = response.headers["Content-Security-Policy"]
        assert {"default-src 'none'", "script-src 'self'", "style-src 'self'"} <= set(policy.split("; ")), (
            about
        )
        assert "frame-ancestors 'none'" in policy, about
        assert "unsafe" not in policy, about
        assert "Server" not in response.headers, about


def test_what_a_user_is_shown_is_never_cached(answers: Answers) -> None:
    for role, path, response in answers:
        if role == "anonymous":
            continue
        assert response.headers["Cache-Control"] == "private, no-store", f"{role} {path}"


def test_what_anybody_is_shown_may_be_kept_and_asked_for_again(answers: Answers) -> None:
    n_public = 0
    for role, path, response in answers:
        if role != "anonymous":
            continue
        cache_control = response.headers["Cache-Control"]
        if response.status_code >= 400 or PERSONAL.match(path):
            assert "no-store" in cache_control or ANYBODYS.fullmatch(cache_control), path
        elif cache_control != "private, no-store":
            assert ANYBODYS.fullmatch(cache_control), f"{path}: {cache_control}"
            n_public += 1
    assert n_public > 10


def test_every_answer_says_what_it_depends_on_and_says_the_same_to_everybody(answers: Answers) -> None:
    varies: dict[str, set[frozenset[str]]] = {}
    for role, path, response in answers:
        vary = frozenset(name.strip().lower() for name in response.headers["Vary"].split(","))
        assert {"cookie", "authorization"} <= vary, f"{role} {path}"
        if response.status_code == 200:
            varies.setdefault(path, set()).add(vary - {"accept-encoding", "hx-request", "accept"})
    assert {path: variants for path, variants in varies.items() if len(variants) > 1} == {}


def test_cookies_are_for_this_site_and_no_script(client: Client, owner: User) -> None:
    client.post("/accounts/login/", {"login": owner.email, "password": "correct horse"})
    assert {"sessionid", "csrftoken"} <= set(client.cookies)
    for name, cookie in client.cookies.items():
        if cookie.value:
            assert (name, cookie["samesite"], cookie["httponly"]) == (name, "Lax", True)


def test_every_form_that_changes_something_carries_its_token(answers: Answers) -> None:
    n_forms = 0
    for role, path, response in answers:
        is_page = response.headers.get("Content-Type", "").startswith("text/html")
        if not is_page or path.startswith("/admin/") or not response.content.strip():
            continue
        for form in pages.read(response.content.decode()).all("form"):
            if form.attributes.get("method", "get").lower() == "post":
                n_forms += 1
                assert form.all("input", name="csrfmiddlewaretoken"), f"{role} {path}"
    assert n_forms > 20


def test_no_form_is_taken_without_its_token(world: World) -> None:
    client = Client(enforce_csrf_checks=True)
    client.force_login(world.users["maintainer"])
    n_forms = 0
    for route in routes():
        line = line_of(route)
        if line is not None and "POST" in line.answers and not route.is_api:
            n_forms += 1
            assert client.post(address(route, world, line), {}).status_code == 403, route.name
    assert n_forms > 40


def test_a_session_may_not_submit_over_the_api_without_the_token_of_a_form(owner: User) -> None:
    client = Client(enforce_csrf_checks=True)
    client.force_login(owner)
    assert client.post("/api/v1/submissions", {}).status_code == 403


# --- what only production has ------------------------------------------------------------------------------

ASKED = """
import django; django.setup()
from django.conf import settings
from django.test import Client
for secure in (False, True):
    client = Client(headers={"Host": "board.example.org"})
    answer = client.get("/healthz" if secure else "/docs/", secure=secure)
    found = [answer.headers.get(name, "-") for name in ("Location", "Strict-Transport-Security")]
    print(answer.status_code, *found)
print(settings.SESSION_COOKIE_SECURE, settings.CSRF_COOKIE_SECURE, settings.DEBUG)
print(settings.CACHES["default"]["BACKEND"])
"""


def test_production_speaks_https_alone(production: dict[str, str]) -> None:
    environment = environment_of_its_own() | production | {"DJANGO_SETTINGS_MODULE": "leaderboard.settings"}
    repository = Path(__file__).resolve().parents[2]
    command = [sys.executable, "-c", ASKED]
    done = subprocess.run(
        command, cwd=repository, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    plain, secure, cookies, cache = done.stdout.splitlines()
    assert plain == "301 https://board.example.org/docs/ -"
    assert secure == "200 - max-age=31536000; includeSubDomains; preload"
    assert cookies == "True True False"
    assert cache == "django.core.cache.backends.db.DatabaseCache"
