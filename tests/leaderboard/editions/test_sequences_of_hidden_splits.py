"""Sequences of a hidden ground truth stay hidden, whatever split they are imported for."""

from collections.abc import Callable
from io import StringIO
from pathlib import Path

import pytest
from django.conf import settings
from django.core.management import CommandError, call_command
from django.utils import timezone

from evaluator import read_truth
from leaderboard.editions import corrections, ground_truth, label_changes
from leaderboard.errors.refusals import Refused
from leaderboard.models import Analysis, Edition, GroundTruth, Score, Split, User
from leaderboard.statistics import analyses, disclosure
from leaderboard.storage import files, hidden_marks, seeds, truth_values
from tests import builders
from tests.editions import corrected, open_edition

NOW = timezone.now


@pytest.fixture
def hidden(benchmark: None, tmp_path: Path) -> Edition:
    """The test split, hidden, and the val split, open, each with sequences of its own."""
    builders.import_truth(tmp_path, split="val")
    return builders.import_truth(tmp_path)


def half(path: Path, into: Path, *, own: Path | None = None) -> Path:
    """Every second row of a ground truth under new numbers, after all rows of another one."""
    rows = path.read_text().splitlines()
    lines = own.read_text().splitlines() if own else rows[:1]
    for i, row in enumerate(rows[1::2]):
        lines.append(",".join([str(10_000 + i), *row.split(",")[1:]]))
    into.write_text("\n".join(lines) + "\n")
    return into


def mixed(tmp_path: Path) -> Path:
    return half(tmp_path / "truth-test.csv", tmp_path / "mixed.csv", own=tmp_path / "truth-val.csv")


DOORS: dict[str, Callable[[Path], object]] = {
    "first import": lambda folder: ground_truth.import_truth(
        split_name="demo", path=half(folder / "truth-test.csv", folder / "half.csv"), now=NOW()
    ),
    "add": lambda folder: ground_truth.add(
        split_name="demo", path=half(folder / "truth-test.csv", folder / "half.csv"), now=NOW(), actor=None
    ),
    "correction": lambda folder: open_edition(mixed(folder), split="val"),
    "dry run": lambda folder: label_changes.load(split_name="val", path=mixed(folder)),
    "command for a correction": lambda folder: call_command("open_edition", "val", truth=mixed(folder)),
    "command for a dry run": lambda folder: call_command(
        "open_edition", "val", truth=mixed(folder), dry_run=True, stdout=StringIO()
    ),
    "command for a first import": lambda folder: call_command("import_truth", "demo", str(mixed(folder))),
}


@pytest.mark.parametrize("door", DOORS)
def test_an_open_split_takes_no_sequence_of_a_hidden_one(hidden: Edition, tmp_path: Path, door: str) -> None:
    before = sorted(settings.GROUND_TRUTH_DIR.iterdir()), Edition.objects.count(), GroundTruth.objects.count()
    with pytest.raises((Refused, CommandError)) as caught:
        DOORS[door](tmp_path)
    text = str(caught.value)
    assert f"is in the hidden ground truth {hidden.ground_truth.short_digest} too" in text
    assert "The split 'val' is open" in text or "The split 'demo' is open" in text
    after = sorted(settings.GROUND_TRUTH_DIR.iterdir()), Edition.objects.count(), GroundTruth.objects.count()
    assert after == before


@pytest.mark.slow
@pytest.mark.parametrize("change", ["marked as open", "its rows deleted too"])
def test_a_database_that_calls_a_hidden_split_open_gets_no_labels_with_the_next_correction(
    hidden: Edition, owner: User, tmp_path: Path, change: str
) -> None:
    sent = builders.submit(owner, builders.predictions(hidden))
    builders.score_all()
    Split.objects.filter(pk="test").update(is_hidden=False)
    if change == "its rows deleted too":
        other = builders.import_truth(tmp_path, split="demo")
        Split.objects.filter(pk="test").update(current_edition=None)
        with pytest.raises(Refused, match="hidden ground truth"):
            ground_truth.import_truth(split_name="test", path=corrected(tmp_path, factor=1.3), now=NOW())
        assert not hidden_marks.is_marked(other.ground_truth_id)
        return
    with pytest.raises(Refused, match="somebody has changed the database"):
        open_edition(corrected(tmp_path, factor=1.3))
    builders.infer_all()
    assert not Analysis.objects.filter(evaluation__submission=sent).exists()


def test_a_correction_of_a_hidden_split_and_all_that_share_a_sequence_are_marked(
    hidden: Edition, tmp_path: Path
) -> None:
    second = open_edition(corrected(tmp_path, factor=1.3))
    assert hidden_marks.is_marked(second.ground_truth_id)
    # Whoever writes values, and whatever they say of them.
    truth = read_truth(half(tmp_path / "truth-test.csv", tmp_path / "half.csv"))
    truth_values.save(truth, is_hidden=False)
    assert hidden_marks.is_marked(truth.digest)
    open_one = Split.objects.get(pk="val").current_edition
    assert open_one is not None
    assert not hidden_marks.is_marked(open_one.ground_truth_id)


@pytest.mark.slow
def test_workers_follow_the_mark_of_shared_sequences_and_not_the_database(
    hidden: Edition, owner: User, tmp_path: Path
) -> None:
    truth = read_truth(half(tmp_path / "truth-test.csv", tmp_path / "half.csv"))
    truth_values.save(truth, is_hidden=False)
    # Rows that somebody has written into the database, past every check.
    demo = Split.objects.get(pk="demo")
    hidden_row = hidden.ground_truth
    files.save_manifest(truth.manifest)
    row = GroundTruth.objects.create(
        digest=truth.digest,
        split=demo,
        manifest_digest=truth.manifest.digest,
        source="x",
        n_sequences=truth.n_sequences,
        n_recordings=hidden_row.n_recordings,
        counts=hidden_row.counts,
        imported_at=NOW(),
    )
    edition = ground_truth.new_edition(split=demo, row=row, protocol="tsttc-1", now=NOW(), actor=None)
    ground_truth.make_board(edition=edition, kind="PUBLISHED", reason="R", now=NOW(), actor=None)  # type: ignore[arg-type]
    sent = builders.submit(owner, builders.predictions(edition), split="demo")
    builders.score_all()
    builders.infer_all()
    assert disclosure.is_hidden(edition)
    assert seeds.seed_of(edition) != edition.ground_truth_id
    assert analyses.for_submission(submission=sent, viewer=owner) is None


@pytest.mark.slow
def test_a_hidden_ground_truth_gets_no_finer_metric_on_a_split_that_the_database_calls_open(
    hidden: Edition, owner: User
) -> None:
    sent = builders.submit(owner, builders.predictions(hidden))
    builders.score_all()
    split = Split.objects.get(pk="test")
    Split.objects.filter(pk="test").update(is_hidden=False)
    with pytest.raises(Refused, match="was imported as hidden"):
        corrections.open_edition(
            split_name="test", digest=hidden.ground_truth_id, protocol="tsttc-2", now=NOW(), actor=None
        )
    # A row that somebody has written into the database, past every check.
    split.refresh_from_db()
    forged = ground_truth.new_edition(
        split=split, row=hidden.ground_truth, protocol="tsttc-2", now=NOW(), actor=None
    )
    ground_truth.queue_missing(forged)
    again = builders.submit(owner, builders.predictions(hidden, factor=1.3))
    builders.score_all()
    rows = Score.objects.filter(evaluation__edition=forged)
    assert {row.evaluation.submission for row in rows} == {sent, again}
    assert set(rows.values_list("metric", flat=True)) == {"mid", "rte"}


def test_an_open_split_whose_ground_truth_was_hidden_takes_no_other_one(
    hidden: Edition, tmp_path: Path
) -> None:
    Split.objects.filter(pk="test").update(is_hidden=False)
    elsewhere = builders.truth_csv(tmp_path / "elsewhere.csv", shift_ns=77)
    for attempt in (
        lambda: corrections.open_edition(split_name="test", path=elsewhere, now=NOW(), actor=None),
        lambda: ground_truth.add(split_name="test", path=elsewhere, now=NOW(), actor=None),
    ):
        with pytest.raises(Refused, match="was imported as hidden"):
            attempt()


def test_open_splits_with_sequences_of_their_own_open_as_ever(hidden: Edition, tmp_path: Path) -> None:
    demo = builders.import_truth(tmp_path, split="demo", protocol="tsttc-2")
    again = half(tmp_path / "truth-val.csv", tmp_path / "again.csv")
    second = open_edition(again, split="val")
    assert not hidden_marks.is_marked(demo.ground_truth_id)
    assert not hidden_marks.is_marked(second.ground_truth_id)


# --- the other order: the open one is there first -----------------------------------------------------------


def renumbered(tmp_path: Path, *, keep_own_keys: bool) -> Path:
    """A hidden ground truth of other values: the sequences of val renumbered, or its numbers alone."""
    rows = [row.split(",") for row in (tmp_path / "truth-val.csv").read_text().splitlines()]
    lines = [",".join(rows[0])]
    for i, (anno_id, bag, cam, ts, track, ttc) in enumerate(rows[1:]):
        number = str(7_000 + i) if keep_own_keys else anno_id
        key = (bag, cam, ts, track) if keep_own_keys else (bag, cam, str(int(ts) + 1), track)
        lines.append(",".join([number, *key, repr(float(ttc) * 1.5)]))
    path = tmp_path / f"renumbered-{keep_own_keys}.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture
def opened(benchmark: None, tmp_path: Path) -> Edition:
    """The val split, open, before there is any hidden ground truth."""
    return builders.import_truth(tmp_path, split="val")


def test_a_hidden_split_takes_no_sequence_of_an_open_one(opened: Edition, tmp_path: Path) -> None:
    before = sorted(settings.GROUND_TRUTH_DIR.iterdir())
    shared = half(tmp_path / "truth-val.csv", tmp_path / "half.csv")
    for path in (shared, renumbered(tmp_path, keep_own_keys=True)):
        for door in (
            lambda path=path: ground_truth.import_truth(split_name="test", path=path, now=NOW()),
            lambda path=path: call_command("import_truth", "test", str(path)),
        ):
            with pytest.raises((Refused, CommandError)) as caught:
                door()
            assert (
                f"is in the ground truth {opened.ground_truth.short_digest} of the open split 'val' too"
                in str(caught.value)
            )
            assert "expected a ground truth without sequences of an open split" in str(caught.value)
    assert sorted(settings.GROUND_TRUTH_DIR.iterdir()) == before
    assert GroundTruth.objects.count() == 1


def test_a_correction_of_a_hidden_split_takes_no_sequence_of_an_open_one(
    hidden: Edition, tmp_path: Path
) -> None:
    path = half(tmp_path / "truth-val.csv", tmp_path / "both.csv", own=tmp_path / "truth-test.csv")
    for door in (
        lambda: open_edition(path),
        lambda: label_changes.load(split_name="test", path=path),
    ):
        with pytest.raises(Refused, match="of the open split 'val' too"):
            door()
    assert GroundTruth.objects.count() == 2


@pytest.mark.parametrize("first", ["val", "test"])
def test_the_same_numbers_for_other_sequences_are_no_common_sequences(
    benchmark: None, tmp_path: Path, first: str
) -> None:
    builders.import_truth(tmp_path, split="val")
    path = renumbered(tmp_path, keep_own_keys=False)
    if first == "val":
        hidden = ground_truth.import_truth(split_name="test", path=path, now=NOW())
        assert hidden_marks.is_marked(hidden.ground_truth_id)
    else:
        second = ground_truth.import_truth(split_name="test", path=path, now=NOW())
        again = half(tmp_path / "truth-val.csv", tmp_path / "again.csv")
        assert not hidden_marks.is_marked(open_edition(again, split="val").ground_truth_id)
        assert hidden_marks.is_marked(second.ground_truth_id)


# --- hidden ground truth from before there were marks -------------------------------------------------------


def unmark(edition: Edition) -> None:
    hidden_marks.path(edition.ground_truth_id).unlink()


def test_hidden_values_from_before_there_were_marks_are_marked_with_the_next_import(
    hidden: Edition, tmp_path: Path
) -> None:
    second = open_edition(corrected(tmp_path, factor=1.3))
    for edition in (hidden, second):
        unmark(edition)
    with pytest.raises(Refused, match="is in the hidden ground truth"):
        open_edition(mixed(tmp_path), split="val")
    assert hidden_marks.digests() == tuple(sorted([hidden.ground_truth_id, second.ground_truth_id]))


def test_the_command_of_an_upgrade_marks_hidden_values_and_no_others(hidden: Edition, tmp_path: Path) -> None:
    second = open_edition(corrected(tmp_path, factor=1.3))
    for edition in (hidden, second):
        unmark(edition)
    out = StringIO()
    call_command("make_seed_key", stdout=out)
    assert "2 hidden ground truths had no mark, and have one now." in out.getvalue()
    assert hidden_marks.digests() == tuple(sorted([hidden.ground_truth_id, second.ground_truth_id]))
    call_command("make_seed_key", stdout=(out := StringIO()))
    assert "mark" not in out.getvalue()
    # Values that are on another machine are not marked here, and no mark is made of nothing.
    for path in (truth_values.values_path, truth_values.manifest_path):
        path(second.ground_truth_id).unlink()
    unmark(second)
    assert ground_truth.mark_hidden() == 0
