"""A board worth looking at: methods of two teams on `val`, scored and public, one private, one withdrawn.

`populate` runs in a process of the site (`manage.py shell`), because the site's database is its own.
"""

import json
import tempfile
from datetime import timedelta
from pathlib import Path

import numpy as np
from allauth.account.models import EmailAddress
from django.contrib.auth.models import AnonymousUser
from django.db import transaction
from django.utils import timezone

import evaluator
from leaderboard import board_versions
from leaderboard.boards import snapshots
from leaderboard.demo.runs import simulate
from leaderboard.editions import ground_truth
from leaderboard.models import (
    BoxSource,
    Edition,
    Evaluation,
    Method,
    PublishedResult,
    Split,
    Submission,
    User,
    Visibility,
)
from leaderboard.statistics import analyses, comparisons
from leaderboard.storage import truth_values
from leaderboard.submissions import intake
from tests import builders, editions
from tests.browser.site import PASSWORD
from tests.journeys.production import Site
from tests.leaderboard.web.maintain import queue_rows

SPLIT = "val"
OWNER, RIVAL, MAINTAINER = "owner@example.org", "rival@example.org", "maintainer@example.org"
N_SEQUENCES, N_RECORDINGS = 1_500, 60
LONG_NAME = "A method with a rather long name, of the kind that papers like: cross-attention"
# Whose it is, its noise in per cent, its latency in ms; the last sent is the best.
METHODS: dict[str, tuple[str, float, float | None]] = {
    LONG_NAME: (OWNER, 50.0, None),
    "Optical flow expansion": (RIVAL, 36.0, 31.0),
    "Box height, smoothed": (OWNER, 28.0, 1.2),
    "Feature pyramid, two frames": (OWNER, 9.6, 12.5),
    "Dense scale matching": (RIVAL, 9.0, 41.0),
}


def populated(site: Site) -> dict[str, str]:
    """Make the board on a running site; one identifier of each kind of thing."""
    output = site.manage("shell", "-v0", "-c", "from tests.browser import world; print(world.populate())")
    return dict(json.loads(output.splitlines()[-1]))


def populate() -> str:
    """Make the board in this process' database."""
    owner, rival, maintainer = (_person(email) for email in (OWNER, RIVAL, MAINTAINER))
    maintainer.is_staff = True
    maintainer.save(update_fields=["is_staff"])
    truth = _truth()
    for name, (email, noise, latency_ms) in METHODS.items():
        person = owner if email == OWNER else rival
        sent = builders.submit(person, _file(truth, noise=noise), split=SPLIT, method=name)
        _describe(sent.method, latency_ms=latency_ms)
    secret = builders.submit(
        owner, _file(truth, noise=20.0), split=SPLIT, method="Not shown yet", visibility=Visibility.PRIVATE
    )
    builders.submit(
        rival, _file(truth, noise=14.0), split=SPLIT, method="Under review", visibility=Visibility.ANONYMOUS
    )
    gone = builders.submit(rival, _file(truth, noise=70.0), split=SPLIT, method="Given up")
    _describe(gone.method, latency_ms=None)
    broken = builders.submit(owner, b'{"0": 0}', split=SPLIT, method="Broken")
    builders.score_all()
    intake.withdraw(submission=gone, actor=rival, now=timezone.now())
    _spread_over_months()
    _quote_earlier_years()
    with transaction.atomic():
        board_versions.bump(SPLIT)
        board_versions.bump("test")
    shown = Submission.objects.get(method__name="Feature pyramid, two frames")
    second = Submission.objects.get(method__name="Dense scale matching")
    five = list(Method.objects.filter(name__in=METHODS).values_list("pk", flat=True))
    for methods in ([shown.method_id, second.method_id], five):
        comparisons.compare(
            methods=methods,
            split=Split.objects.get(pk=SPLIT),
            viewer=AnonymousUser(),
            now=timezone.now(),
        )
    comparisons.of_first(board=snapshots.board(split=Split.objects.get(pk=SPLIT), viewer=AnonymousUser()))
    editions.open_edition(split=SPLIT, protocol="toolkit")  # a correction that maintainers look at
    builders.score_all()
    readable_truths = truth_values.readable_digests()
    missing = analyses.missing(readable_truths=readable_truths).filter(edition__split=SPLIT)
    # Of other boards of the site, more may be missing than are tried in one go.
    while builders.infer_all() or missing.exists():
        pass
    _give_maintainers_something_to_do(owner, maintainer)
    return json.dumps(
        {
            "method_id": str(shown.method_id),
            "second_method_id": str(second.method_id),
            "five": "&".join(f"m={method_id}" for method_id in five),
            "private_method_id": str(secret.method_id),
            "submission_id": str(shown.pk),
            "rejected_id": str(broken.pk),
            "team_id": str(shown.method.team_id),
        }
    )


def _person(email: str) -> User:
    name = {OWNER: "Owls of the North", RIVAL: "Rivals", MAINTAINER: "Maintainer"}[email]
    user = User.objects.create_user(email, PASSWORD, name=name)
    EmailAddress.objects.create(user=user, email=email, verified=True, primary=True)
    return user


def _truth() -> evaluator.GroundTruth:
    truth = simulate(rng=np.random.default_rng(5), n_sequences=N_SEQUENCES, n_recordings=N_RECORDINGS)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "simulated.csv"
        path.write_bytes(truth.to_csv())
        ground_truth.import_truth(split_name=SPLIT, path=path, now=timezone.now())
    return truth


def _file(truth: evaluator.GroundTruth, *, noise: float) -> bytes:
    rng = np.random.default_rng(round(10 * noise))
    ttc_s = truth.ttc_s * np.exp(rng.normal(scale=noise / 100, size=truth.n_sequences))
    return evaluator.write_predictions(manifest=truth.manifest, ttc_s=ttc_s)


def _describe(method: Method, *, latency_ms: float | None) -> None:
    """What its team would say of it."""
    Method.objects.filter(pk=method.pk).update(
        description="Simulated. What it would do, in two sentences, so that the page has text.",
        paper_url="https://example.org/paper",
        code_url="https://example.org/code",
        n_frames=6 if latency_ms else None,
        box_source=BoxSource.GIVEN,
        uses_nerf=False if latency_ms else None,
        latency_ms=latency_ms,
        hardware="one GPU" if latency_ms else "",
    )


def _give_maintainers_something_to_do(owner: User, maintainer: User) -> None:
    """Something that failed by our fault, something that waits, and a team with rules of its own."""
    edition = Edition.objects.get(split=SPLIT, number=1)
    failed = queue_rows.queued(edition, owner)
    queue_rows.strike_out()
    waiting = queue_rows.queued(edition, owner, priority=Evaluation.PRIORITY_RESCORE)
    # No worker of another test is to take it.
    never = timezone.now() + timedelta(days=365)
    Evaluation.objects.filter(pk=waiting.pk).update(due_at=never)
    builders.override(
        failed.submission.method.team,
        split=edition.split_id,
        limit=9,
        window=timedelta(days=2),
        reason="Their deadline is before everybody else's.",
        actor=maintainer,
    )


def _spread_over_months() -> None:
    """As if the submissions had come one a month, so that there is a progress to be drawn."""
    opened = timezone.now() - timedelta(days=300)
    Edition.objects.filter(split=SPLIT).update(opened_at=opened, published_at=opened)
    for i, submission in enumerate(Submission.objects.filter(split=SPLIT).order_by("submitted_at"), 1):
        at = opened + timedelta(days=35 * i)
        Submission.objects.filter(pk=submission.pk).update(submitted_at=at)
        Evaluation.objects.filter(submission=submission, finished_at__isnull=False).update(finished_at=at)


def _quote_earlier_years() -> None:
    """Rows of three years on the main board: the landing page has a progress as well."""
    for years, row in enumerate(PublishedResult.objects.filter(split="test")[:2], 1):
        row.pk, row.slug, row.year = None, f"{row.slug}-before", row.year - years
        row.save(force_insert=True)
