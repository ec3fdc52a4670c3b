"""The API's answer about a scored submission beyond its scores: intervals, and its rank on the board."""

from pathlib import Path
from typing import Any

import pytest
from django.db.models import F
from django.utils import timezone
from rest_framework.test import APIClient

from leaderboard.models import Edition, Evaluation, Submission, User
from leaderboard.submissions import intake, outcomes
from tests import builders
from tests.editions import corrected, open_edition, publish
from tests.leaderboard.api.test_submissions import client_of

LIST = "/api/v1/submissions"
BOARD = "/api/v1/splits/test/board"
PARTS = {"low", "high", "rank_low", "rank_high", "is_with_best", "reason"}


@pytest.fixture
def client(owner: User) -> APIClient:
    return client_of(owner)


def look(client: APIClient, submission: Submission, **query: str) -> dict[str, Any]:
    body: dict[str, Any] = client.get(f"{LIST}/{submission.pk}", query).json()
    return body


@pytest.mark.slow
def test_intervals_and_rank_are_those_of_the_board(client: APIClient, entries: list[Submission]) -> None:
    builders.infer_all()
    rows = {row["method_id"]: row for row in client.get(BOARD, {"intervals": "1"}).json()["entries"]}
    for submission in entries:
        body = look(client, submission)
        row = rows[str(submission.method_id)]
        assert (body["rank"], body["intervals"]) == (row["rank"], row["intervals"])
        assert set(body["intervals"]["mid"]) == PARTS
        assert body["intervals"]["mid"]["rank_low"] <= body["rank"] <= body["intervals"]["mid"]["rank_high"]


def test_until_they_are_computed_intervals_are_awaited(client: APIClient, entries: list[Submission]) -> None:
    before = look(client, entries[0])
    assert (before["is_final"], before["intervals"], before["awaits_intervals"]) == (True, {}, True)
    assert before["rank"] is not None
    builders.infer_all()
    after = look(client, entries[0])
    assert after["awaits_intervals"] is False
    assert after["intervals"]


def test_nobody_waits_for_ever(client: APIClient, entries: list[Submission]) -> None:
    Evaluation.objects.update(finished_at=F("finished_at") - outcomes.AWAITED_FOR)
    assert look(client, entries[0])["awaits_intervals"] is False


@pytest.mark.slow
def test_private_one_has_intervals_no_range_and_the_rank_that_it_would_have(
    client: APIClient, entries: list[Submission], edition: Edition, owner: User
) -> None:
    sent = builders.submit(
        owner, builders.predictions(edition, factor=1.01), method="Hidden", visibility="PRIVATE"
    )
    builders.score_all()
    builders.infer_all()
    body = look(client, sent)
    assert (body["visibility"], body["rank"]) == ("PRIVATE", 1)
    mid = body["intervals"]["mid"]
    assert mid["low"] <= body["scores"]["mid"] <= mid["high"]
    assert (mid["rank_low"], mid["rank_high"], mid["is_with_best"]) == (None, None, None)
    # Nobody's rank has changed by it.
    assert look(client, entries[0])["rank"] == 1


@pytest.mark.slow
def test_surpassed_one_has_intervals_and_neither_rank_nor_range(
    client: APIClient, edition: Edition, owner: User
) -> None:
    worse, better = (builders.submit(owner, builders.predictions(edition, factor=f)) for f in (1.2, 1.1))
    builders.score_all()
    builders.infer_all()
    body = look(client, worse)
    assert body["rank"] is None
    assert body["intervals"]["mid"]["low"] is not None
    assert body["intervals"]["mid"]["rank_low"] is None
    assert look(client, better)["rank"] is not None


def test_withdrawn_one_has_no_rank(client: APIClient, entries: list[Submission], owner: User) -> None:
    builders.infer_all()
    intake.withdraw(submission=entries[0], actor=owner, now=timezone.now())
    body = look(client, entries[0])
    assert body["rank"] is None
    assert {interval["rank_low"] for interval in body["intervals"].values()} == {None}


def test_result_of_a_former_edition_has_no_rank(
    client: APIClient, entries: list[Submission], tmp_path: Path
) -> None:
    builders.infer_all()
    second = open_edition(corrected(tmp_path, factor=1.3))
    second.evaluations.all().delete()
    publish(second, leave_out=True)
    # Publishing has queued what the edition lacks.
    second.evaluations.all().delete()
    body = look(client, entries[0])
    assert (body["edition"], body["rank"]) == (1, None)
    assert {interval["rank_low"] for interval in body["intervals"].values()} == {None}


@pytest.mark.slow
def test_list_tells_of_each_what_its_own_address_tells(
    client: APIClient, entries: list[Submission], edition: Edition, owner: User
) -> None:
    for factor in (1.15, 1.3):
        builders.submit(
            owner, builders.predictions(edition, factor=factor), method="Hidden", visibility="PRIVATE"
        )
    builders.score_all()
    builders.infer_all()
    listed = client.get(LIST).json()
    assert len(listed) == 6
    assert [row["rank"] is None for row in listed].count(True) == 1
    for row in listed:
        assert row == client.get(f"{LIST}/{row['id']}").json()
