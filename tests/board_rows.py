"""Boards of any size, written row by row: what readers are answered, without scoring a single file."""

import random
from collections.abc import Sequence
from datetime import timedelta

from django.db import transaction
from django.utils import timezone

from evaluator.metrics.protocol import split_name
from leaderboard import board_versions
from leaderboard.models import (
    Edition,
    EditionRanges,
    Evaluation,
    Method,
    Score,
    Status,
    Submission,
    Team,
    User,
    Visibility,
)
from leaderboard.people.names import skeleton


def fill(edition: Edition, *, n: int, user: User, seed: int = 0) -> list[Method]:
    """`n` public methods, each of its own team and with one scored submission, as finalising leaves them."""
    now = timezone.now()
    first = Team.objects.count()
    names = [f"Team {first + i}" for i in range(n)]
    teams = Team.objects.bulk_create(Team(name=name, look=skeleton(name)) for name in names)
    methods = Method.objects.bulk_create(
        Method(
            team=team,
            name=f"Method {first + i} of scale and time",
            description="It measures how an object grows from frame to frame.",
            paper_url=f"https://example.org/papers/{first + i}" if i % 3 == 0 else "",
            code_url=f"https://example.org/code/{first + i}" if i % 2 == 0 else "",
            n_frames=2 + i % 5,
            latency_ms=5.0 + i % 40,
            visibility=Visibility.PUBLIC,
            shown_at=now,
        )
        for i, team in enumerate(teams)
    )
    score(edition, methods=methods, user=user, seed=seed)
    with transaction.atomic():
        board_versions.bump(edition.split_id)
    return methods


def score(edition: Edition, *, methods: Sequence[Method], user: User, seed: int = 0) -> None:
    """One scored submission of each of these methods."""
    rng = random.Random(seed)
    now = timezone.now()
    submissions = Submission.objects.bulk_create(
        Submission(
            split_id=edition.split_id,
            method=method,
            submitted_by=user,
            submitted_at=now - timedelta(minutes=i),
            via=Submission.Via.API,
            digest=f"sha256:{rng.getrandbits(256):064x}",
            manifest_digest=edition.ground_truth.manifest_digest,
            size_bytes=1000,
        )
        for i, method in enumerate(methods)
    )
    evaluations = Evaluation.objects.bulk_create(
        Evaluation(
            submission=submission,
            edition=edition,
            status=Status.SCORED,
            attempt=1,
            finished_attempt=1,
            finished_at=now,
        )
        for submission in submissions
    )
    Score.objects.bulk_create(
        Score(
            evaluation=evaluation,
            metric=metric,
            ttc_range=ttc_range,
            value=value,
            low=round(value * 0.95, edition.decimals),
            high=round(value * 1.05, edition.decimals),
        )
        for i, evaluation in enumerate(evaluations)
        for metric, ttc_range in map(split_name, edition.rules.score_names)
        for value in [round(rng.uniform(8, 80), edition.decimals)]
    )
    n_columns = len(edition.rules.score_names)
    kept, _ = EditionRanges.objects.get_or_create(edition=edition, defaults={"ranges": {}})
    kept.ranges |= {
        str(row.pk): [[max(1, i - 3), i + 4] for _ in range(n_columns)] for i, row in enumerate(evaluations)
    }
    kept.save()
