"""Requests with an Idempotency-Key: the same one twice is one submission."""

from datetime import timedelta
from io import StringIO

import pytest
from django.core.management import call_command
from django.db import connection
from django.utils import timezone
from rest_framework.test import APIClient

from leaderboard.models import Edition, IdempotencyKey, Membership, Method, Split, Submission, User
from leaderboard.submissions import idempotency, submissions
from tests import builders
from tests.leaderboard.api.test_submissions import client_of, post
from tests.leaderboard.scoring.test_lifecycle_races import at_once


def keyed(client: APIClient, key: str, data: bytes, **fields: str):
    client.defaults["HTTP_IDEMPOTENCY_KEY"] = key
    return post(client, data, **fields)


def test_same_key_and_request_are_answered_with_the_same_submission(edition: Edition, owner: User) -> None:
    client, data = client_of(owner), builders.predictions(edition)
    first = keyed(client, '"abc-1"', data, note="x")
    again = keyed(client, "abc-1", data, note="x")  # quotes are the draft's, and mean nothing
    assert (first.status_code, again.status_code) == (201, 200)
    assert first.json()["id"] == again.json()["id"]
    assert first.headers["Location"] == again.headers["Location"]
    assert "Idempotent-Replayed" not in first.headers
    assert again.headers["Idempotent-Replayed"] == "true"
    assert again.json()["quota"]
    assert Submission.objects.count() == IdempotencyKey.objects.count() == 1


@pytest.mark.parametrize("change", [{"method": "Bar"}, {"note": "y"}, {"factor": "1.3"}, {"split": "val"}])
def test_same_key_with_anything_else_is_a_409_and_keeps_nothing(
    edition: Edition, owner: User, change: dict[str, str]
) -> None:
    client = client_of(owner)
    keyed(client, "k", builders.predictions(edition))
    factor = float(change.pop("factor", "1.1"))
    response = keyed(client, "k", builders.predictions(edition, factor=factor), **change)
    body = response.json()
    assert (response.status_code, body["code"]) == (409, "idempotency-key-reused")
    assert "expected a new key" in body["detail"]
    assert Submission.objects.count() == Method.objects.count() == 1


@pytest.mark.parametrize("key", ["", '""', "a b", '"a', 'a"b', "k" * 256, '"' + "k" * 256 + '"', "schlüssel"])
def test_malformed_key_is_a_400(edition: Edition, owner: User, key: str) -> None:
    response = keyed(client_of(owner), key, builders.predictions(edition))
    assert (response.status_code, response.json()["code"]) == (400, "bad-idempotency-key")
    assert response.json()["problems"][0]["where"] == "Idempotency-Key"
    assert not Submission.objects.exists()


def test_keys_belong_to_a_person(edition: Edition, owner: User, teammate: User, stranger: User) -> None:
    data = builders.predictions(edition)
    ids = [keyed(client_of(user), "k", data).json()["id"] for user in (owner, stranger)]
    assert len(set(ids)) == 2
    # A teammate's key is another one, but the same bytes are the same submission.
    assert keyed(client_of(teammate), "k", data).json()["id"] == ids[0]


def test_what_was_refused_burns_no_key(edition: Edition, owner: User) -> None:
    client, data = client_of(owner), builders.predictions(edition)
    assert keyed(client, "k", data, method="").status_code == 422
    Split.objects.filter(pk="test").update(quota_limit=0)
    assert keyed(client, "k", data).status_code == 429
    Split.objects.filter(pk="test").update(quota_limit=1)
    assert keyed(client, "k", data).status_code == 201
    # A replay costs nothing where nothing is left.
    assert keyed(client, "k", data).status_code == 200


def test_who_left_the_team_is_not_shown_its_submission(edition: Edition, teammate: User) -> None:
    client, data = client_of(teammate), builders.predictions(edition)
    assert keyed(client, "k", data).status_code == 201
    Membership.objects.filter(user=teammate).delete()
    assert keyed(client, "k", data).status_code == 409


def test_keys_are_kept_for_seven_days_and_then_cleaned(edition: Edition, owner: User) -> None:
    client, data = client_of(owner), builders.predictions(edition)
    keyed(client, "old", data)
    keyed(client, "young", data)
    now = timezone.now()
    IdempotencyKey.objects.filter(key="old").update(created_at=now - timedelta(days=7, minutes=1))
    IdempotencyKey.objects.filter(key="young").update(created_at=now - timedelta(days=6, hours=23))
    call_command("clean_files", stdout=StringIO())
    assert IdempotencyKey.objects.count() == 2
    call_command("clean_files", "--remove", stdout=(out := StringIO()))
    assert "1 idempotency key of more than 7 days ago removed." in out.getvalue()
    assert list(IdempotencyKey.objects.values_list("key", flat=True)) == ["young"]


def test_method_is_named_by_name_or_by_id(edition: Edition, owner: User, stranger: User) -> None:
    client = client_of(owner)
    first = post(client, builders.predictions(edition)).json()
    again = post(client, builders.predictions(edition, factor=1.2), method=first["method_id"])
    assert (again.status_code, again.json()["method"]) == (201, "Foo")
    others = post(client_of(stranger), builders.predictions(edition), method=first["method_id"])
    assert (others.status_code, others.json()["code"]) == (422, "unknown-method")
    assert Method.objects.count() == 1


@pytest.mark.django_db(transaction=True)
@pytest.mark.skipif(
    connection.vendor != "postgresql",
    reason="SQLite in memory has one connection for all; `python -m tests.on_postgresql` runs this",
)
@pytest.mark.parametrize("n_bodies", [1, 4])
def test_one_key_at_the_same_moment_is_one_submission(edition: Edition, owner: User, n_bodies: int) -> None:
    builders.submit(owner, builders.predictions(edition, factor=2.0))  # the team is there
    files = [builders.predictions(edition, factor=1.1 + number / 10) for number in range(n_bodies)]
    now = timezone.now()

    def send(key: str, number: int) -> str:
        def submit() -> submissions.Submitted:
            return builders.send(owner, files[number % n_bodies], now=now)

        try:
            answer = idempotency.once(
                user=owner, key=key, digest=str(number % n_bodies), submit=submit, now=now
            )
        except idempotency.KeyReused:
            return "reused"
        return str(answer.submission.pk)

    winners = set()
    for key in ("a", "b", "c"):
        answers = at_once(*[lambda number=number, key=key: send(key, number) for number in range(8)])
        # The winner's twins are answered with its submission, everybody else is told that the key is taken.
        assert answers.count("reused") == 8 - 8 // n_bodies
        assert len(set(answers) - {"reused"}) == 1
        winners |= set(answers) - {"reused"}
    assert IdempotencyKey.objects.count() == 3
    # What a loser wrote is undone with its key.
    assert Submission.objects.count() == 1 + len(winners)
