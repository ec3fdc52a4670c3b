"""Looking before switching, and what former editions and withdrawn entries leave."""

from pathlib import Path

import pytest
from django.core.management import call_command
from django.utils import timezone

from evaluator import Rejected, read_truth
from leaderboard import ground_truth, preview, standings, submissions
from leaderboard.models import (
    Edition,
    Split,
    Status,
    Submission,
    User,
)
from tests import builders
from tests.editions import ANYBODY, board_now, corrected, offline, open_edition, publish


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
    lines[2] = ",".join([*fields[:5], "3.05"])
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
