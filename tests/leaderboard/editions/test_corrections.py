"""`rescoring`: open an edition, follow it, publish it, go back."""

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
from django.core.management import CommandError, call_command
from django.utils import timezone

from evaluator import Predictions, Rejected, evaluate, read_truth, rounded
from leaderboard.boards.rows import flat_scores
from leaderboard.editions import corrections
from leaderboard.errors.refusals import NotMaintainer, Refused
from leaderboard.models import (
    AuditEvent,
    Edition,
    Evaluation,
    Publication,
    Split,
    Status,
    Submission,
    User,
)
from leaderboard.statistics import recording_sums
from leaderboard.storage import files, truth_values
from tests import builders
from tests.editions import FACTORS, board_now, corrected, open_edition, publish, roll_back


def test_opening_queues_every_active_submission_once_and_changes_nothing_public(
    entries: list[Submission], tmp_path: Path
) -> None:
    before = board_now()
    path = corrected(tmp_path, factor=1.3)
    edition = open_edition(path)
    assert (edition.number, edition.published_at) == (2, None)
    assert open_edition(path) == edition
    queued = Evaluation.objects.filter(edition=edition)
    assert {evaluation.submission for evaluation in queued} == set(entries)
    assert all(e.priority == Evaluation.PRIORITY_RESCORE and e.status == Status.QUEUED for e in queued)
    builders.score_all()
    assert board_now() == before


def test_rescoring_gives_what_the_evaluator_gives_without_reading_the_file_again(
    entries: list[Submission], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = corrected(tmp_path, factor=1.3)
    edition = open_edition(path)
    for submission in entries:
        files.store().delete(files.predictions_name(submission.digest))
    builders.score_all()
    truth = read_truth(path)
    old = truth_values.load(Split.objects.get(pk="test").current_edition.ground_truth_id)
    for submission, factor in zip(entries, FACTORS, strict=True):
        evaluation = Evaluation.objects.get(submission=submission, edition=edition)
        values = Predictions.from_arrays(
            ttc_s=old.ttc_s * factor, manifest=truth.manifest, digest=submission.digest
        )
        report = evaluate(values, truth, keep_bags=True)
        expected = {name: rounded(value, decimals=1) for name, value in report.flat().items()}
        assert flat_scores(evaluation) == expected
        # To the last bit, also of what is not published.
        assert evaluation.report_digest == f"sha256:{hashlib.sha256(report.to_json().encode()).hexdigest()}"
        assert report.bags is not None
        assert np.array_equal(recording_sums.load(edition, file=submission.sent_file), report.bags.sums)


def test_new_uploads_meanwhile_are_scored_in_both(
    entries: list[Submission], owner: User, edition: Edition, tmp_path: Path
) -> None:
    second = open_edition(corrected(tmp_path, factor=1.3))
    submission = builders.submit(owner, builders.predictions(edition, factor=1.01), method="New")
    builders.score_all()
    states = {e.edition.number: e.status for e in submission.evaluations.select_related("edition")}
    assert states == {1: Status.SCORED, 2: Status.SCORED}
    assert corrections.unfinished(second) == []


def test_only_a_draft_has_a_rate_and_a_time_that_is_left(
    entries: list[Submission], owner: User, edition: Edition, tmp_path: Path
) -> None:
    second = open_edition(corrected(tmp_path, factor=1.3))
    builders.score_all()
    builders.submit(owner, builders.predictions(edition, factor=1.01), method="New")
    board, draft = corrections.progress(edition), corrections.progress(second)
    assert (board.n_waiting, draft.n_waiting) == (1, 1)
    assert (board.rate_per_s, board.left_s) == (None, None), "its files came over weeks"
    assert None not in (draft.rate_per_s, draft.left_s)


@pytest.mark.slow
def test_publishing_flips_the_board_and_rolling_back_returns_it_as_it_was(
    entries: list[Submission], tmp_path: Path, client
) -> None:
    address = "/api/v1/splits/test/board"
    before = client.get(address).content
    second = open_edition(corrected(tmp_path, factor=1.3))
    builders.score_all()
    publish(second)
    assert json.loads(client.get(address).content)["edition"] == 2
    roll_back()
    assert client.get(address).content == before
    kinds = list(Publication.objects.values_list("kind", "edition__number").order_by("pk"))
    assert kinds == [("PUBLISHED", 1), ("PUBLISHED", 2), ("ROLLED_BACK", 1)]
    assert AuditEvent.objects.filter(verb="rolled_back").get().details["reason"] == "A mistake."


def test_publishing_refuses_while_anything_is_unfinished_and_says_what(
    entries: list[Submission], tmp_path: Path
) -> None:
    edition = open_edition(corrected(tmp_path, factor=1.3))
    with pytest.raises(Refused, match=r"4 submissions are neither scored nor rejected: M1.05"):
        publish(edition)
    assert board_now().edition.number == 1
    publication = publish(edition, leave_out=True)
    assert set(publication.left_out) == {str(submission.pk) for submission in entries}


def test_publishing_refuses_when_the_board_is_not_the_one_previewed(
    entries: list[Submission], tmp_path: Path
) -> None:
    second = open_edition(corrected(tmp_path, factor=1.3))
    third = open_edition(corrected(tmp_path, factor=1.4))
    builders.score_all()
    publish(second)
    with pytest.raises(Refused, match="is 2, no longer 1; look again"):
        publish(third, replaces=1)
    assert board_now().edition == second


def test_only_maintainers_change_editions(
    entries: list[Submission], owner: User, maintainer: User, tmp_path: Path
) -> None:
    path = corrected(tmp_path, factor=1.3)
    second = open_edition(path, actor=maintainer)
    builders.score_all()
    common = {"reason": "x", "now": timezone.now(), "actor": owner}
    for verb in (
        lambda: open_edition(path, actor=owner),
        lambda: corrections.publish(edition=second, replaces=1, **common),
        lambda: corrections.roll_back(split_name="test", replaces=1, **common),
        lambda: corrections.discard(edition=second, **common),
    ):
        with pytest.raises(NotMaintainer):
            verb()
    assert board_now().edition.number == 1


def test_what_came_after_a_publication_is_scored_in_the_edition_that_returns(
    entries: list[Submission], owner: User, edition: Edition, tmp_path: Path
) -> None:
    second = open_edition(corrected(tmp_path, factor=1.3))
    builders.score_all()
    publish(second)
    late = builders.submit(owner, builders.predictions(edition, factor=1.01), method="Late")
    builders.score_all()
    roll_back()
    builders.score_all()
    assert late.evaluations.get(edition=edition).status == Status.SCORED
    assert "Late" in {entry.method for entry in board_now().entries}


def test_edition_that_was_rolled_back_can_be_caught_up_and_published_again(
    entries: list[Submission], owner: User, edition: Edition, tmp_path: Path
) -> None:
    path = corrected(tmp_path, factor=1.3)
    second = open_edition(path)
    builders.score_all()
    publish(second)
    roll_back()
    late = builders.submit(owner, builders.predictions(edition, factor=1.01), method="Late")
    builders.score_all()
    with pytest.raises(Refused, match="Late"):
        publish(second)
    assert open_edition(path) == second
    builders.score_all()
    publish(second)
    assert late.evaluations.get(edition=second).status == Status.SCORED
    assert board_now().edition == second


def test_publishing_again_queues_what_came_since(
    entries: list[Submission], owner: User, edition: Edition, rescored: Edition
) -> None:
    publish(rescored)
    roll_back()
    late = builders.submit(owner, builders.predictions(edition, factor=1.01), method="Late")
    assert not late.evaluations.filter(edition=rescored).exists(), "a former edition stays as it was"
    publication = publish(rescored, leave_out=True)
    assert publication.left_out == [str(late.pk)]
    assert late.evaluations.get(edition=rescored).status == Status.QUEUED
    builders.score_all()
    assert "Late" in {entry.method for entry in board_now().entries}


@pytest.mark.slow
def test_an_edition_opened_again_gets_what_is_sent_until_it_is_published(
    entries: list[Submission], owner: User, edition: Edition, tmp_path: Path
) -> None:
    path = corrected(tmp_path, factor=1.3)
    second, draft = open_edition(path), open_edition(corrected(tmp_path, factor=1.4))
    builders.score_all()
    publish(second)
    roll_back()
    assert open_edition(path) == open_edition(path) == second
    assert AuditEvent.objects.filter(verb="reopened").count() == 1
    between = builders.submit(owner, builders.predictions(edition, factor=1.01), method="Between")
    builders.score_all()
    assert {each.edition for each in between.evaluations.all()} == {edition, second, draft}
    assert publish(second).left_out == []
    second.refresh_from_db()
    assert second.reopened_at is None
    assert "Between" in {entry.method for entry in board_now().entries}


@pytest.mark.slow
def test_an_edition_opened_again_and_closed_again_gets_nothing_more_and_can_be_published(
    entries: list[Submission], owner: User, edition: Edition, tmp_path: Path
) -> None:
    path = corrected(tmp_path, factor=1.3)
    second = open_edition(path)
    builders.score_all()
    publish(second)
    roll_back()
    waiting = builders.submit(owner, builders.predictions(edition, factor=1.02), method="Waiting")
    open_edition(path)
    corrections.discard(edition=second, reason="Not yet.", now=timezone.now(), actor=None)
    later = builders.submit(owner, builders.predictions(edition, factor=1.01), method="Later")
    assert waiting.evaluations.get(edition=second).status == Status.QUEUED, "what waits is scored"
    assert not later.evaluations.filter(edition=second).exists()
    with pytest.raises(Refused, match="is not in preparation"):
        corrections.discard(edition=second, reason="Again.", now=timezone.now(), actor=None)
    publish(second, leave_out=True)
    builders.score_all()
    assert {"Waiting", "Later"} <= {entry.method for entry in board_now().entries}


def test_discarded_edition_takes_no_work_and_cannot_be_published(
    entries: list[Submission], owner: User, edition: Edition, tmp_path: Path
) -> None:
    path = corrected(tmp_path, factor=1.3)
    second = open_edition(path)
    corrections.discard(edition=second, reason="Wrong file.", now=timezone.now(), actor=None)
    assert set(Evaluation.objects.filter(edition=second).values_list("status", flat=True)) == {
        Status.CANCELLED
    }
    submission = builders.submit(owner, builders.predictions(edition, factor=1.01), method="New")
    assert submission.evaluations.count() == 1
    with pytest.raises(Refused, match="was discarded"):
        publish(second)
    assert open_edition(path).number == 3


def test_same_truth_and_protocol_as_the_board_is_refused(entries: list[Submission]) -> None:
    with pytest.raises(Refused, match="is the current board already"):
        open_edition(None)


def test_a_truth_of_other_sequences_is_refused_and_nothing_changes(
    entries: list[Submission], tmp_path: Path
) -> None:
    head, *rows = (tmp_path / "truth-test.csv").read_text().splitlines()
    path = tmp_path / "faulty.csv"
    path.write_text("\n".join([head, *(row.replace(",1,", ",9,", 1) for row in rows)]) + "\n")
    with pytest.raises(Rejected) as caught:
        open_edition(path)
    assert [problem.code for problem in caught.value.problems] == ["no-overlap"]
    assert Edition.objects.count() == 1
    with pytest.raises(CommandError, match="was refused; nothing was changed"):
        call_command("open_edition", "test", "--truth", str(path))
