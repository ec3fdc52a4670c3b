"""What a person is shown does not tell whether another person has something to hide."""

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from urllib.parse import urlencode

import pytest
from django.db import transaction
from django.http import HttpResponse, StreamingHttpResponse
from django.test import Client

from leaderboard.boards import filters
from leaderboard.models import Method, Submission, User
from leaderboard.web.boards.board_query import BoardQuery
from tests.caching import forget_boards
from tests.security.addresses import FILTERS, QUERIES, TOGETHER, addresses
from tests.security.people import ADDRESS
from tests.security.worlds import HIDDEN_METHODS, HIDDEN_SUBMISSIONS, START, build

pytestmark = pytest.mark.slow

WHOLE = os.environ.get("TSTTC_SECURITY_WHOLE") == "1"
ADDRESSES_IN_THE_SUITE = 450
# Random in every answer by its nature: the token of a form, and the name of a request in the log.
FORM_TOKEN = re.compile(rb'(?<=name="csrfmiddlewaretoken" value=")[^"]+|(?<=X-CSRFToken": ")[^"]+')
# The database's clock: when a person's own actions were written down, in the file of what is kept of them.
OWN_ACTION_AT = re.compile(rb'(?<="at": ")[^"]+')
OWN_DATA = "/account/data.json"
RANDOM_HEADERS = {"X-Request-ID"}
RANDOM_COOKIES = {"csrftoken"}


@dataclass(frozen=True)
class Seen:
    status: int
    headers: tuple[tuple[str, str], ...]
    cookies: tuple[str, ...]
    body: bytes


def seen(response: HttpResponse | StreamingHttpResponse) -> Seen:
    """An answer without what is random in it."""
    headers = {name: value for name, value in response.headers.items() if name not in RANDOM_HEADERS}
    cookies = [
        str(cookie) if name not in RANDOM_COOKIES else str(cookie).replace(cookie.value, "…")
        for name, cookie in sorted(response.cookies.items())
    ]
    cookies = [re.sub(r"expires=[^;]+", "expires=…", cookie) for cookie in cookies]
    body = response.getvalue() if isinstance(response, StreamingHttpResponse) else response.content
    return Seen(
        response.status_code, tuple(sorted(headers.items())), tuple(cookies), FORM_TOKEN.sub(b"...", body)
    )


def looked_at(directory: Path, *, has_secrets: bool, limit: int | None) -> dict[tuple[str, str], Seen]:
    """What a visitor and a stranger see in one of the worlds, which is gone afterwards."""
    with transaction.atomic():
        scene = build(directory, has_secrets=has_secrets)
        paths = addresses(scene)
        if limit is not None:
            paths = thinned(paths, limit)
        stranger = Client(raise_request_exception=False, REMOTE_ADDR=ADDRESS)
        stranger.force_login(scene.stranger)
        # Signing in reads the clock, and people may ask for what is kept of them.
        User.objects.filter(pk=scene.stranger.pk).update(last_login=START)
        answers = {}
        for path in paths:
            visitor = Client(raise_request_exception=False, REMOTE_ADDR=ADDRESS)
            for role, client in (("anonymous", visitor), ("stranger", stranger)):
                answers[role, path] = seen(client.get(path))
                if path.partition("?")[0] == OWN_DATA:
                    body = OWN_ACTION_AT.sub(b"...", answers[role, path].body)
                    answers[role, path] = replace(answers[role, path], body=body)
        transaction.set_rollback(True)
    return answers


def thinned(paths: list[str], limit: int) -> list[str]:
    """Every address without a question, few of the administration; of the others each question somewhere, and
    of the rest what fits, evenly.
    """
    of_admin = [path for path in paths if path.startswith("/admin/")]
    plain = [path for path in paths if "?" not in path and path not in of_admin[10:]]
    asked = [path for path in paths if "?" in path]
    once = list(somewhere(asked))
    rest = [path for path in asked if path not in set(once)]
    step = max(1.0, len(rest) / max(1, limit - len(plain) - len(once)))
    return plain + once + [rest[int(n * step)] for n in range(int(len(rest) / step))]


def somewhere(asked: list[str]) -> Iterator[str]:
    """Every question at one of the addresses that take it, a board's if there is one, each at the next."""
    takers_by_question: dict[str, list[str]] = {}
    for path in asked:
        address, question = path.split("?", maxsplit=1)
        takers_by_question.setdefault(question, []).append(address)
    for number, (question, takers) in enumerate(takers_by_question.items()):
        candidates = [address for address in takers if is_of_a_board(address)] or takers
        yield f"{candidates[number % len(candidates)]}?{question}"


def is_of_a_board(address: str) -> bool:
    return address.startswith(("/board/", "/api/v1/splits/"))


def differences(directory: Path, *, limit: int | None) -> tuple[list[str], int, dict[int, int]]:
    """What differs between the worlds, how many addresses were looked at, and the statuses there were."""
    without = looked_at(directory / "without", has_secrets=False, limit=limit)
    with_them = looked_at(directory / "with", has_secrets=True, limit=limit)
    assert without.keys() == with_them.keys()
    differing = []
    for key, one in without.items():
        other = with_them[key]
        if one != other:
            differing.append(f"{key}: {first_difference(one, other)}")
    statuses: dict[int, int] = {}
    for one in without.values():
        statuses[one.status] = statuses.get(one.status, 0) + 1
    return differing, len(without) // 2, statuses


def first_difference(one: Seen, other: Seen) -> str:
    if one.status != other.status:
        return f"status {one.status} and {other.status}"
    if one.headers != other.headers:
        return f"headers {set(one.headers) ^ set(other.headers)}"
    if one.cookies != other.cookies:
        return f"cookies {one.cookies} and {other.cookies}"
    pairs = zip(one.body, other.body, strict=False)
    at = next((n for n, pair in enumerate(pairs) if pair[0] != pair[1]), 0)
    excerpts = [seen.body[max(0, at - 60) : at + 60] for seen in (one, other)]
    return f"bytes {at}: {excerpts[0]!r} and {excerpts[1]!r}"


def test_nobody_sees_what_is_hidden_at_any_address(db: None, tmp_path: Path) -> None:
    differing, n_addresses, statuses = differences(tmp_path, limit=None if WHOLE else ADDRESSES_IN_THE_SUITE)
    assert not differing, f"{len(differing)} differ:\n" + "\n".join(differing[:20])
    assert n_addresses >= 400
    assert {200, 302, 400, 401, 404} <= set(statuses)
    assert not [status for status in statuses if status >= 500]


def test_boards_are_asked_whatever_their_pages_ask(db: None, tmp_path: Path) -> None:
    assert set(FILTERS) == set(filters.FILTERS), "give each its values in tests/security/addresses.py"
    asked = {name for name in QUERIES if name not in {"format", "team", "intervals", "mine", "as"}}
    assert BoardQuery(given=dict.fromkeys(asked, "x")).href(page="x").count("=") == len(asked)
    paths = thinned(addresses(build(tmp_path / "world", has_secrets=False)), ADDRESSES_IN_THE_SUITE)
    boards = [path for path in paths if is_of_a_board(path)]
    for question in (
        *(urlencode({name: value}) for name, values in FILTERS.items() for value in values),
        *TOGETHER,
    ):
        assert [path for path in boards if path.endswith(f"?{question}")], question


def test_what_is_hidden_is_there_and_would_be_noticed(db: None, tmp_path: Path) -> None:
    scene = build(tmp_path / "world", has_secrets=True)
    assert set(HIDDEN_METHODS) & set(Method.objects.values_list("pk", flat=True))
    assert Submission.objects.filter(pk__in=HIDDEN_SUBMISSIONS).count() >= 5
    paths = ["/", f"/methods/{HIDDEN_METHODS[0]}/", "/board/test/?sort=team"]

    def look() -> list[Seen]:
        forget_boards()
        return [seen(Client(REMOTE_ADDR=ADDRESS).get(path)) for path in paths]

    before = look()
    Method.objects.filter(pk=HIDDEN_METHODS[0]).update(visibility="ANONYMOUS", shown_at=START)
    forget_boards()
    assert all(one != other for one, other in zip(before, look(), strict=True))
    before = look()
    Method.objects.filter(pk=scene.methods[-1]).update(visibility="PUBLIC")
    forget_boards()
    assert b"Very Secret Net" not in before[0].body
    assert b"Very Secret Net" in look()[0].body
