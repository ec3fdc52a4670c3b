"""Looking before switching, and what earlier editions and withdrawn entries leave."""

import random
from pathlib import Path

import pytest
from django.core.management import call_command
from django.utils import timezone

from evaluator import read_truth
from leaderboard.editions import preview
from leaderboard.editions.history import TruthChange
from leaderboard.models import (
    Edition,
    Status,
    Submission,
    User,
)
from leaderboard.storage import truth_values
from leaderboard.upkeep import backlog
from tests import builders
from tests.editions import board_now, corrected, extended, offline, open_edition, publish


def test_preview_compares_entry_by_entry(entries: list[Submission], tmp_path: Path) -> None:
    path = corrected(tmp_path, factor=1.3)
    edition = open_edition(path)
    builders.score_all()
    comparison = preview.preview(edition)
    truth = read_truth(path)
    assert comparison.truth == TruthChange(n_added=0, n_removed=0, n_changed=5, n_renumbered=0)
    assert comparison.replaces == 1
    old_truth = truth_values.load(comparison.published.ground_truth_id)
    for change in comparison.changes:
        submission = Submission.objects.get(pk=change.submission_id)
        assert change.old == offline(submission, old_truth)
        assert change.new == offline(submission, truth)
        for name, value in change.delta.items():
            assert value == round(change.new[name] - change.old[name], 2)
    old_ranks = {entry.submission_id: entry.rank for entry in board_now().entries if entry.submission_id}
    assert {c.submission_id: c.old_rank for c in comparison.changes} == old_ranks


def test_preview_says_what_becomes_rejected_and_why(entries: list[Submission], tmp_path: Path) -> None:
    edition = open_edition(extended(tmp_path))
    builders.score_all()
    comparison = preview.preview(edition)
    assert comparison.n_newly_rejected == 4
    assert comparison.truth == TruthChange(n_added=1, n_removed=0, n_changed=0, n_renumbered=0)
    for change in comparison.changes:
        assert change.new_status == Status.REJECTED
        assert change.problems[0]["message"].startswith("1 sequence has no value, added by a correction")
        assert change.rank_change > 0


@pytest.mark.slow
def test_what_is_rejected_in_both_editions_is_not_changed(
    entries: list[Submission], edition: Edition, owner: User
) -> None:
    builders.open_values(edition)
    builders.submit(owner, b'{"0": 3.5}', method="Incomplete")
    builders.score_all()
    second = open_edition(protocol="tsttc-2")
    builders.score_all()
    comparison = preview.preview(second)
    assert (len(comparison.changes), len(comparison.entries)) == (5, 4)
    # All get a warning error that the first protocol does not know.
    assert preview.document(comparison)["n_changed"] == 4


@pytest.mark.slow
def test_counts_are_against_the_edition_that_is_named_whatever_was_the_board_at_import(
    entries: list[Submission], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Users found 1927 changed labels between a truth and itself."""
    one, two = corrected(tmp_path, factor=1.3), corrected(tmp_path, drop="0003")
    first, second = open_edition(one), open_edition(two)
    builders.score_all()
    publish(first)
    assert preview.preview(open_edition(protocol="toolkit")).truth == TruthChange(0, 0, 0, 0)
    # The second was compared with edition 1; asked anew, or by a worker, it is compared with the board.
    second = Edition.objects.get(pk=second.pk)
    assert preview.document(preview.preview(second))["n_removed"] is None
    backlog.work_off(now=timezone.now(), rng=random.Random(0))
    assert preview.preview(second).truth == TruthChange(0, 5, 5, 0)
    assert preview.document(preview.preview(second))["n_changed_sequences"] == 5
    call_command("open_edition", "test", "--truth", str(two))
    assert "against edition 2: 0 sequences added, 5 removed, 5 changed" in capsys.readouterr().out
    publish(second, replaces=2, leave_out=True)
    call_command("open_edition", "test", "--truth", str(one), "--protocol", "toolkit")
    assert "against edition 3: 5 sequences added, 0 removed, 5 changed" in capsys.readouterr().out


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
    assert preview.preview(second).truth == TruthChange(0, 0, 1, 0)
    for change in preview.preview(second).changes:
        changed = {name for name in change.old if change.old[name] != change.new[name]}
        assert changed == {"mid", "mid_small", "rte", "rte_small"}


def test_the_command_opens_an_edition_follows_it_and_says_where_to_publish(
    entries: list[Submission], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    call_command("open_edition", "test", "--truth", str(corrected(tmp_path, factor=1.3)))
    builders.score_all()
    call_command("open_edition", "test", "--truth", str(corrected(tmp_path, factor=1.3)), "--wait")
    output = capsys.readouterr().out
    assert "100%  4 of 4: 4 scored, 0 rejected, 0 with a system error" in output
    assert "5 changed; 0 sequences have another anno_id." in output
    assert output.rstrip().endswith("/maintain/test/editions/2/")
