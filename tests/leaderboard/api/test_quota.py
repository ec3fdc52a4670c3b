"""The API's answers about quotas."""

from datetime import datetime, timedelta

import pytest
from rest_framework.test import APIClient

from leaderboard.models import Edition, Split, Submission, User
from tests import builders
from tests.leaderboard.api.test_submissions import client_of, post


def quota_of(client: APIClient, split: str = "test") -> dict[str, object]:
    [row] = [row for row in client.get("/api/v1/quota").json() if row["split"] == split]
    return row


def test_quota_tells_each_splits_rules_and_what_is_left(edition: Edition, owner: User) -> None:
    Split.objects.filter(pk="test").update(
        quota_limit=3, quota_window=timedelta(days=30), quota_min_gap=timedelta(hours=24)
    )
    client = client_of(owner)
    assert [row["split"] for row in client.get("/api/v1/quota").json()] == ["test", "val", "demo"]
    assert quota_of(client) == {
        "limit": 3,
        "used": 0,
        "left": 3,
        "next_slot_at": None,
        "split": "test",
        "is_open": True,
        "window_s": 30 * 86_400,
        "min_gap_s": 86_400,
        "rejected_used": 0,
        "rejected_limit": None,
        "sentence": "3 of 3 submissions left (limit per 30 days), at least 24 hours apart.",
    }


@pytest.mark.slow
def test_submission_is_answered_with_what_is_left_after_it(edition: Edition, owner: User) -> None:
    Split.objects.filter(pk="test").update(quota_limit=2, quota_min_gap=timedelta(hours=1))
    client = client_of(owner)
    submitted = post(client, builders.predictions(edition)).json()
    first = submitted["quota"]
    assert (first["limit"], first["used"], first["left"]) == (2, 1, 1)
    sent_at = Submission.objects.get().submitted_at
    assert datetime.fromisoformat(first["next_slot_at"]) == sent_at + timedelta(hours=1)
    again = post(client, builders.predictions(edition))
    assert (again.status_code, again.json()["quota"]) == (200, first)
    assert again.json()["id"] == submitted["id"]


@pytest.mark.slow
def test_an_exhausted_quota_is_a_429_that_says_when_to_come_back(edition: Edition, owner: User) -> None:
    Split.objects.filter(pk="test").update(quota_limit=1, quota_window=timedelta(hours=2))
    client = client_of(owner)
    post(client, builders.predictions(edition))
    response = post(client, builders.predictions(edition, factor=1.2))
    body = response.json()
    assert response.status_code == 429
    assert response.headers["Content-Type"] == "application/problem+json"
    assert (body["code"], body["problems"][0]["where"]) == ("quota-exceeded", "split")
    assert "used 1 submission to Test, its quota for 2 hours" in body["detail"]
    assert 7190 <= int(response.headers["Retry-After"]) <= 7200
    assert Submission.objects.count() == 1
    assert not quota_of(client)["is_open"]
