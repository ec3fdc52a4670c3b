"""Small worlds for tests: a made-up ground truth, prediction files for it, people and their submissions."""

import random
import zlib
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
from django.core.files.base import ContentFile
from django.db import transaction
from django.utils import timezone

import evaluator
from evaluator.metrics.protocol import DEFAULT_PROTOCOL
from leaderboard import board_versions
from leaderboard.editions import ground_truth
from leaderboard.methods import editing
from leaderboard.methods import visibility as visibility_verbs
from leaderboard.models import Edition, PublishedResult, QuotaOverride, Scope, Split, Submission, Team, User
from leaderboard.people import tokens
from leaderboard.queue import worker
from leaderboard.quotas import usage
from leaderboard.storage import truth_values
from leaderboard.submissions import intake
from leaderboard.upkeep import backlog

N_SEQUENCES = 120


def truth_csv(
    path: Path, *, n: int = N_SEQUENCES, seed: int = 0, n_recordings: int = 24, shift_ns: int = 0
) -> Path:
    """A ground truth with sequences in every interval and a few out of range.

    Another shift makes it one of other sequences.
    """
    rng = np.random.default_rng(seed)
    tau = np.concatenate([[1.0, 4.0, 10.0, -10.0, 25.0], rng.uniform(0.3, 20, n - 5)])
    tau[5::4] *= -1
    rows = ["anno_id,bag_stamp,cam_id,ts,track_id,ttc"]
    for i, value in enumerate(tau):
        rows.append(
            f"{i},{i % n_recordings:04d},1,{500_000_000 + i * 100_000_000 + shift_ns},{i % 7},{value!r}"
        )
    path.write_text("\n".join(rows).replace("np.float64(", "").replace(")", "") + "\n")
    return path


def import_truth(
    tmp_path: Path, *, split: str = "test", protocol: str = DEFAULT_PROTOCOL, **options: int
) -> Edition:
    """Open a split with made-up ground truth, without the quotas that most tests are not about."""
    Split.objects.update(quota_limit=None, quota_min_gap=timedelta(0), quota_rejected_limit=None)
    # Other splits have other sequences than the hidden one.
    options.setdefault("shift_ns", 0 if split == "test" else 1 + zlib.crc32(split.encode()) % 10_000_000)
    path = truth_csv(tmp_path / f"truth-{split}.csv", **options)
    return ground_truth.import_truth(split_name=split, path=path, protocol=protocol, now=timezone.now())


def predictions(edition: Edition, *, factor: float = 1.1) -> bytes:
    """A valid file: the truth times a factor, so that a factor nearer to 1 is a better method."""
    truth = truth_values.load(edition.ground_truth_id)
    return evaluator.write_predictions(manifest=truth.manifest, ttc_s=truth.ttc_s * factor)


def send(
    user: User,
    data: "bytes | ContentFile[Any]",
    *,
    split: str = "test",
    method: str = "Foo",
    now: datetime | None = None,
    **fields: str,
) -> intake.Submitted:
    """What sending a file is answered, as the web form sends it."""
    request = intake.SubmissionRequest(
        user=user,
        split_name=split,
        method_name=method,
        upload=ContentFile(data, name="predictions.json") if isinstance(data, bytes) else data,
        via=Submission.Via.WEB,
        now=now or timezone.now(),
        details={name: fields.pop(name) for name in editing.FIELDS if name in fields},
        **{"filename": "predictions.json", **fields},
    )
    return intake.submit(request)


def submit(user: User, data: bytes, *, visibility: str = "PUBLIC", **options: Any) -> Submission:
    """A submission of a method that is then shown."""
    submission = send(user, data, **options).submission
    if visibility != "PRIVATE" and submission.method.visibility == "PRIVATE":
        visibility_verbs.change(
            method=submission.method, visibility=visibility, actor=user, now=submission.submitted_at
        )
        submission.method.refresh_from_db()
    return submission


def override(team: Team, *, split: str = "test", **options: Any) -> QuotaOverride:
    """Rules of a team's own, without any limit that `options` does not give; by the command line."""
    rules = {"limit": None, "window": timedelta(days=1), "min_gap": timedelta(0), "rejected_limit": None}
    row = Split.objects.get(pk=split)
    audit_fields = {"reason": "R", "actor": None, "now": timezone.now()}
    return usage.override(team=team, split=row, **{**rules, **audit_fields, **options})


def quote(name: str, scores: dict[str, float]) -> PublishedResult:
    """A row of the test board that is printed in a paper."""
    return PublishedResult.objects.create(
        split_id="test",
        slug=name.lower(),
        method_name=name,
        authors="A",
        source_title="T",
        source_url="https://example.org",
        source_table="1",
        year=2023,
        scores=scores,
    )


def token(user: User, **options: Any) -> str:
    """A new token of that person, which may do everything."""
    options = {"scopes": Scope.values, **options}
    return tokens.create(user=user, name="CI", now=timezone.now(), **options)


def board_changed(split: str) -> None:
    """Say that a board is not what it was: for tests that write behind the verbs' backs."""
    with transaction.atomic():
        board_versions.bump(split)


def open_values(edition: Edition) -> None:
    """Make hidden values open, as if they had been imported for an open split."""
    Split.objects.filter(pk=edition.split_id).update(is_hidden=False)
    truth_values.values_path(edition.ground_truth_id).with_suffix(".hidden").unlink(missing_ok=True)


def infer_all() -> int:
    """Do in this process what workers do when no submission waits. Returns how much that was."""
    return backlog.work_off(now=timezone.now(), rng=random.Random(0))


def score_all() -> int:
    """Work through the queue in this process. Returns how many evaluations were decided."""
    n_decided = 0
    while worker.run_next(rng=random.Random(0)):
        n_decided += 1
    return n_decided
