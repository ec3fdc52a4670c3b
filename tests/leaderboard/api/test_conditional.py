"""Every answer of the API has an ETag; a client that sends a current one gets a 304 without a body."""

from typing import Any

import pytest
from django.test import Client

from leaderboard.models import Edition, Submission, User
from tests import builders
from tests.openapi import schema

pytestmark = pytest.mark.slow


@pytest.fixture
def shown(edition: Edition, owner: User) -> Submission:
    """A public method on the board, compared with another one."""
    sent = [
        builders.submit(owner, builders.predictions(edition, factor=1 + n / 10), method=f"M{n}")
        for n in range(2)
    ]
    builders.score_all()
    builders.infer_all()
    pair = [("split", "test"), *(("m", str(each.method_id)) for each in sent)]
    Client().get("/api/v1/compare", pair)
    builders.infer_all()
    return sent[0]


def asked(client: Client, address: str, *, known: str = "") -> Any:
    """The answer, read to its end, for a reader who has this tag."""
    response = client.get(address, headers={"If-None-Match": known} if known else {})
    response.getvalue()
    return response


def addresses(shown: Submission) -> list[str]:
    """Everything that can be read, filled with what is there."""
    values = {
        "split": "test",
        "number": 1,
        "method_id": shown.method_id,
        "submission_id": shown.pk,
        "name": "main-results",
    }
    described = schema()["paths"]
    paths = [path.format(**values) for path, operations in described.items() if "get" in operations]
    other = Submission.objects.exclude(pk=shown.pk).get()
    pair = f"split=test&m={shown.method_id}&m={other.method_id}"
    return [
        *(f"{path}?{pair}" if path.endswith("/compare") else path for path in paths),
        "/api/v1/splits/test/board?at=2030-01-01",
        f"/api/v1/splits/test/board?at={shown.submitted_at:%Y-%m-%d}",
    ]


@pytest.mark.parametrize(("is_signed_in", "n_least"), [(False, 10), (True, 15)])
def test_whatever_is_answered_has_a_tag_that_is_a_304_when_it_is_asked_with(
    shown: Submission, owner: User, is_signed_in: bool, n_least: int
) -> None:
    client = Client()
    if is_signed_in:
        client.force_login(owner)
    n_answered = 0
    for address in addresses(shown):
        first = asked(client, address)
        if first.status_code != 200:
            assert not first.has_header("ETag"), address
            continue
        n_answered += 1
        tag = first["ETag"]
        assert tag.startswith('"'), address
        for known in (tag, f"W/{tag}", f'"other", {tag}', "*"):
            again = asked(client, address, known=known)
            assert (again.status_code, again.getvalue(), again["ETag"]) == (304, b"", tag), address
        for response in (first, again):
            expected = "private, no-store" if is_signed_in else "public, no-cache"
            assert response["Cache-Control"] == expected, address
            assert {"Cookie", "Authorization"} <= set(response["Vary"].split(", ")), address
        assert asked(client, address, known='"other"').status_code == 200, address
        head = client.head(address)
        head.getvalue()  # to its end, which closes what it would be sent from
        assert head["ETag"].startswith('"'), address
    assert n_answered >= n_least


def test_what_is_known_varies_and_may_be_kept_as_the_whole_answer(shown: Submission, client: Client) -> None:
    """Else a cache that several people share mixes what it says to people with and without a token."""
    answers = {address: asked(client, address) for address in addresses(shown)}
    tagged = {address: whole for address, whole in answers.items() if whole.has_header("ETag")}
    assert len(tagged) > 10
    for address, whole in tagged.items():
        known = asked(client, address, known=whole.headers["ETag"])
        assert known.status_code == 304, address
        for name in ("ETag", "Vary", "Cache-Control"):
            assert known.headers.get(name) == whole.headers.get(name), address
