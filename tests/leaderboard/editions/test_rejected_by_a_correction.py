"""Entries that a correction cannot score: published only knowingly, no slot of the quota, and true words."""

from datetime import timedelta
from pathlib import Path

import pytest
from django.test import Client
from django.utils import timezone

from leaderboard.errors.refusals import Refused
from leaderboard.models import Edition, Publication, Split, Status, Submission, User
from leaderboard.people import teams
from leaderboard.quotas import usage
from leaderboard.quotas.usage import Quota
from leaderboard.submissions.progress import progress_of
from tests import builders
from tests.editions import extended, open_edition, publish, roll_back
from tests.leaderboard.web.test_every_page import assert_sound

PUBLISH = "/maintain/test/editions/2/publish/"


@pytest.fixture
def sent(edition: Edition, owner: User) -> Submission:
    """A public, scored submission."""
    submission = builders.submit(owner, builders.predictions(edition), method="Foo")
    builders.score_all()
    return submission


@pytest.fixture
def adding(sent: Submission, tmp_path: Path) -> Edition:
    """An edition in preparation with one sequence more, in which the submission is rejected."""
    second = open_edition(extended(tmp_path))
    builders.score_all()
    return second


def left(user: User) -> Quota:
    Split.objects.update(quota_limit=3, quota_window=timedelta(days=30), quota_min_gap=timedelta(days=1))
    split = Split.objects.get(pk="test")
    return usage.state(team=teams.team_of(user=user), user=user, split=split, now=timezone.now())


def test_publishing_is_refused_by_every_door_until_the_entries_are_left_out_knowingly(
    sent: Submission, adding: Edition, keeper: Client
) -> None:
    sentence = f"test edition 2 rejects 1 entry that the board scores: Foo ({sent.pk})."
    with pytest.raises(Refused) as refused:
        publish(adding)
    assert sentence in str(refused.value)
    data = {"replaces": "1", "reason": "More labels."}
    answer = keeper.post(PUBLISH, data)
    assert answer.status_code == 422
    form = assert_sound(answer)
    assert sentence in form.one("div", class_="form-errors").text
    assert form.one("legend").text == "1 scored submission rejected"
    assert "checked" not in form.one("input", name="leave_out").attributes
    assert Publication.objects.count() == 1
    assert keeper.post(PUBLISH, {**data, "leave_out": "on"}).status_code == 302
    assert Publication.objects.get(edition=adding).left_out == [str(sent.pk)]
    assert keeper.get("/api/v1/splits/test/changelog").json()[0]["n_left_out"] == 1


def test_the_slot_is_given_back_for_as_long_as_the_board_rejects_the_entry(
    sent: Submission, adding: Edition, owner: User
) -> None:
    assert (left(owner).used, left(owner).is_open) == (1, False)
    publish(adding, leave_out=True)
    quota = left(owner)
    assert (quota.used, quota.n_rejected, quota.is_open) == (0, 0, True)
    new = builders.submit(owner, builders.predictions(adding), method="Foo")
    builders.score_all()
    assert progress_of(new).state == Status.SCORED
    assert left(owner).used == 1
    roll_back()
    assert left(owner).used == 2


def test_the_words_are_true_wherever_they_stand(
    sent: Submission, adding: Edition, client: Client, owner: User
) -> None:
    publish(adding, leave_out=True)
    board = assert_sound(client.get("/board/test/")).one("main").text
    assert "no submissions yet" not in board
    assert "Edition 2 has no scored submission yet: submit a file for the new manifest; 1 submission" in board
    client.force_login(owner)
    text = "Edition 2 cannot score this file. It keeps its result in edition 1, and your quota is refunded."
    page = assert_sound(client.get(f"/submissions/{sent.pk}/"))
    outcome = page.one("div", id="outcome").text
    assert text in outcome
    assert "problem in the file" not in outcome
    progress = progress_of(Submission.objects.get(pk=sent.pk))
    assert (progress.sentence, progress.kept_in) == (text, 1)
