"""Errors of the API: a problem document everywhere, and a documented code for each."""

import re
from pathlib import Path
from typing import Any

import pytest
from django.test import Client
from pytest_django import Settings
from rest_framework.test import APIClient

from evaluator.problems import PROBLEM_CODES, WARNING_CODES
from leaderboard.errors.problem_codes import API_CODES, STATUSES
from leaderboard.models import Edition, Split, User
from leaderboard.storage import files
from leaderboard.submissions import intake
from tests import builders
from tests.leaderboard.api.test_submissions import client_of, post

REPOSITORY = Path(__file__).resolve().parents[3]
CODE = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)+|throttled|withdrawn|invalid")


def checked(response: Any, status: int, code: str) -> dict[str, Any]:
    """The problem document of a response, with all of its fields checked."""
    assert response.status_code == status, response.content
    assert response.headers["Content-Type"] == "application/problem+json"
    body = response.json()
    assert set(body) == {"type", "title", "status", "code", "detail", "problems"}
    assert (body["status"], body["code"]) == (status, code)
    assert body["type"].endswith(f"/docs/api/#problem-{code}")
    assert body["detail"].endswith(".")
    assert [set(problem) for problem in body["problems"]] == [{"code", "message", "where"}]
    assert status in STATUSES[code]
    return body


@pytest.mark.parametrize(
    "path",
    [
        "/api",
        "/api/v1",
        "/api/v1/submissions/7",
        "/api/v1/submissions/",
        "/api/v1/splits/test/board/",
        "/api/v1/%00",
    ],
)
@pytest.mark.parametrize("method", ["get", "post"])
def test_every_address_that_is_none_is_a_404_of_the_same_shape(db: None, path: str, method: str) -> None:
    checked(getattr(Client(), method)(path), 404, "not-found")


def test_the_requests_own_faults(edition: Edition, owner: User) -> None:
    client = client_of(owner)
    checked(client.put("/api/v1/submissions"), 405, "method-not-allowed")
    checked(client.get("/api/v1/splits", HTTP_ACCEPT="application/xml"), 406, "not-acceptable")
    checked(client.post("/api/v1/submissions", {}, format="json"), 415, "unsupported-media-type")
    bad = client.generic("POST", "/api/v1/tokens/revoke", b"{", content_type="application/json")
    checked(bad, 400, "parse-error")
    fields = {f"field{n}": "x" for n in range(200)}
    checked(post(client, b"{}", **fields), 400, "bad-request")
    checked(post(client, b"{}", note="x" * 2_000_000), 413, "too-large")


def test_who_asks_and_how_often(edition: Edition, owner: User, stranger: User, settings: Settings) -> None:
    checked(APIClient().get("/api/v1/quota"), 401, "not-authenticated")
    progress = "/api/v1/splits/test/editions/1/progress"
    checked(client_of(owner).get(progress), 403, "permission-denied")
    Split.objects.filter(pk="test").update(quota_limit=0)
    checked(post(client_of(owner), builders.predictions(edition)), 429, "quota-exceeded")
    settings.API_RATES = dict.fromkeys(settings.API_RATES, "1/min")
    client = client_of(stranger)
    first = client.get("/api/v1/submissions")
    assert first.headers["RateLimit-Policy"] == '"signed_in";q=1;w=60'
    assert first.headers["RateLimit"].startswith('"signed_in";r=0;t=')
    again = client.get("/api/v1/submissions")
    checked(again, 429, "throttled")
    assert again.headers["RateLimit"].partition("t=")[2] == again.headers["Retry-After"]


def test_our_own_faults(edition: Edition, owner: User, monkeypatch: pytest.MonkeyPatch) -> None:
    client = client_of(owner)
    client.raise_request_exception = False

    def away(*args: object, **kwargs: object) -> None:
        raise files.StoreUnavailable

    monkeypatch.setattr(files, "save_predictions", away)
    response = post(client, builders.predictions(edition))
    checked(response, 503, "store-unavailable")
    assert response.headers["Retry-After"]

    def broken(*args: object, **kwargs: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(intake, "submit", broken)
    body = checked(post(client, builders.predictions(edition)), 500, "server-error")
    assert "ZeroDivision" not in str(body)


def test_malformed_requests_are_answered_alike_before_any_view(db: None, settings: Settings) -> None:
    settings.ALLOWED_HOSTS, settings.SITE_URL = ["board.example.org"], "https://board.example.org"
    checked(Client().get("/api/v1/splits"), 400, "bad-request")
    for referer in ("", "https://board.example.org/board/test/", "http://testserver/board/test/"):
        page = Client().get("/", headers={"Referer": referer})
        assert (page.status_code, page.headers["Content-Type"]) == (400, "text/html; charset=utf-8")
        assert "Invalid request" in page.content.decode()
        assert "TSTTC leaderboard" in page.content.decode()


# --- pagination ------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_pages_of_a_list_have_every_row_once_also_while_rows_come(edition: Edition, owner: User) -> None:
    client, data = client_of(owner), builders.predictions(edition)
    made = [str(builders.submit(owner, data, method=f"M{n}").pk) for n in range(7)]
    seen, address = [], "/api/v1/submissions?limit=3"
    while address:
        response = client.get(address)
        seen += [row["id"] for row in response.json()]
        builders.submit(owner, data, method=f"Later{len(seen)}")
        link = response.headers.get("Link", "")
        address = link.partition("<")[2].partition(">")[0]
        assert not link or link.endswith('>; rel="next"')
    assert seen == made[::-1]


@pytest.mark.parametrize(
    ("query", "code"),
    [
        ("limit=101", "bad-limit"),
        ("limit=x", "bad-limit"),
        ("after=x", "bad-cursor"),
        ("after=00000000-0000-4000-8000-000000000000", "bad-cursor"),
        ("after=%00", "bad-cursor"),
    ],
)
def test_bad_pages_are_a_400(edition: Edition, owner: User, query: str, code: str) -> None:
    checked(client_of(owner).get(f"/api/v1/submissions?{query}"), 400, code)


def test_a_row_of_another_team_is_no_cursor(edition: Edition, owner: User, stranger: User) -> None:
    row = builders.submit(owner, builders.predictions(edition))
    checked(client_of(stranger).get(f"/api/v1/submissions?after={row.pk}"), 400, "bad-cursor")


@pytest.mark.parametrize("name", ["editions", "changelog"])
def test_other_lists_come_in_pages_too(edition: Edition, name: str) -> None:
    address = f"/api/v1/splits/test/{name}"
    assert len(APIClient().get(f"{address}?limit=1").json()) == 1
    checked(APIClient().get(f"{address}?limit=0"), 400, "bad-limit")
    checked(APIClient().get(f"{address}?after=999999"), 400, "bad-cursor")


# --- every code is documented ----------------------------------------------------------------------------


# A refusal's first text, or `code=`.
GIVEN = re.compile(
    r"\b(?:Refused|BadValue|NotVerified|Unusable\w*|add|group|reject|Problem|Rule)"
    r'\(\s*"([a-z]+(?:-[a-z]+)+)"|\bcode="([a-z-]+)"'
)
# Codes that no answer of the API bears: of forms on pages alone, and of the command line's own checks.
ON_PAGES = {"too-many-tokens", "bad-days", "bad-scope"}


@pytest.mark.slow
def test_every_code_in_the_source_is_documented_and_every_documented_code_is_there() -> None:
    sources = [*REPOSITORY.glob("leaderboard/**/*.py"), *REPOSITORY.glob("evaluator/**/*.py")]
    # The command line's own codes are those of its documents, in docs/cli.md.
    texts = [path.read_text(encoding="utf-8") for path in sources if "cli" not in path.parts]
    in_source = {first or second for text in texts for first, second in GIVEN.findall(text)}
    assert len(in_source) > 60
    known = {*API_CODES, *PROBLEM_CODES, *WARNING_CODES, *ON_PAGES}
    unknown = {code for code in in_source - known if not code.startswith("receipt-")}
    assert unknown == set(), (
        "say what they mean in leaderboard/errors/problem_codes.py, those of a file in evaluator/problems.py "
        "and docs/file-format.md, and all of them in docs/problem-codes.md"
    )
    guide = (REPOSITORY / "docs" / "problem-codes.md").read_text(encoding="utf-8")
    documented = set(re.findall(r"^\| `([a-z0-9-]+)` \|", guide, flags=re.MULTILINE))
    receipts = {code for code in in_source if code.startswith("receipt-")}
    statuses = {
        code: tuple(map(int, numbers.split(", ")))
        for code, numbers in re.findall(r"^\| `([a-z-]+)` \| ([0-9, ]+) \|", guide, flags=re.MULTILINE)
    }
    assert {code: set(each) for code, each in statuses.items()} == {
        c: set(each) for c, each in STATUSES.items()
    }
    missing = {*API_CODES, *PROBLEM_CODES, *receipts} - documented
    assert missing == set(), "docs/problem-codes.md lists every code"
    assert documented - {*API_CODES, *PROBLEM_CODES, *receipts} == set()


@pytest.mark.slow
def test_no_code_stands_in_the_list_that_nobody_gives() -> None:
    by_the_framework = {
        *("parse-error", "invalid", "not-found", "method-not-allowed", "not-acceptable", "throttled"),
        *("unsupported-media-type", "not-authenticated", "authentication-failed", "permission-denied"),
    }
    source = "\n".join(
        path.read_text(encoding="utf-8")
        for path in REPOSITORY.glob("leaderboard/**/*.py")
        if path.name != "problem_codes.py"
    )
    assert [c for c in API_CODES if c not in by_the_framework and f'"{c}"' not in source] == []
