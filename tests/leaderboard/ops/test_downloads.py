"""Large files are sent a few at a time, so that answers nobody reads leave threads for others."""

import pytest
from django.core.signals import request_finished
from django.db import close_old_connections
from django.http.response import HttpResponseBase
from django.test import Client

from leaderboard.models import Edition, Submission, User
from leaderboard.ops import downloads
from tests import builders


@pytest.fixture
def submission(edition: Edition, owner: User, monkeypatch: pytest.MonkeyPatch) -> Submission:
    """A file that counts as large, of a team whose token a client has."""
    monkeypatch.setattr(downloads, "SMALL_BYTES", 100)
    return builders.submit(owner, builders.predictions(edition))


def begin(client: Client, address: str) -> HttpResponseBase:
    """The answer to a reader who reads nothing of it."""
    return client.get(address)


def end(answer: HttpResponseBase) -> None:
    """Close an answer that is not read to its end, and leave the test its connection to the database."""
    request_finished.disconnect(close_old_connections)
    try:
        answer.close()
    finally:
        request_finished.connect(close_old_connections)


def test_one_large_file_too_many_is_a_problem_with_a_time_until_another_is_sent(
    submission: Submission, owner: User
) -> None:
    client = Client(headers={"Authorization": f"Bearer {builders.token(owner)}"})
    # Two addresses: the files of a process are counted together.
    file, manifest = f"/api/v1/submissions/{submission.pk}/file", "/api/v1/splits/test/manifest"
    unread = [begin(client, file), begin(Client(), manifest)]
    assert {answer.status_code for answer in unread} == {200}
    for address in (file, manifest):
        refused = begin(client, address)
        assert (refused.status_code, refused["Content-Type"]) == (503, "application/problem+json")
        assert refused["Retry-After"] == "5"
        assert refused.json()["code"] == "site-busy"  # type: ignore[attr-defined]  # a test answer has it
    assert client.get("/api/v1/submissions").status_code == 200
    # Closed twice, as a server may, it makes room for one.
    end(unread[0])
    end(unread[0])
    unread.append(begin(client, manifest))
    assert unread[-1].status_code == 200
    assert begin(client, file).status_code == 503
    for answer in unread:
        end(answer)


def test_small_files_are_never_counted(edition: Edition) -> None:
    unread = [begin(Client(), "/api/v1/splits/test/manifest") for _ in range(downloads.MOST_AT_ONCE + 3)]
    assert {answer.status_code for answer in unread} == {200}
    for answer in unread:
        end(answer)


def test_what_is_known_already_takes_no_room(submission: Submission) -> None:
    first = begin(Client(), "/api/v1/splits/test/manifest")
    known = {"If-None-Match": first["ETag"]}
    unread = [first, begin(Client(), "/api/v1/splits/test/manifest")]
    assert Client().get("/api/v1/splits/test/manifest", headers=known).status_code == 304
    for answer in unread:
        end(answer)
