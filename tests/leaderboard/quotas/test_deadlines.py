"""Late, closed and future splits: every door says so, with a time and its zone, and soon after it comes."""

import random
from datetime import datetime, timedelta

import pytest
from django.core.files.base import ContentFile
from django.test import Client
from django.utils import timezone
from rest_framework.test import APIClient

from leaderboard import board_versions
from leaderboard.models import BoardVersion, Edition, Split, User
from leaderboard.quotas import admissions
from leaderboard.upkeep import pollers
from tests import builders, pages
from tests.leaderboard.api.test_submissions import client_of, post

HOUR = timedelta(hours=1)
LATE, FUTURE, ENDING = "late", "future", "ending"


def set_times(kind: str) -> str:
    """Give the split `test` these times; what is said of them."""
    now = timezone.now()
    times: dict[str, dict[str, datetime]] = {
        LATE: {"closes_at": now - HOUR},
        FUTURE: {"opens_at": now + HOUR},
        ENDING: {"opens_at": now - HOUR, "closes_at": now + HOUR},
    }
    Split.objects.filter(pk="test").update(**times[kind])
    at = list(times[kind].values())[-1]
    verb = {LATE: "closed", FUTURE: "open", ENDING: "close"}[kind]
    return f"Submissions to Test {verb} at {at:%Y-%m-%d %H:%M} UTC."


@pytest.mark.slow
@pytest.mark.parametrize("kind", [LATE, FUTURE, ENDING])
def test_board_form_quota_and_api_say_when(edition: Edition, owner: User, client: Client, kind: str) -> None:
    sentence = set_times(kind)
    label = {
        LATE: "Closed for submissions since",
        FUTURE: "Opens for submissions",
        ENDING: "Open for submissions until",
    }
    assert label[kind] in pages.page(client.get("/board/test/")).one("main").text
    client.force_login(owner)
    assert sentence in pages.page(client.get("/submit/")).one("main").text
    if kind != ENDING:
        data = builders.predictions(edition)
        refused = post(client_of(owner), data)
        assert (refused.status_code, refused.json()["detail"]) == (409, sentence)
        form = {"split": "test", "method": "Foo", "file": ContentFile(data, name="p.json")}
        page = client.post("/submit/", form)
        assert (page.status_code, sentence in page.content.decode()) == (422, True)
    [quota] = [row for row in client_of(owner).get("/api/v1/quota").json() if row["split"] == "test"]
    split = Split.objects.get(pk="test")
    for answer in (
        client.get("/api/v1/splits/test/board").json(),
        next(row for row in APIClient().get("/api/v1/splits").json() if row["split"] == "test"),
    ):
        assert answer["is_open"] is (kind == ENDING)
        for name in ("opens_at", "closes_at"):
            at = getattr(split, name)
            assert answer[name] == (at and at.isoformat().replace("+00:00", "Z"))
    assert quota["is_open"] is (kind == ENDING)
    if kind != ENDING:
        assert quota["sentence"] == sentence
    assert (quota["next_slot_at"] is not None) is (kind == FUTURE)


@pytest.mark.slow
def test_kept_answers_hear_of_a_time_that_has_come(edition: Edition, client: Client) -> None:
    opens_at = timezone.now() + HOUR
    Split.objects.filter(pk="test").update(opens_at=opens_at, closes_at=opens_at + HOUR)
    board_versions.bump_passed_deadlines(now=timezone.now())
    before = board_versions.sum_of_all()
    assert "Opens for submissions" in client.get("/board/test/").text
    # It has opened; then it has closed; then a maintainer gives more time.
    for shift, phrase in (
        (-HOUR / 2, "Open for submissions until"),
        (-3 * HOUR, "Closed for submissions"),
        (-HOUR / 2, "Open for submissions until"),
    ):
        moment = timezone.now() + shift
        Split.objects.filter(pk="test").update(opens_at=moment, closes_at=moment + HOUR)
        pollers.sweep(rng=random.Random(0))
        assert board_versions.sum_of_all() > before
        before = board_versions.sum_of_all()
        assert phrase in client.get("/board/test/").text
        assert board_versions.bump_passed_deadlines(now=timezone.now()) == 0
    assert BoardVersion.objects.get(split="test").n_times_passed == 1


def test_a_split_without_times_changes_nothing_by_itself(edition: Edition) -> None:
    before = board_versions.sum_of_all()
    assert board_versions.bump_passed_deadlines(now=timezone.now() + timedelta(days=10_000)) == 0
    assert board_versions.sum_of_all() == before
    assert admissions.sentence_of(Split.objects.get(pk="test"), now=timezone.now()) == ""


# --- what filters leave -----------------------------------------------------------------------------------
