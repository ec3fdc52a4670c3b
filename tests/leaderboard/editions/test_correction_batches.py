"""Re-scoring in batches: what a worker had in hand when it died, and what it says when it comes back."""

from pathlib import Path

import pytest
from django.core.files.base import ContentFile
from django.utils import timezone

import evaluator
from leaderboard.boards.rows import flat_scores
from leaderboard.editions import ground_truth
from leaderboard.models import AuditEvent, Edition, Evaluation, Score, Status
from leaderboard.queue import lifecycle, worker
from leaderboard.queue.lifecycle import Lease
from leaderboard.storage import files, truth_values
from tests import builders, crowd
from tests.leaderboard.web.maintain import queue_rows

N_SUBMISSIONS = 150


@pytest.fixture
def edition(benchmark: None, tmp_path: Path) -> Edition:
    """An edition with more submissions waiting to be scored again than one batch holds."""
    path = builders.truth_csv(tmp_path / "truth-test.csv")
    edition = ground_truth.import_truth(split_name="test", path=path, now=timezone.now())
    truth = truth_values.load(edition.ground_truth_id)
    crowd.join(split_name="test", truth=truth, n=N_SUBMISSIONS, n_files=5)
    return edition


def claim_batch() -> list[Lease]:
    return lifecycle.claim(lease_s=queue_rows.LEASE_S, wall_s=queue_rows.WALL_S, in_batches=True)


def assert_all_scored_once(edition: Edition) -> None:
    """Every submission has the ten numbers that the evaluator alone gives, and was decided once."""
    truth = truth_values.load(edition.ground_truth_id)
    rows = Evaluation.objects.filter(edition=edition).select_related("submission__method")
    assert {row.status for row in rows} == {Status.SCORED}
    scores_by_method = {row.submission.method.name: flat_scores(row) for row in rows}
    assert scores_by_method == {
        crowd.method_name(number): crowd.published_scores(truth, number) for number in range(N_SUBMISSIONS)
    }
    assert Score.objects.count() == N_SUBMISSIONS * len(evaluator.SCORE_NAMES)
    decided = list(AuditEvent.objects.filter(verb="scored").values_list("noun_id", flat=True))
    assert len(decided) == len(set(decided)) == N_SUBMISSIONS


@pytest.mark.slow
def test_a_worker_that_comes_back_with_a_batch_that_others_finished_changes_nothing(edition: Edition) -> None:
    zombie = claim_batch()
    for lease in zombie:
        queue_rows.expire(lease)
    queue_rows.release_expired()
    queue_rows.make_due()
    builders.score_all()
    assert worker.rescore(zombie, edition=edition) == []
    assert_all_scored_once(edition)
    attempts = dict(Evaluation.objects.values_list("pk", "attempt"))
    assert all(attempts[lease.evaluation_id] == 2 for lease in zombie)
    assert list(attempts.values()).count(1) == N_SUBMISSIONS - len(zombie)


@pytest.mark.slow
def test_a_batch_of_which_a_part_was_taken_away_is_stored_without_that_part(edition: Edition) -> None:
    leases = claim_batch()
    taken, kept = leases[:7], leases[7:]
    for lease in taken:
        queue_rows.expire(lease)
    queue_rows.release_expired()
    worker.rescore(leases, edition=edition)
    scored = set(Evaluation.objects.filter(status=Status.SCORED).values_list("pk", flat=True))
    assert scored == {lease.evaluation_id for lease in kept}
    queue_rows.make_due()
    builders.score_all()
    assert_all_scored_once(edition)


@pytest.mark.slow
@pytest.mark.parametrize("left", [None, b"", b"\0" * 17], ids=["none", "empty", "cut off"])
def test_a_file_without_its_kept_values_is_read_again_beside_the_batch(
    edition: Edition, left: bytes | None
) -> None:
    truth = truth_values.load(edition.ground_truth_id)
    digest = evaluator.read_predictions(crowd.contents(truth, 3), manifest=truth.manifest).digest
    store = files.store()
    name = files.aligned_name(manifest_digest=truth.manifest.digest, digest=digest)
    store.delete(name)
    if left is not None:
        store.save(name, ContentFile(left))
    builders.score_all()
    assert_all_scored_once(edition)


@pytest.mark.slow
def test_kept_values_that_were_changed_are_not_scored(edition: Edition) -> None:
    truth = truth_values.load(edition.ground_truth_id)
    digest = evaluator.read_predictions(crowd.contents(truth, 3), manifest=truth.manifest).digest
    name = files.aligned_name(manifest_digest=truth.manifest.digest, digest=digest)
    store = files.store()
    with store.open(name, "rb") as kept:
        data = bytearray(kept.read())
    right = bytes(data)
    data[-1] ^= 0x80  # the sign of the last value: as long as before, and a prediction like any other
    store.delete(name)
    store.save(name, ContentFile(bytes(data)))
    builders.score_all()
    assert not Evaluation.objects.exclude(status=Status.SCORED).exists()
    # The file itself was read again, and what is kept is right.
    with store.open(name, "rb") as kept:
        assert kept.read() == right
