"""Intervals and rank ranges on the server: what is written with the scores, when, and for whom."""

import random
from collections.abc import Collection
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from django.conf import settings
from django.utils import timezone
from scipy import stats

from evaluator import SCORE_NAMES
from evaluator.scoring import uncertainty
from leaderboard.boards import listing
from leaderboard.models import (
    BoardVersion,
    Edition,
    EditionRanges,
    Evaluation,
    Method,
    PublishedResult,
    Score,
    Submission,
    User,
    Visibility,
)
from leaderboard.statistics import confidence, disclosure, recording_sums
from leaderboard.statistics.confidence import Entries
from leaderboard.storage import files, truth_values
from leaderboard.submissions import intake
from leaderboard.upkeep import backlog
from tests import builders
from tests.editions import ANYBODY, board_now, corrected, open_edition
from tests.leaderboard.statistics.inferred_scores import INFERRED, everything, scores_of


def hide(submission: Submission) -> None:
    Method.objects.filter(pk=submission.method_id).update(visibility=Visibility.PRIVATE)


def stale(*, now: datetime, readable_truths: Collection[str]) -> list[Edition]:
    return [entries.edition for entries in confidence.stale(now=now, readable_truths=readable_truths)]


def version() -> int:
    return BoardVersion.objects.filter(split="test").values_list("number", flat=True).first() or 0


def plain_interval(submission: Submission, edition: Edition) -> tuple[float, float]:
    """The interval of the overall MiD by a loop over recordings, with the weights of the ground truth."""
    truth = truth_values.load(edition.ground_truth_id)
    with files.opened_predictions(submission.digest) as kept:
        predictions = builders.evaluator.read_predictions(kept.read(), manifest=truth.manifest)
    report = builders.evaluator.evaluate(predictions, truth, keep_sequences=True)
    assert report.sequences is not None
    generator = confidence.generator_of(edition, purpose="weights")
    weights = generator.standard_exponential((10_000, truth.manifest.n_recordings), dtype=np.float32)
    sums, counts = np.zeros(10_000), np.zeros(10_000)
    for row, recording in enumerate(truth.manifest.recording_index):
        sums += weights[:, recording] * report.sequences["mid"][row]
        counts += weights[:, recording]
    # All 24 recordings have five sequences, so they count as 24.
    tail = stats.norm.cdf(-stats.t.ppf(0.975, 24) * (24 / 23) ** 0.5)
    low, high = np.quantile(sums / counts, [tail, 1 - tail])
    return float(low), float(high)


@pytest.fixture
def inferred(entries: list[Submission]) -> list[Submission]:
    """Four scored submissions, and what workers make of them afterwards."""
    assert builders.infer_all() == 1
    return entries


def test_every_value_gets_an_interval_and_a_rank_range_that_hold_what_is_published(
    inferred: list[Submission], edition: Edition
) -> None:
    entries = board_now().entries
    submitted = [entry for entry in entries if entry.kind == "submission"]
    assert len(submitted) == 4
    for entry in submitted:
        interval = entry.intervals["mid"]
        assert interval.low <= entry.scores["mid"] <= interval.high
        assert interval.rank_low <= entry.rank <= interval.rank_high
    for entry in submitted:
        interval = entry.intervals["mid"]
        assert interval.is_with_best == (interval.rank_low == 1)
    assert all(not entry.intervals for entry in entries if entry.kind == "published")
    for submission in inferred[:2]:
        score = scores_of(submission, edition)["mid"]
        low, high = plain_interval(submission, edition)
        step = disclosure.step_of(high - low, decimals=1, least=edition.least_step)
        assert low - step - 0.006 <= score.low <= low + 0.006
        assert high - 0.006 <= score.high <= high + step + 0.006


def test_a_column_in_too_few_recordings_has_no_interval_while_others_have(
    inferred: list[Submission], edition: Edition
) -> None:
    usable = uncertainty.usable_columns(recording_sums.counts_of(edition))
    assert 0 < usable.sum() < len(SCORE_NAMES)
    for name, row in scores_of(inferred[0], edition).items():
        has_interval = bool(usable[SCORE_NAMES.index(name)])
        assert [getattr(row, field) is not None for field in INFERRED] == [has_interval] * 5, name


def test_an_edition_without_enough_recordings_has_no_interval_and_says_why(
    benchmark: None, tmp_path: Path, owner: User
) -> None:
    edition = builders.import_truth(tmp_path, n_recordings=7)
    builders.submit(owner, builders.predictions(edition))
    builders.score_all()
    builders.infer_all()
    assert not Score.objects.exclude(low=None, high=None).exists()
    assert {row[3:] for row in everything()} == {(None, None)}
    edition.refresh_from_db()
    assert edition.inferred_at is not None
    assert confidence.why_no_interval(edition) == (
        "There are no confidence intervals: too few recordings (effective number 6.9; at least 8 needed)."
    )


def test_what_holds_is_not_made_again_and_what_changed_is(
    inferred: list[Submission], edition: Edition, owner: User
) -> None:
    before = everything()
    assert builders.infer_all() == 0
    intake.withdraw(submission=inferred[0], actor=owner, now=timezone.now())
    assert builders.infer_all() == 1
    withdrawn, *others = (scores_of(submission, edition)["mid"] for submission in inferred)
    assert (withdrawn.rank_low, withdrawn.rank_high, withdrawn.is_with_best) == (None, None, None)
    assert others[0].is_with_best
    assert everything() != before
    assert all(
        (row.low, row.high) == (low, high) for row in Score.objects.all() for low, high in [kept(before, row)]
    )


def kept(rows: list[tuple[object, ...]], score: Score) -> tuple[object, object]:
    """The interval that a score had before: it is its own, and stays."""
    return next((row[1], row[2]) for row in rows if row[0] == score.pk)


@pytest.mark.slow
def test_private_entries_get_an_interval_and_change_nothing_that_others_see(
    inferred: list[Submission], edition: Edition, stranger: User
) -> None:
    before, number = everything(), version()
    hidden = builders.submit(stranger, builders.predictions(edition, factor=1.01), method="Hidden")
    hide(hidden)
    builders.score_all()
    number = version()
    assert builders.infer_all() == 1
    row = scores_of(hidden, edition)["mid"]
    assert row.low is not None
    assert (row.rank_low, row.rank_high, row.is_with_best) == (None, None, None)
    assert [row for row in everything() if row[0] in {old[0] for old in before}] == before
    assert version() == number

    Method.objects.filter(pk=hidden.method_id).update(
        visibility=Visibility.ANONYMOUS, shown_at=timezone.now()
    )
    assert builders.infer_all() == 1
    assert scores_of(hidden, edition)["mid"].is_with_best
    assert not scores_of(inferred[0], edition)["mid"].is_with_best
    assert version() == number + 1


def test_printed_rows_are_counted_where_they_surely_or_possibly_stand(
    inferred: list[Submission], edition: Edition
) -> None:
    PublishedResult.objects.filter(split="test").delete()
    assert builders.infer_all() == 1
    first = scores_of(inferred[0], edition)["mid"]
    assert (first.rank_low, first.rank_high, first.is_with_best) == (1, 1, True)
    for slug, value in (("above", first.value / 10), ("beside", first.value), ("below", 1e6)):
        builders.quote(slug, {"mid": value})
    assert builders.infer_all() == 1
    first = scores_of(inferred[0], edition)["mid"]
    assert (first.rank_low, first.rank_high, first.is_with_best) == (2, 3, False)
    for entry in board_now().entries:
        if entry.kind == "submission":
            interval = entry.intervals["mid"]
            assert interval.rank_low <= entry.rank <= interval.rank_high


def test_a_range_that_does_not_hold_the_rank_any_more_is_left_out(
    inferred: list[Submission], edition: Edition, owner: User
) -> None:
    best, *others = inferred
    # Beside a paper whose value is near, a range has room for one rank less.
    PublishedResult.objects.all().delete()
    builders.infer_all()
    intake.withdraw(submission=best, actor=owner, now=timezone.now())
    rows = {row.submission_id: row for row in board_now().entries}
    gone = [rows[other.pk].intervals["mid"] for other in others]
    assert None in [interval.rank_low for interval in gone]
    for other, interval in zip(others, gone, strict=True):
        assert interval.rank_low is None or interval.rank_low <= rows[other.pk].rank <= interval.rank_high
    assert all(interval.low is not None for interval in gone)
    builders.infer_all()
    rows = {row.submission_id: row for row in board_now().entries}
    for other in others:
        interval, rank = rows[other.pk].intervals["mid"], rows[other.pk].rank
        assert interval.rank_low <= rank <= interval.rank_high


def test_a_board_as_of_a_time_has_intervals_and_no_ranges_of_today(
    inferred: list[Submission], edition: Edition
) -> None:
    then = listing.board(split=edition.split, viewer=ANYBODY, at=timezone.now())
    rows = [entry for entry in then.entries if entry.kind == "submission"]
    assert len(rows) == len(inferred)
    for entry in rows:
        interval = entry.intervals["mid"]
        assert None not in (interval.low, interval.high)
        assert (interval.rank_low, interval.rank_high, interval.is_with_best) == (None, None, None)


def test_sums_that_are_gone_are_made_again_from_values_and_from_the_file(
    inferred: list[Submission], edition: Edition
) -> None:
    digest, file = inferred[0].digest, inferred[0].sent_file
    first = recording_sums.sums_of(edition, file=file)
    path = recording_sums.path(edition, file=file)
    assert path.is_relative_to(settings.GROUND_TRUTH_DIR)
    path.write_bytes(b"cut off")
    assert np.array_equal(recording_sums.sums_of(edition, file=file), first)
    path.unlink()
    manifest = truth_values.load(edition.ground_truth_id).manifest
    files.store().delete(files.aligned_name(manifest_digest=manifest.digest, digest=digest))
    assert np.array_equal(recording_sums.sums_of(edition, file=file), first)
    assert path.stat().st_size == first.nbytes
    truth = truth_values.load(edition.ground_truth_id)
    means = first.sum(axis=0) / recording_sums.counts_of(edition).sum(axis=0)
    with files.opened_predictions(digest) as source:
        predictions = builders.evaluator.read_predictions(source.read(), manifest=truth.manifest)
    assert means == pytest.approx(list(builders.evaluator.evaluate(predictions, truth).flat().values()))


@pytest.mark.slow
def test_one_unreadable_file_keeps_no_other_interval_waiting(
    entries: list[Submission], edition: Edition, second: Edition
) -> None:
    builders.score_all()
    lost, *others = entries
    for each in (edition, second):
        recording_sums.path(each, file=lost.sent_file).unlink()
    name = files.aligned_name(manifest_digest=edition.ground_truth.manifest_digest, digest=lost.digest)
    aligned, sent = (
        Path(files.store().path(name)),
        Path(files.store().path(files.predictions_name(lost.digest))),
    )
    kept = sent.read_bytes()
    aligned.unlink()
    sent.unlink()
    builders.infer_all()
    with_interval = Score.objects.exclude(low=None).values_list(
        "evaluation__submission", "evaluation__edition"
    )
    expected = {(entry.pk, each.pk) for entry in others for each in (edition, second)}
    assert set(with_interval) == expected
    assert not EditionRanges.objects.exclude(digest="").exists(), "ranks count every entry"
    sent.write_bytes(kept)
    builders.infer_all()
    assert set(with_interval.all()) == expected | {(lost.pk, each.pk) for each in (edition, second)}
    assert EditionRanges.objects.exclude(digest="").count() == 2


def test_nothing_is_written_when_the_entries_change_meanwhile(
    entries: list[Submission], edition: Edition, owner: User
) -> None:
    edition.refresh_from_db()
    before = everything()

    def withdraw() -> None:
        intake.withdraw(submission=entries[0], actor=owner, now=timezone.now())

    assert not confidence.infer(Entries.of(edition), now=timezone.now(), between=withdraw)
    assert everything() == before
    assert builders.infer_all() == 1


def test_live_submissions_are_decided_before_the_work_behind_them_goes_on(
    entries: list[Submission], edition: Edition, stranger: User
) -> None:
    late = builders.submit(stranger, builders.predictions(edition, factor=1.02), method="Late")
    later = timezone.now() + 2 * confidence.MAX_DELAY
    assert backlog.work_off(now=later, rng=random.Random(0)) == 1
    assert Evaluation.objects.get(submission=late).status == "SCORED"


def test_a_worker_that_is_to_end_leaves_the_work_to_others(entries: list[Submission]) -> None:
    assert backlog.work_off(now=timezone.now(), rng=random.Random(0), is_stopping=lambda: True) == 0
    assert not Edition.objects.exclude(inferred_at=None).exists()


def test_an_edition_that_is_being_scored_is_waited_for_but_not_for_ever(
    inferred: list[Submission], edition: Edition, tmp_path: Path
) -> None:
    prepared = open_edition(corrected(tmp_path, factor=1.3))
    readable_truths = truth_values.readable_digests()
    now = timezone.now()
    assert prepared not in stale(now=now, readable_truths=readable_truths)
    assert prepared in stale(now=now + 2 * confidence.MAX_DELAY, readable_truths=readable_truths)
    assert prepared not in stale(now=now + 2 * confidence.MAX_DELAY, readable_truths=set())


def test_a_digest_and_the_board_choose_the_same_entries(inferred: list[Submission], edition: Edition) -> None:
    chosen = {row.evaluation_id for row in confidence.ranked(confidence.active_entries(edition))}
    board = listing.board(split=edition.split, viewer=ANYBODY)
    assert chosen == {entry.evaluation_id for entry in board.entries if entry.evaluation_id}


def test_one_worker_at_a_time_computes_an_edition(entries: list[Submission], edition: Edition) -> None:
    edition.refresh_from_db()
    now = timezone.now()
    EditionRanges.objects.create(edition=edition, claimed_until=now + timedelta(minutes=1))
    assert not confidence.infer(Entries.of(edition), now=now)
    EditionRanges.objects.update(claimed_until=now - timedelta(minutes=1))  # its worker has died
    assert confidence.infer(Entries.of(edition), now=now)
    assert EditionRanges.objects.get().claimed_until is None


def test_of_two_workers_that_made_the_same_the_second_writes_nothing(
    entries: list[Submission], edition: Edition
) -> None:
    edition.refresh_from_db()
    now, both = timezone.now(), [Entries.of(edition) for _ in range(2)]
    assert [confidence.infer(each, now=now) for each in both] == [True, False]
