"""A visitor cannot link an anonymous method to the named method that it succeeds."""

from pathlib import Path
from uuid import UUID

import numpy as np
import pytest
from django.db import transaction
from django.test import Client

import evaluator
from leaderboard import board_versions
from leaderboard.models import Edition, Method, Split, User, Visibility
from leaderboard.storage import truth_values
from tests import builders

ADDRESS = "/api/v1/compare"


def network(edition: Edition, *, own: int, run: int, size: float) -> bytes:
    """The predictions of a network that finds some recordings hard, whichever way it is trained."""
    truth = truth_values.load(edition.ground_truth_id)
    of, n = truth.manifest.recording_index, truth.manifest.n_recordings
    hard = np.random.default_rng(own).lognormal(0, 0.8, n) * np.random.default_rng(run).lognormal(0, 0.1, n)
    return evaluator.write_predictions(
        manifest=truth.manifest, ttc_s=np.clip(truth.ttc_s * (1 + size * hard[of]), -20, 20)
    )


def correlation(client: Client, *methods: UUID) -> float | None:
    """Of two methods' errors over recordings, from the widths of three intervals, for anybody who asks."""
    query = {"split": "test", "m": [str(pk) for pk in methods]}
    answer = client.get(ADDRESS, query).json()
    if not answer["is_complete"]:
        builders.infer_all()
        answer = client.get(ADDRESS, query).json()
    board = client.get("/api/v1/splits/test/board?intervals=1").json()
    intervals = {row["method_id"]: row["intervals"]["mid"] for row in board["entries"] if row["intervals"]}
    widths = [intervals[str(pk)]["high"] - intervals[str(pk)]["low"] for pk in methods]
    gap = answer["pairs"][0]["differences"]["mid"]
    assert gap["difference"] is not None
    if gap["low"] is None:
        assert (gap["high"], gap["p"], gap["p_below"]) == (None, None, None)
        assert "could reveal its team" in answer["pairs"][0]["withheld"]
        return None
    between = gap["high"] - gap["low"]
    return float((widths[0] ** 2 + widths[1] ** 2 - between**2) / (2 * widths[0] * widths[1]))


@pytest.mark.slow
def test_an_anonymous_successor_is_not_linked_to_its_predecessor(
    client: Client, benchmark: None, owner: User, tmp_path: Path
) -> None:
    Split.objects.filter(pk="test").update(is_hidden=False, decimals=2)
    edition = builders.import_truth(tmp_path)
    stranger = User.objects.create_user("stranger@example.org", "correct horse", name="Strangers")
    former = builders.submit(owner, network(edition, own=1, run=11, size=0.2), method="Net C").method_id
    other = builders.submit(stranger, network(edition, own=2, run=12, size=0.2), method="Net A").method_id
    later = builders.submit(owner, network(edition, own=1, run=13, size=0.18), method="Net C 2").method_id
    Method.objects.filter(pk=later).update(visibility=Visibility.ANONYMOUS)
    builders.score_all()
    builders.infer_all()

    assert correlation(client, other, former) is not None
    assert correlation(client, other, later) is None
    assert correlation(client, former, later) is None

    Method.objects.filter(pk=later).update(visibility=Visibility.PUBLIC)
    with transaction.atomic():
        board_versions.bump("test")
    strangers, relatives = correlation(client, other, later), correlation(client, former, later)
    assert strangers is not None
    assert relatives is not None
    assert relatives > strangers + 0.2, "what is kept from visitors would have told"
