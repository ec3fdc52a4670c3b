"""Rank ranges from what a worker has kept are those of all pairs, whatever happened to the board."""

import random
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from django.db.models import Count
from django.test import override_settings
from django.utils import timezone

import evaluator
from evaluator.scoring import ranges
from leaderboard.models import (
    Edition,
    EditionRanges,
    Evaluation,
    Method,
    PublishedResult,
    Split,
    Submission,
    User,
    Visibility,
)
from leaderboard.scoring import confidence, kept_ranges
from leaderboard.scoring.confidence import Entries
from leaderboard.storage import truth_values
from leaderboard.submissions import submissions
from tests import builders
from tests.editions import corrected, open_edition, publish

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def nothing_kept() -> Iterator[None]:
    kept_ranges.forget()
    yield
    kept_ranges.forget()


@pytest.fixture
def whole(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many entries all pairs were compared of, each time that they were."""
    counted: list[int] = []
    begin = ranges.KeptRanges.__init__

    def counting(self: ranges.KeptRanges, **options: object) -> None:
        counted.append(int(str(options["n_entries"])))
        begin(self, **options)  # type: ignore[arg-type]  # as they came

    monkeypatch.setattr(ranges.KeptRanges, "__init__", counting)
    return counted


def noisy(edition: Edition, seed: int) -> bytes:
    """A file whose errors have no pattern, so that ranges overlap."""
    truth = truth_values.load(edition.ground_truth_id)
    rng = np.random.default_rng(seed)
    noise = rng.lognormal(0, rng.uniform(0.05, 0.2), truth.n_sequences)
    return evaluator.write_predictions(manifest=truth.manifest, ttc_s=truth.ttc_s * noise)


def send(user: User, edition: Edition, seed: int, *, visibility: str = "PUBLIC") -> Submission:
    method = f"M{seed % 9}"
    sent = builders.submit(user, noisy(edition, seed), method=method, visibility=visibility)
    builders.score_all()
    return sent


def kept() -> dict[int, object]:
    return dict(EditionRanges.objects.values_list("edition", "ranges"))


def anew() -> dict[int, object]:
    """The ranges that a worker makes that has kept nothing, of all pairs at once."""
    kept_ranges.forget()
    EditionRanges.objects.all().delete()
    Edition.objects.update(inference_digest=f"{confidence.METHOD} former", inferred_at=None)
    with override_settings(KEPT_PAIRS_MB=0):
        builders.infer_all()
    return kept()


def look() -> None:
    """What a worker does that has kept what it made the last time."""
    Edition.objects.update(inferred_at=None)
    builders.infer_all()


@pytest.mark.parametrize("seed", range(2))
def test_ranges_are_those_of_all_pairs_after_whatever_happened(
    edition: Edition, owner: User, whole: list[int], tmp_path: Path, seed: int
) -> None:
    Split.objects.filter(pk="test").update(is_hidden=bool(seed))
    rng = random.Random(seed)
    sent = [send(owner, edition, number) for number in range(5)]
    look()
    for number in range(5, 13):
        # A new method, another submission of one, a withdrawal, a private one: what moves a board.
        what = rng.choice(["send", "send", "withdraw", "private", "show"])
        standing = [each for each in sent if each.withdrawn_at is None]
        if what == "withdraw":
            submissions.withdraw(submission=rng.choice(standing), actor=owner, now=timezone.now())
            sent = list(Submission.objects.filter(pk__in=[each.pk for each in sent]))
        elif what == "show":
            Method.objects.update(visibility=Visibility.PUBLIC, shown_at=timezone.now())
        else:
            sent.append(send(owner, edition, number, visibility="PRIVATE" if what == "private" else "PUBLIC"))
        look()
    assert whole == [5], "all other times entries came and went"
    found = kept()
    assert found == anew()

    look()
    builders.quote("Quoted", {"mid": 30.0, "mid_crucial": 20.5})
    look()
    assert kept() != found
    PublishedResult.objects.filter(slug="quoted").update(scores={"mid": 10.0})
    look()
    open_edition(corrected(tmp_path, factor=1.3))
    builders.score_all()
    look()
    other = open_edition(protocol="toolkit")
    builders.score_all()
    look()
    send(owner, edition, 17)
    look()
    assert len(kept()) == 3
    found = kept()
    assert found == anew()
    publish(other)
    assert kept() == found


def test_a_submission_that_changes_no_rank_makes_no_range_anew(
    entries: list[Submission], edition: Edition, owner: User, monkeypatch: pytest.MonkeyPatch
) -> None:
    builders.infer_all()
    found = kept()

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("ranges were made")

    monkeypatch.setattr(kept_ranges, "ranges_of", refuse)
    private = builders.submit(owner, builders.predictions(edition), method="P", visibility="PRIVATE")
    worse = builders.submit(owner, builders.predictions(edition, factor=2.0), method="M1.05")
    builders.score_all()
    look()
    assert kept() == found
    for submission in (private, worse):
        scores = Evaluation.objects.get(submission=submission).scores
        assert scores.exclude(low=None).aggregate(n=Count("pk"))["n"] > 0


def test_a_worker_that_is_interrupted_half_way_leaves_nothing_wrong(
    entries: list[Submission], edition: Edition, owner: User
) -> None:
    builders.infer_all()
    send(owner, edition, 3)
    submissions.withdraw(submission=entries[1], actor=owner, now=timezone.now())
    edition.refresh_from_db()
    left: list[None] = []

    def interrupt() -> None:
        if not left:
            raise KeyboardInterrupt
        left.pop()

    before = kept()
    for n_pauses in (1, 2, 4, 8):
        left[:] = [None] * n_pauses
        with pytest.raises(KeyboardInterrupt):
            confidence.infer(Entries.of(edition), now=timezone.now(), between=interrupt)
        assert kept() == before
    look()
    found = kept()
    assert found != before
    assert found == anew()


def test_editions_share_the_room_that_a_worker_has(
    rescored: Edition,
    edition: Edition,
    owner: User,
    whole: list[int],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    look()
    assert whole == [4, 4]
    n_bytes = kept_ranges.n_bytes()
    send(owner, edition, 3)
    look()
    assert whole == [4, 4], "both are kept"
    monkeypatch.setattr(ranges.KeptRanges, "nbytes_of", lambda *_, **__: 0)
    with override_settings(KEPT_PAIRS_MB=0.7 * n_bytes / 1e6):
        send(owner, edition, 5)
        look()
        assert whole == [4, 4, 6], "the first made the other one go"
        send(owner, edition, 6)
        look()
        assert whole == [4, 4, 6, 7, 7], "each makes the other one go"
    found = kept()
    monkeypatch.undo()
    assert found == anew()
