"""Intervals and rank ranges are computed again when their inputs change, and from what."""

import pytest

from evaluator import SCORE_NAMES
from leaderboard.models import Comparison, Edition, EditionRanges, Evaluation, Score, Submission
from leaderboard.statistics import confidence, recording_sums
from tests import builders
from tests.leaderboard.statistics.inferred_scores import everything


@pytest.fixture
def inferred(entries: list[Submission]) -> list[Submission]:
    """Four scored submissions, and what workers make of them afterwards."""
    assert builders.infer_all() == 1
    return entries


def test_an_edition_knows_its_effective_numbers_of_recordings(
    inferred: list[Submission], edition: Edition
) -> None:
    edition.refresh_from_db()
    counts = recording_sums.counts_of(edition)
    for column, name in enumerate(SCORE_NAMES):
        exact = (counts[:, column] ** 2).sum() ** 2 / (counts[:, column] ** 4).sum()
        assert 0 <= exact - edition.n_effective[name] < 0.1


@pytest.mark.slow
def test_every_random_number_of_an_edition_comes_from_its_seed(
    inferred: list[Submission], edition: Edition, monkeypatch: pytest.MonkeyPatch
) -> None:
    # What a hidden split tells is too coarse to show it.
    builders.open_values(edition)
    Edition.objects.filter(pk=edition.pk).update(decimals=2)

    def everything_drawn() -> list[object]:
        Score.objects.update(low=None, high=None)
        Edition.objects.filter(pk=edition.pk).update(inference_digest="")
        EditionRanges.objects.all().delete()
        Comparison.objects.all().delete()
        ids = sorted(Evaluation.objects.filter(edition=edition).values_list("pk", flat=True))
        row = Comparison.objects.create(edition=edition, first_id=ids[0], second_id=ids[1])
        builders.infer_all()
        row.refresh_from_db()
        return [*everything(), row.differences]

    before = everything_drawn()
    assert everything_drawn() == before
    monkeypatch.setattr(confidence, "seed_of", lambda edition: f"secret {edition.ground_truth_id}")
    after = everything_drawn()
    assert before[-1] != after[-1]
    assert before[:-1] != after[:-1]
