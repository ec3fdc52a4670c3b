"""Editions under random steps: no submission is lost, in whatever order editions become the board.

Each walk opens, publishes, rolls back, discards, submits and withdraws on two splits, chosen by its seed, and
compares the database after each step with a model of which edition has which submission.
"""

import random
import uuid
import zlib
from collections import Counter, defaultdict
from pathlib import Path

import pytest
from django.utils import timezone

from leaderboard.editions import corrections, ground_truth
from leaderboard.errors.refusals import Refused
from leaderboard.models import Edition, Evaluation, Split, Status, Submission, User
from leaderboard.queue import lifecycle
from leaderboard.queue.lifecycle import Strike
from leaderboard.submissions import intake
from tests import builders
from tests.leaderboard.web.maintain import queue_rows

pytestmark = pytest.mark.slow

SPLITS = ("test", "val")
N_TRUTHS, N_STEPS = 3, 60
FINISHED = (Status.SCORED, Status.REJECTED)
WAITING = (Status.QUEUED, Status.RUNNING)


class Walk:
    """All that maintainers, teams and workers do to the editions of two splits, in the order of a seed."""

    def __init__(self, *, truths: dict[str, list[str]], people: list[User], rng: random.Random) -> None:
        self.truths, self.people, self.rng = truths, people, rng
        # By the edition's key: the submissions that it must have an evaluation of.
        self.expected: dict[int, set[uuid.UUID]] = defaultdict(set)
        self.in_preparation: dict[str, set[int]] = {split: set() for split in SPLITS}
        self.done: Counter[str] = Counter()

    def step(self) -> None:
        steps = {
            self.submit: 6,
            self.withdraw: 1,
            self.open: 3,
            self.publish: 5,
            self.roll_back: 2,
            self.discard: 1,
            self.retry: 1,
            self.work: 2,
        }
        [chosen] = self.rng.choices(list(steps), list(steps.values()))
        outcome = chosen(self.rng.choice(SPLITS))
        self.done[f"{chosen.__name__}: {outcome or 'done'}"] += 1
        self.check()

    def _board(self, split: str) -> Edition:
        board = Split.objects.select_related("current_edition").get(pk=split).current_edition
        assert board is not None
        return board

    def _edition(self, split: str) -> Edition:
        return self.rng.choice(list(Edition.objects.filter(split=split)))

    def _active(self, split: str) -> set[uuid.UUID]:
        return set(Submission.objects.active().filter(split=split).values_list("pk", flat=True))

    def _became_board(self, edition: Edition) -> None:
        self.expected[edition.pk] |= self._active(edition.split_id)
        self.in_preparation[edition.split_id].discard(edition.pk)

    # --- teams -------------------------------------------------------------------------------------------

    def submit(self, split: str) -> None:
        user, method = self.rng.choice(self.people), self.rng.choice("AB")
        sent = builders.send(user, uuid.uuid4().bytes, split=split, method=method).submission
        for key in {self._board(split).pk, *self.in_preparation[split]}:
            self.expected[key].add(sent.pk)

    def withdraw(self, split: str) -> str | None:
        rows = list(Submission.objects.active().filter(split=split).order_by("submitted_at"))
        if not rows:
            return "nothing to withdraw"
        row = self.rng.choice(rows)
        assert intake.withdraw(submission=row, actor=row.submitted_by, now=timezone.now())
        return None

    # --- maintainers -------------------------------------------------------------------------------------

    def open(self, split: str) -> str:
        digest = self.rng.choice(self.truths[split])
        request = {"split_name": split, "digest": digest, "now": timezone.now(), "actor": None}
        if self._board(split).ground_truth_id == digest:
            with pytest.raises(Refused, match="is the current board already"):
                corrections.open_edition(**request)
            return "refused"
        opened = corrections.open_edition(**request)
        self.in_preparation[split].add(opened.pk)
        self.expected[opened.pk] |= self._active(split)
        return "a former edition" if opened.published_at else "a draft"

    def publish(self, split: str) -> str:
        edition, board = self._edition(split), self._board(split)
        request = {
            "edition": edition,
            "replaces": board.number,
            "leave_out": True,
            "reason": "Corrected.",
            "now": timezone.now(),
            "actor": None,
        }
        if edition.discarded_at or edition == board:
            with pytest.raises(Refused, match="there is nothing to publish"):
                corrections.publish(**request)
            return "refused"
        rows = Evaluation.objects.filter(edition=edition, status__in=FINISHED)
        named = self._active(split) - set(rows.values_list("submission", flat=True))
        assert {each.pk for each in corrections.unfinished(edition)} == named
        assert {str(pk) for pk in named} <= set(corrections.publish(**request).left_out)
        self._became_board(edition)
        return "again" if edition.published_at else "first"

    def roll_back(self, split: str) -> str | None:
        former = corrections.predecessor(Split.objects.get(pk=split))
        request = {
            "split_name": split,
            "replaces": self._board(split).number,
            "reason": "A mistake.",
            "now": timezone.now(),
            "actor": None,
        }
        if former is None:
            with pytest.raises(Refused, match="cannot be rolled back"):
                corrections.roll_back(**request)
            return "refused"
        corrections.roll_back(**request)
        self._became_board(former)
        return None

    def discard(self, split: str) -> str:
        edition = self._edition(split)
        request = {"edition": edition, "reason": "Wrong file.", "now": timezone.now(), "actor": None}
        if edition.pk not in self.in_preparation[split]:
            with pytest.raises(Refused, match="is not in preparation"):
                corrections.discard(**request)
            return "refused"
        corrections.discard(**request)
        self.in_preparation[split].remove(edition.pk)
        return "a former edition" if edition.published_at else "a draft"

    def retry(self, split: str) -> None:
        failed = Evaluation.objects.filter(status=Status.SYSTEM_ERROR, edition__split=split)
        for row in failed.filter(submission__withdrawn_at=None):
            lifecycle.retry(evaluation=row, actor=None)

    # --- workers -----------------------------------------------------------------------------------------

    def work(self, split: str, *, limit: int = 4, fails: float = 0.2) -> str | None:
        leases = lifecycle.claim(lease_s=queue_rows.LEASE_S, wall_s=queue_rows.WALL_S, limit=limit)
        for lease in leases:
            if self.rng.random() < fails:
                failure = {"strike": Strike.INFRASTRUCTURE, "reason": "the disk failed", "rng": self.rng}
                lifecycle.fail_attempt(lease, is_last=True, **failure)
            else:
                lifecycle.finalise(lease, self.rng.choice([queue_rows.SCORED, queue_rows.REJECTED]))
        return None if leases else "nothing waits"

    # --- what always holds -------------------------------------------------------------------------------

    def check(self, *, is_over: bool = False) -> None:
        """Every active submission is on the board or on its way to it, and no edition has another set."""
        boards = set(Split.objects.filter(pk__in=SPLITS).values_list("current_edition", flat=True))
        editions = {row.pk: row for row in Edition.objects.all()}
        active = {split: self._active(split) for split in SPLITS}
        rows: dict[int, dict[uuid.UUID, Evaluation]] = {pk: {} for pk in editions}
        for row in Evaluation.objects.all():
            rows[row.edition_id][row.submission_id] = row
        for pk, edition in editions.items():
            assert set(rows[pk]) == self.expected[pk], edition
            here = [row for key, row in rows[pk].items() if key in active[edition.split_id]]
            allowed = {*FINISHED, Status.SYSTEM_ERROR}
            if edition.discarded_at:
                allowed.add(Status.CANCELLED)
            elif not is_over:
                allowed.update(WAITING)
            assert {row.status for row in here} <= allowed, edition
            assert all(row.problems for row in here if row.status == Status.REJECTED)
            assert all(row.last_error for row in here if row.status == Status.SYSTEM_ERROR)
            assert pk not in boards or len(here) == len(active[edition.split_id]), edition
        prepared = {pk for split in SPLITS for pk in self.in_preparation[split]}
        assert {row.pk for row in Edition.objects.in_preparation()} == prepared
        assert {pk for pk, row in editions.items() if row.is_in_preparation} == prepared


@pytest.fixture
def truths(edition: Edition, tmp_path: Path) -> dict[str, list[str]]:
    """Three ground truths of each split, by digest; the first is the board's."""
    builders.import_truth(tmp_path, split="val", seed=50)
    digests = {}
    for split, first in (("test", 1), ("val", 51)):
        digests[split] = [Edition.objects.get(split=split).ground_truth_id]
        for seed in range(first, first + N_TRUTHS - 1):
            # An open split has other sequences than a hidden one.
            shift_ns = 0 if split == "test" else 1 + zlib.crc32(split.encode()) % 10_000_000
            path = builders.truth_csv(tmp_path / f"{split}-{seed}.csv", seed=seed, shift_ns=shift_ns)
            row = ground_truth.add(split_name=split, path=path, now=timezone.now(), actor=None)
            digests[split].append(row.pk)
    return digests


@pytest.mark.parametrize("seed", range(6))
def test_no_order_of_steps_loses_a_submission(
    truths: dict[str, list[str]], owner: User, stranger: User, seed: int
) -> None:
    walk = Walk(truths=truths, people=[owner, stranger], rng=random.Random(seed))
    for _ in range(N_STEPS):
        walk.step()
    while walk.work("test", limit=100, fails=0.0) is None:
        pass
    walk.check(is_over=True)
