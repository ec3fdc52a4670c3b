"""What an earlier version of the site inferred is renewed once, and says why where nothing is left."""

from pathlib import Path

import pytest
from django.test import Client

from leaderboard.models import Comparison, Edition, EditionRanges, Evaluation, Score, User, Visibility
from leaderboard.statistics import confidence
from leaderboard.statistics.confidence import Entries
from tests import builders
from tests.leaderboard.statistics.inferred_scores import everything

pytestmark = pytest.mark.slow


@pytest.fixture
def board(benchmark: None, owner: User, tmp_path: Path) -> Edition:
    """Two methods with no warning error, and one with many, on an open split."""
    edition = builders.import_truth(tmp_path, split="val", protocol="tsttc-2")
    builders.open_values(edition)
    for name, factor in (("near", 1.0001), ("nearer", 1.00005), ("far", 0.2)):
        builders.submit(
            owner, builders.predictions(edition, factor=factor), split="val", method=name, visibility="PUBLIC"
        )
    builders.score_all()
    builders.infer_all()
    edition.refresh_from_db()
    return edition


def as_of_an_earlier_method(edition: Edition) -> list[Score]:
    """Write what the method before would have: [0, 0], p = 1 and other ranges; returns its intervals."""
    usable = [name.partition("_")[2] or "overall" for name, n in edition.n_effective.items() if n >= 8]
    nothing = list(Score.objects.filter(metric="warning", value=0, ttc_range__in=usable))
    assert len(nothing) >= 2
    Score.objects.filter(pk__in=[each.pk for each in nothing]).update(low=0.0, high=0.0)
    row = EditionRanges.objects.get(edition=edition)
    row.ranges = {pk: [[1, 3]] * len(columns) for pk, columns in row.ranges.items()}
    row.digest = "sha256:before"
    row.save()
    Edition.objects.filter(pk=edition.pk).update(inference_digest="sha256:before")
    return nothing


def test_ranges_and_intervals_of_an_earlier_method_are_renewed_once(board: Edition) -> None:
    before, ranges = everything(), EditionRanges.objects.get(edition=board).ranges
    as_of_an_earlier_method(board)
    assert everything() != before
    assert builders.infer_all() == 1
    assert everything() == before
    assert EditionRanges.objects.get(edition=board).ranges == ranges
    assert builders.infer_all() == 0


def test_an_interval_of_an_earlier_method_that_there_still_is_keeps_every_digit(board: Edition) -> None:
    as_of_an_earlier_method(board)
    kept = Score.objects.filter(metric="mid").exclude(low=None)
    assert kept.count() >= 2
    kept.update(low=1.25, high=987.65)
    builders.infer_all()
    assert set(kept.values_list("low", "high")) == {(1.25, 987.65)}


def test_comparisons_of_an_earlier_method_are_renewed_once_and_shown_meanwhile(board: Edition) -> None:
    ids = sorted(Evaluation.objects.filter(edition=board).values_list("pk", flat=True))
    pairs = [Comparison.objects.create(edition=board, first_id=ids[0], second_id=other) for other in ids[1:]]
    builders.infer_all()
    before = {pair.pk: Comparison.objects.get(pk=pair.pk).differences for pair in pairs}
    as_of_an_earlier_method(board)
    earlier = {"warning": {"difference": 0.0, "low": 0.0, "high": 0.0, "p": 1.0}}
    Comparison.objects.update(differences=earlier)
    entries = Entries.of(Edition.objects.get(pk=board.pk))
    assert confidence.infer(entries, now=board.opened_at)
    assert [pair.differences for pair in Comparison.objects.all()] == [earlier] * len(pairs)
    assert builders.infer_all() == len(pairs)
    assert {pair.pk: pair.differences for pair in Comparison.objects.all()} == before
    assert builders.infer_all() == 0


def test_the_api_says_why_a_score_has_no_interval(board: Edition, client: Client) -> None:
    rows = client.get("/api/v1/splits/val/board?intervals=1").json()["entries"]
    by_method = {row["method"]: row["intervals"] for row in rows}
    n_sequences = board.ground_truth.n_sequences
    for name in ("near", "nearer"):
        interval = by_method[name]["warning"]
        assert (interval["low"], interval["high"]) == (None, None)
        assert interval["reason"].startswith(f"an error in 0 of {n_sequences:,} sequences (below ")
        assert by_method[name]["mid"]["reason"] == ""
    assert by_method["far"]["warning"]["reason"] == ""
    assert by_method["far"]["warning"]["low"] is not None


def test_the_api_gives_no_reason_while_intervals_are_to_come(board: Edition, client: Client) -> None:
    Score.objects.update(low=None, high=None)
    rows = client.get("/api/v1/splits/val/board?intervals=1").json()["entries"]
    assert {each["reason"] for row in rows for each in row["intervals"].values()} <= {""}
    assert Visibility.PUBLIC in {row["visibility"] for row in rows}
