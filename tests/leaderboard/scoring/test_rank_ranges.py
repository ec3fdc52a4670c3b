"""Rank ranges of a board: made anew where a rank may have changed, all of them or none."""

import pytest
from django.db.models import Count
from django.utils import timezone

from leaderboard.models import Edition, EditionRanges, Evaluation, Submission, User
from leaderboard.scoring import confidence
from leaderboard.scoring.confidence import Entries
from leaderboard.submissions import submissions
from tests import builders

pytestmark = pytest.mark.slow


def ranges() -> dict[int, object]:
    return dict(EditionRanges.objects.values_list("edition", "ranges"))


def look() -> None:
    """What a worker does once a board has rested."""
    Edition.objects.update(inferred_at=None)
    builders.infer_all()


def anew() -> dict[int, object]:
    """The ranges that a worker makes where there are none."""
    EditionRanges.objects.all().delete()
    Edition.objects.update(inference_digest="former")
    look()
    return ranges()


def test_a_submission_that_changes_no_rank_makes_no_range_anew(
    entries: list[Submission], edition: Edition, owner: User, monkeypatch: pytest.MonkeyPatch
) -> None:
    builders.infer_all()
    found = ranges()

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("ranges were made")

    monkeypatch.setattr(confidence, "rank_ranges", refuse)
    private = builders.submit(owner, builders.predictions(edition), method="P", visibility="PRIVATE")
    worse = builders.submit(owner, builders.predictions(edition, factor=2.0), method="M1.05")
    builders.score_all()
    look()
    assert ranges() == found
    for submission in (private, worse):
        scores = Evaluation.objects.get(submission=submission).scores
        assert scores.exclude(low=None).aggregate(n=Count("pk"))["n"] > 0


def test_a_worker_that_is_interrupted_half_way_leaves_nothing_wrong(
    entries: list[Submission], edition: Edition, owner: User
) -> None:
    builders.infer_all()
    builders.submit(owner, builders.predictions(edition, factor=1.02), method="New", visibility="PUBLIC")
    builders.score_all()
    submissions.withdraw(submission=entries[1], actor=owner, now=timezone.now())
    edition.refresh_from_db()
    left: list[None] = []

    def interrupt() -> None:
        if not left:
            raise KeyboardInterrupt
        left.pop()

    before = ranges()
    for n_pauses in (1, 2, 4, 8):
        left[:] = [None] * n_pauses
        with pytest.raises(KeyboardInterrupt):
            confidence.infer(Entries.of(edition), now=timezone.now(), between=interrupt)
        assert ranges() == before
    look()
    found = ranges()
    assert found != before
    assert found == anew()
