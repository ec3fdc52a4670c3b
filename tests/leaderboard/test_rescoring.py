"""`rescoring`: open an edition, follow it, publish it, go back."""

import json
import random
from pathlib import Path

import pytest
from django.contrib.auth.models import AnonymousUser
from django.core.management import CommandError, call_command
from django.db import IntegrityError, transaction
from django.utils import timezone

from evaluator import GroundTruth, Predictions, Rejected, evaluate, published, read_predictions, read_truth
from leaderboard import ground_truth, lifecycle, preview, rescoring, scoring, standings, submissions
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
from tests import builders

ANYBODY = AnonymousUser()
FACTORS = (1.05, 1.1, 1.2, 1.4)


@pytest.fixture
def entries(edition: Edition, owner: User) -> list[Submission]:
    """Four scored submissions of four methods."""
    made = [
        builders.submit(owner, builders.predictions(edition, factor=factor), method=f"M{factor}")
        for factor in FACTORS
    ]
    builders.score_all()
    return made


def corrected(tmp_path: Path, *, drop: str = "", factor: float = 1.0, recording: str = "0001") -> Path:
    """The made-up truth without the recording `drop`, and another recording's values times `factor`."""
    lines = (tmp_path / "truth-test.csv").read_text().splitlines()
    kept = [lines[0]]
    for line in lines[1:]:
        fields = line.split(",")
        if fields[1] == drop:
            continue
        if fields[1] == recording:
            fields[5] = repr(float(fields[5]) * factor)
        kept.append(",".join(fields))
    path = tmp_path / f"corrected-{drop}-{factor}.csv"
    path.write_text("\n".join(kept) + "\n")
    return path


def open_edition(
    path: Path | None = None, *, actor: User | None = None, protocol: str | None = None
) -> Edition:
    return rescoring.open_edition(
        split_name="test", path=path, protocol=protocol, now=timezone.now(), actor=actor
    )


def publish(edition: Edition, *, replaces: int | None = 1, leave_out: bool = False) -> Publication:
    return rescoring.publish(
        edition=edition,
        reason="Labels corrected.",
        now=timezone.now(),
        actor=None,
        replaces=replaces,
        leave_out=leave_out,
    )


def roll_back(*, replaces: int = 2) -> Publication:
    return rescoring.roll_back(
        split_name="test", reason="A mistake.", now=timezone.now(), actor=None, replaces=replaces
    )


def board_now() -> standings.Board:
    split = Split.objects.select_related("published_edition__ground_truth").get(pk="test")
    return standings.board(split=split, viewer=ANYBODY)


def offline(submission: Submission, truth: GroundTruth) -> dict[str, float | None]:
    with scoring.files.opened_predictions(submission.digest) as kept:
        predictions = read_predictions(kept.read(), manifest=truth.manifest)
    return {name: published(value) for name, value in evaluate(predictions, truth).flat().items()}


def test_opening_queues_every_standing_submission_once_and_changes_nothing_public(
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
        scoring.files.store().delete(scoring.files.predictions_name(submission.digest))
    builders.score_all()
    truth = read_truth(path)
    old = ground_truth.load(Split.objects.get(pk="test").published_edition.ground_truth_id)
    for submission, factor in zip(entries, FACTORS, strict=True):
        found = standings.flat_scores(
            Evaluation.objects.get(submission=submission, edition=edition).scores.all()
        )
        values = Predictions.from_arrays(ttc_s=old.ttc_s * factor, manifest=truth.manifest)
        assert found == {name: published(v) for name, v in evaluate(values, truth).flat().items()}


def test_new_uploads_meanwhile_are_scored_in_both(
    entries: list[Submission], owner: User, edition: Edition, tmp_path: Path
) -> None:
    second = open_edition(corrected(tmp_path, factor=1.3))
    submission = builders.submit(owner, builders.predictions(edition, factor=1.01), method="New")
    builders.score_all()
    states = {e.edition.number: e.status for e in submission.evaluations.select_related("edition")}
    assert states == {1: Status.SCORED, 2: Status.SCORED}
    assert rescoring.unfinished(second) == []


def test_live_submissions_go_ahead_of_rescoring(
    entries: list[Submission], owner: User, edition: Edition, tmp_path: Path
) -> None:
    open_edition(corrected(tmp_path, factor=1.3))
    live = builders.submit(owner, builders.predictions(edition, factor=1.01), method="New")
    assert scoring.run_next(rng=random.Random(0))
    assert live.evaluations.get(edition=edition).status == Status.SCORED
    assert Evaluation.objects.filter(priority=Evaluation.PRIORITY_RESCORE, status=Status.SCORED).count() == 0


def test_progress_counts_and_ends_at_100_percent(entries: list[Submission], tmp_path: Path) -> None:
    edition = open_edition(corrected(tmp_path, factor=1.3))
    progress = rescoring.progress(edition)
    assert (progress.n_total, progress.n_done, progress.percent, progress.left_s) == (4, 0, 0, None)
    builders.score_all()
    progress = rescoring.progress(edition)
    assert (progress.n_done, progress.n_scored, progress.percent, progress.left_s) == (4, 4, 100, None)


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
    with pytest.raises(
        rescoring.Refused, match=r"4 standing submissions are neither scored nor rejected: M1.05"
    ):
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
    with pytest.raises(rescoring.Refused, match="is edition 2, not 1 as when you looked"):
        publish(third, replaces=1)
    assert board_now().edition == second


@pytest.mark.parametrize("verb", ["open", "publish", "roll_back", "discard"])
def test_only_maintainers_change_editions(
    entries: list[Submission], owner: User, maintainer: User, tmp_path: Path, verb: str
) -> None:
    path = corrected(tmp_path, factor=1.3)
    second = open_edition(path, actor=maintainer)
    builders.score_all()
    common = {"reason": "x", "now": timezone.now(), "actor": owner}
    calls = {
        "open": lambda: open_edition(path, actor=owner),
        "publish": lambda: rescoring.publish(edition=second, replaces=1, **common),
        "roll_back": lambda: rescoring.roll_back(split_name="test", replaces=1, **common),
        "discard": lambda: rescoring.discard(edition=second, **common),
    }
    with pytest.raises(rescoring.NotMaintainer):
        calls[verb]()
    assert board_now().edition.number == 1


def test_no_reason_is_refused(entries: list[Submission], tmp_path: Path) -> None:
    edition = open_edition(corrected(tmp_path, factor=1.3))
    with pytest.raises(rescoring.Refused, match="No reason was given"):
        rescoring.publish(edition=edition, reason=" \n ", now=timezone.now(), actor=None, replaces=1)


def test_first_edition_has_nothing_to_go_back_to(entries: list[Submission]) -> None:
    with pytest.raises(rescoring.Refused, match="replaced no edition"):
        roll_back(replaces=1)


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
    with pytest.raises(rescoring.Refused, match="Late"):
        publish(second)
    assert open_edition(path) == second
    builders.score_all()
    publish(second)
    assert late.evaluations.get(edition=second).status == Status.SCORED
    assert board_now().edition == second


def test_discarded_edition_takes_no_work_and_cannot_be_published(
    entries: list[Submission], owner: User, edition: Edition, tmp_path: Path
) -> None:
    path = corrected(tmp_path, factor=1.3)
    second = open_edition(path)
    rescoring.discard(edition=second, reason="Wrong file.", now=timezone.now(), actor=None)
    assert set(Evaluation.objects.filter(edition=second).values_list("status", flat=True)) == {
        Status.CANCELLED
    }
    submission = builders.submit(owner, builders.predictions(edition, factor=1.01), method="New")
    assert submission.evaluations.count() == 1
    with pytest.raises(rescoring.Refused, match="was discarded"):
        publish(second)
    assert open_edition(path).number == 3


def test_same_truth_and_protocol_as_the_board_is_refused(entries: list[Submission]) -> None:
    with pytest.raises(rescoring.Refused, match="is the board already"):
        open_edition(None)


def test_protocol_alone_can_change(entries: list[Submission]) -> None:
    edition = open_edition(None, protocol="toolkit")
    builders.score_all()
    assert edition.protocol == "toolkit"
    assert rescoring.progress(edition).n_scored == 4


def test_database_refuses_a_second_evaluation_of_one_submission_in_one_edition(
    entries: list[Submission], edition: Edition
) -> None:
    with pytest.raises(IntegrityError), transaction.atomic():
        Evaluation.objects.create(submission=entries[0], edition=edition)


@pytest.mark.parametrize(
    ("change", "code"),
    [
        (lambda rows: [*rows, rows[-1]], "duplicate-ids"),
        (lambda rows: [*rows[:-1], rows[-1].rsplit(",", 1)[0] + ",nan"], "truth-not-finite"),
        (lambda rows: [row.replace(",1,", ",9,", 1) for row in rows], "no-overlap"),
    ],
    ids=["duplicate keys", "NaN", "no overlap"],
)
def test_faulty_truth_is_refused_with_problems_and_nothing_changes(
    entries: list[Submission], tmp_path: Path, change, code: str
) -> None:
    head, *rows = (tmp_path / "truth-test.csv").read_text().splitlines()
    path = tmp_path / "faulty.csv"
    path.write_text("\n".join([head, *change(rows)]) + "\n")
    with pytest.raises(Rejected) as caught:
        open_edition(path)
    assert code in {problem.code for problem in caught.value.problems}
    assert Edition.objects.count() == 1
    with pytest.raises(CommandError, match="was refused; nothing was changed"):
        call_command("open_edition", "test", "--truth", str(path))


def test_preview_compares_entry_by_entry(entries: list[Submission], tmp_path: Path) -> None:
    path = corrected(tmp_path, factor=1.3)
    edition = open_edition(path)
    builders.score_all()
    found = preview.preview(edition)
    truth = read_truth(path)
    assert (edition.ground_truth.n_added, edition.ground_truth.n_removed) == (0, 0)
    assert edition.ground_truth.n_changed == 5
    assert found.replaces == 1
    old_truth = ground_truth.load(found.published.ground_truth_id)
    for change in found.changes:
        submission = Submission.objects.get(pk=change.submission_id)
        assert change.old == offline(submission, old_truth)
        assert change.new == offline(submission, truth)
        for name, value in change.delta.items():
            assert value == round(change.new[name] - change.old[name], 2)
    old_ranks = {entry.submission_id: entry.rank for entry in board_now().entries if entry.submission_id}
    assert {c.submission_id: c.old_rank for c in found.changes} == old_ranks


def test_preview_says_what_becomes_rejected_and_why(entries: list[Submission], tmp_path: Path) -> None:
    path = corrected(tmp_path, drop="0003", factor=1.3)
    edition = open_edition(path)
    builders.score_all()
    found = preview.preview(edition)
    assert found.n_newly_rejected == 4
    assert edition.ground_truth.n_removed == 5
    truth = read_truth(path)
    for change in found.changes:
        with pytest.raises(Rejected) as caught:
            offline(Submission.objects.get(pk=change.submission_id), truth)
        assert change.new_status == Status.REJECTED
        assert change.problems[0]["message"] == caught.value.problems[0].message
        assert change.rank_change > 0


def test_entries_a_new_truth_cannot_score_stay_in_the_old_edition_marked(
    entries: list[Submission], edition: Edition, tmp_path: Path
) -> None:
    second = open_edition(corrected(tmp_path, drop="0003"))
    builders.score_all()
    publish(second)
    assert board_now().n_submissions == 0
    split = Split.objects.get(pk="test")
    old = standings.board(split=split, edition=edition, viewer=ANYBODY)
    assert old.n_submissions == 4
    assert all(entry.is_unscorable for entry in old.entries if entry.kind == "submission")


def test_changing_one_value_changes_exactly_the_values_that_it_must(
    entries: list[Submission], edition: Edition, tmp_path: Path
) -> None:
    lines = (tmp_path / "truth-test.csv").read_text().splitlines()
    fields = lines[2].split(",")
    assert float(fields[5]) == 4.0
    lines[2] = ",".join([*fields[:5], "5.5"])
    path = tmp_path / "one.csv"
    path.write_text("\n".join(lines) + "\n")
    second = open_edition(path)
    builders.score_all()
    assert second.ground_truth.n_changed == 1
    for change in preview.preview(second).changes:
        changed = {name for name in standings.SCORE_NAMES if change.old[name] != change.new[name]}
        assert changed == {"mid", "mid_small", "rte", "rte_small"}


def test_board_as_it_stood_at_a_time(entries: list[Submission], tmp_path: Path) -> None:
    split = Split.objects.get(pk="test")
    before = timezone.now()
    second = open_edition(corrected(tmp_path, factor=1.3))
    builders.score_all()
    publish(second)
    split = Split.objects.select_related("published_edition").get(pk="test")
    then = standings.board(split=split, viewer=ANYBODY, at=before)
    assert then.edition.number == 1
    assert then.n_submissions == 4
    opened_at = Edition.objects.get(split="test", number=1).published_at
    assert standings.board(split=split, viewer=ANYBODY, at=opened_at).n_submissions == 0
    long_ago = standings.board(split=split, viewer=ANYBODY, at=standings.parse_moment("2020-01-01"))
    assert (long_ago.edition, len(long_ago.entries)) == (None, 5)


def test_withdrawn_entry_leaves_a_tombstone_without_values(
    entries: list[Submission], owner: User, stranger: User
) -> None:
    with pytest.raises(submissions.Refused, match="Only the team"):
        submissions.withdraw(submission=entries[0], actor=stranger, now=timezone.now())
    before = timezone.now()
    assert submissions.withdraw(submission=entries[0], actor=owner, now=timezone.now())
    assert not submissions.withdraw(submission=entries[0], actor=owner, now=timezone.now())
    tombstone = board_now().entries[-1]
    assert (tombstone.method, tombstone.rank, tombstone.scores["mid"]) == ("M1.05", None, None)
    assert tombstone.withdrawn_at
    split = Split.objects.get(pk="test")
    then = standings.board(split=split, viewer=ANYBODY, at=before)
    assert [e.withdrawn_at for e in then.entries if e.method == "M1.05"] == [None]


def test_withdrawing_what_waits_cancels_it(edition: Edition, owner: User) -> None:
    submission = builders.submit(owner, builders.predictions(edition))
    submissions.withdraw(submission=submission, actor=owner, now=timezone.now())
    assert submission.evaluations.get().status == Status.CANCELLED
    assert builders.score_all() == 0


def test_single_system_error_can_be_retried_and_unblocks_publishing(
    entries: list[Submission], maintainer: User, tmp_path: Path
) -> None:
    edition = open_edition(corrected(tmp_path, factor=1.3))
    builders.score_all()
    broken = Evaluation.objects.filter(edition=edition).first()
    Evaluation.objects.filter(pk=broken.pk).update(status=Status.SYSTEM_ERROR)
    broken.scores.all().delete()
    with pytest.raises(rescoring.Refused, match="1 standing submissions"):
        publish(edition)
    lifecycle.retry(evaluation=broken, actor=maintainer)
    builders.score_all()
    publish(edition)


def test_commands_open_preview_publish_and_roll_back(
    entries: list[Submission], tmp_path: Path, capsys
) -> None:
    call_command("open_edition", "test", "--truth", str(corrected(tmp_path, factor=1.3)))
    builders.score_all()
    call_command("open_edition", "test", "--truth", str(corrected(tmp_path, factor=1.3)), "--wait")
    call_command("preview_edition", "test", "2")
    call_command("preview_edition", "test", "2", "--format", "csv")
    call_command("publish_edition", "test", "2", "--reason", "Labels corrected.")
    call_command("publish_edition", "test", "2", "--roll-back", "--reason", "A mistake.")
    said = capsys.readouterr().out
    assert "100 %  4 of 4: 4 scored, 0 rejected, 0 failed by our fault" in said
    assert "5 changed; 4 entries change" in said
    assert "The board of test is test edition 2." in said
    assert said.rstrip().endswith("The board of test is test edition 1.")
