"""A team sees on its submission that the board was corrected, and how to withdraw."""

from pathlib import Path

import pytest
from django.test import Client
from django.utils import timezone

from leaderboard.models import AuditEvent, Edition, Evaluation, Status, Submission, User
from leaderboard.submissions import intake
from leaderboard.submissions.progress import progress_of
from tests import builders, pages
from tests.editions import changed_on, corrected, extended, open_edition, publish, roll_back
from tests.leaderboard.web.maintain import queue_rows
from tests.leaderboard.web.test_every_page import assert_sound

pytestmark = pytest.mark.slow


CONFIRMED = {"confirm": "on"}


def address(submission: Submission, part: str = "") -> str:
    return f"/submissions/{submission.pk}/{part}"


def mid(submission: Submission, number: int) -> str:
    evaluation = submission.evaluations.get(edition__number=number)
    return f"{evaluation.scores.get(metric='mid', ttc_range='overall').value:.1f}"


@pytest.fixture
def sent(entries: list[Submission]) -> Submission:
    """One of the owner's scored submissions."""
    return entries[1]


def notices(client: Client, submission: Submission) -> list[str]:
    response = client.get(address(submission))
    assert response.status_code == 200
    return [p.text for p in assert_sound(response).one("div", id="outcome").all("p", class_="notice")]


# --- the board was corrected -------------------------------------------------------------------------------


def test_team_sees_what_a_correction_did_to_its_entry(
    signed_in: Client, sent: Submission, tmp_path: Path
) -> None:
    second = open_edition(corrected(tmp_path, factor=1.3))
    builders.score_all()
    publish(second)
    assert mid(sent, 1) != mid(sent, 2)
    assert notices(signed_in, sent) == [
        f"Re-scored in edition 2 on {changed_on()}: Labels corrected. MiD {mid(sent, 1)} → {mid(sent, 2)}. "
        "Edition 1 is unchanged; all editions."
    ]


def test_team_sees_that_a_correction_was_taken_back(
    signed_in: Client, sent: Submission, tmp_path: Path
) -> None:
    publish(open_edition(corrected(tmp_path, factor=1.3)), leave_out=True)
    builders.score_all()
    roll_back()
    (notice,) = notices(signed_in, sent)
    assert notice.startswith(f"Rolled back to edition 1 on {changed_on()}: A mistake. MiD {mid(sent, 2)} → ")


def test_team_sees_that_the_new_truth_cannot_score_its_file(
    signed_in: Client, sent: Submission, tmp_path: Path
) -> None:
    second = open_edition(extended(tmp_path))
    builders.score_all()
    publish(second, leave_out=True)
    assert notices(signed_in, sent) == [
        f"Edition 2 was published on {changed_on()}: Labels corrected. The new edition cannot score this "
        f"file; see the reason below. Its result in edition 1 stays: MiD {mid(sent, 1)}. "
        "Edition 1 is unchanged; all editions."
    ]
    outcome = pages.page(signed_in.get(address(sent))).one("div", id="outcome").text
    assert "Edition 2 cannot score this file. It keeps its result in edition 1" in outcome


@pytest.mark.parametrize(
    ("status", "words"),
    [
        (Status.QUEUED, "This file is waiting to be re-scored."),
        (Status.SYSTEM_ERROR, "Re-scoring this file failed because of a system error."),
        (Status.CANCELLED, "The new edition leaves this file out."),
    ],
)
def test_team_sees_when_its_file_is_not_scored_in_the_new_edition(
    signed_in: Client, sent: Submission, tmp_path: Path, status: Status, words: str
) -> None:
    second = open_edition(corrected(tmp_path, factor=1.3))
    Evaluation.objects.filter(edition=second, submission=sent).update(status=status)
    publish(second, leave_out=True)
    (notice,) = notices(signed_in, sent)
    assert f"Labels corrected. {words} Its result in edition 1 stays: MiD {mid(sent, 1)}." in notice


# --- withdrawing -------------------------------------------------------------------------------------------


def test_page_says_what_withdrawing_does_and_that_it_stays_done(signed_in: Client, sent: Submission) -> None:
    (link,) = [a for a in pages.page(signed_in.get(address(sent))).all("a") if a.text.startswith("Withdraw")]
    root = assert_sound(signed_in.get(link.attributes["href"]))
    assert "I understand that this cannot be undone." in root.one("main").text
    assert "removed from the current board and from all earlier editions" in root.one("main").text
    assert "It is the method’s only scored submission to Test. The row stays" in root.one("main").text
    assert root.one("main").one("button").text == "Withdraw"
    sent.refresh_from_db()
    assert sent.withdrawn_at is None


def test_page_of_the_best_says_that_the_next_best_replaces_it(
    signed_in: Client, edition: Edition, owner: User
) -> None:
    worse, better = (
        builders.submit(owner, builders.predictions(edition, factor=factor)) for factor in (1.2, 1.1)
    )
    builders.score_all()
    words = "It is the method’s best: the next-best submission to Test takes its place."
    answers = [
        words in signed_in.get(address(each, "withdraw/")).content.decode() for each in (worse, better)
    ]
    assert answers == [False, True]
    root = pages.page(signed_in.get(address(worse, "withdraw/")))
    assert "This submission is not on the current board, so no rank changes." in root.one("main").text


def test_withdrawing_asks_for_the_tick_that_publishing_asks_for(signed_in: Client, sent: Submission) -> None:
    response = signed_in.post(address(sent, "withdraw/"))
    assert response.status_code == 422
    wrong = pages.page(response).one("div", id="id_confirm_error").text
    assert wrong == "Confirm that this cannot be undone: tick the box."
    sent.refresh_from_db()
    assert sent.withdrawn_at is None


def test_team_withdraws_and_sees_when(client: Client, sent: Submission, teammate: User) -> None:
    client.force_login(teammate)
    response = client.post(address(sent, "withdraw/"), CONFIRMED, follow=True)
    assert response.redirect_chain == [(address(sent), 302)]
    assert "The submission is withdrawn." in pages.page(response).one("div", class_="messages").text
    line = pages.get(client, address(sent)).one("ol", class_="steps").all("li")
    assert line[-1].text.startswith("Withdrawn")
    sent.refresh_from_db()
    assert notices(client, sent)[0].startswith(f"Withdrawn by its team on {sent.withdrawn_at:%Y-%m-%d}")
    assert AuditEvent.objects.get(verb="withdrawn").actor == teammate


def test_what_waits_or_failed_is_cancelled_in_words_of_its_own(
    signed_in: Client, edition: Edition, owner: User
) -> None:
    failed = builders.submit(owner, builders.predictions(edition), method="Failed")
    queue_rows.strike_out()
    waiting = builders.submit(owner, builders.predictions(edition), method="Waiting")
    for submission, words, verb in (
        (failed, "it failed by an error on our side and has no scores", "withdrawn"),
        (waiting, "It is cancelled and not scored", "cancelled"),
    ):
        main = assert_sound(signed_in.get(address(submission, "withdraw/"))).one("main")
        assert words in main.text
        assert "removed from the current board" not in main.text
        done = signed_in.post(address(submission, "withdraw/"), CONFIRMED, follow=True)
        assert f"The submission is {verb}." in pages.page(done).one("div", class_="messages").text


def test_withdrawing_twice_is_withdrawing_once(signed_in: Client, sent: Submission) -> None:
    for _ in range(2):
        assert signed_in.post(address(sent, "withdraw/"), CONFIRMED).status_code == 302
    assert AuditEvent.objects.filter(verb="withdrawn").count() == 1
    assert signed_in.get(address(sent, "withdraw/")).headers["Location"] == address(sent)
    links = [a.text for a in pages.page(signed_in.get(address(sent))).all("a")]
    assert not [text for text in links if text.startswith("Withdraw")]


def test_an_edition_in_preparation_says_nothing_of_what_was_withdrawn_under_a_former_board(
    entries: list[Submission], edition: Edition, owner: User, tmp_path: Path
) -> None:
    second = open_edition(corrected(tmp_path, factor=1.3))
    builders.score_all()
    publish(second)
    open_edition(corrected(tmp_path, factor=1.6))
    sent = builders.submit(owner, builders.predictions(edition, factor=1.15), method="Late")
    builders.score_all()
    assert sorted(sent.evaluations.values_list("edition__number", flat=True)) == [2, 3]
    intake.withdraw(submission=sent, actor=owner, now=timezone.now())
    roll_back()
    sent = Submission.objects.get(pk=sent.pk)
    assert progress_of(sent).edition_number == 2
