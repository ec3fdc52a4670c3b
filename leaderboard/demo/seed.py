"""What the demo starts with: a split with simulated ground truth, three teams, and what they sent.

Everything but the demo account's password comes from one fixed seed, and goes through the same verbs as the
real thing: the files are checked and scored by whatever worker finds them in the queue.
"""

import secrets
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

import numpy as np
from allauth.account.models import EmailAddress
from django.core.files.base import ContentFile
from django.db import transaction

import evaluator
from evaluator.scale import ttc_to_scale_ratio
from leaderboard import ground_truth, methods, submissions, visibility
from leaderboard.demo.estimators import Estimator
from leaderboard.demo.truth import simulate
from leaderboard.models import Split, Submission, User, Visibility

SEED = 20230904
SPLIT = "demo"
DEMO_EMAIL = "demo@example.org"


class Occupied(Exception):
    """The split `demo` has ground truth that the seed did not make."""


@dataclass(frozen=True)
class Login:
    """The account that the demo's visitor signs in with."""

    email: str
    password: str


@dataclass(frozen=True)
class Entry:
    """One submission of the demo. Without an estimator, the file is one that has faults."""

    email: str
    team: str
    method: str
    description: str
    estimator: Estimator | None
    unit: str = "ttc"
    visibility: str = Visibility.PUBLIC
    details: Mapping[str, object] = field(default_factory=dict)


ENTRIES = (
    Entry(
        email="north@example.org",
        team="Team North",
        method="Dense scale matching",
        description="Simulated: little noise on the scale ratio, a tenth of the sequences worse.",
        estimator=Estimator(noise=9.0, recording_noise=3.0, outlier_share=0.1, outlier_factor=3.0),
        unit="scale_ratio",
        details={
            "n_frames": 6,
            "cameras": "ONE",
            "box_source": "GIVEN",
            "uses_nerf": False,
            "uses_extra_data": True,
            "pretraining": "ImageNet-1k",
            "n_parameters": 31_000_000,
            "latency_ms": 41.5,
            "hardware": "one RTX 4090",
            "paper_url": "https://example.org/dense-scale-matching",
            "code_url": "https://example.org/dense-scale-matching/code",
        },
    ),
    Entry(
        email="south@example.org",
        team="Team South",
        method="Feature pyramid, two frames",
        description="Simulated: a little more noise than the best, and none of its outliers.",
        estimator=Estimator(noise=12.0, recording_noise=5.0),
        details={
            "n_frames": 2,
            "cameras": "ONE",
            "box_source": "GIVEN",
            "uses_nerf": False,
            "uses_extra_data": False,
            "n_parameters": 4_200_000,
            "latency_ms": 6.8,
            "hardware": "one Jetson Orin",
            "code_url": "https://example.org/feature-pyramid",
        },
    ),
    Entry(
        email=DEMO_EMAIL,
        team="Demo team",
        method="Box height, smoothed",
        description="Simulated: what the ratio of two smoothed box heights would give.",
        estimator=Estimator(noise=28.0, recording_noise=8.0, outlier_share=0.02),
        details={"n_frames": 6, "cameras": "ONE", "box_source": "DETECTED", "uses_nerf": False},
    ),
    Entry(
        email="south@example.org",
        team="Team South",
        method="Optical flow expansion",
        description="Simulated: moderate noise, and now and then a match on the wrong object.",
        estimator=Estimator(noise=36.0, recording_noise=12.0, outlier_share=0.05),
        unit="scale_ratio",
        visibility=Visibility.ANONYMOUS,
        details={"n_frames": 3, "cameras": "SEVERAL", "box_source": "NONE", "uses_nerf": True},
    ),
    Entry(
        email="north@example.org",
        team="Team North",
        method="Box height, raw",
        description="Simulated: the ratio of two box heights as a detector gives them.",
        estimator=Estimator(noise=75.0, recording_noise=10.0, outlier_share=0.02),
    ),
    Entry(
        email=DEMO_EMAIL,
        team="Demo team",
        method="First try",
        description="Simulated: a file with the faults that first files have; see its page for the list.",
        estimator=None,
        visibility=Visibility.PRIVATE,
    ),
)


def seed(*, now: datetime, login_path: Path) -> Login:
    """Make whatever of the demo is missing; what is there stays. Returns the demo account.

    `login_path` keeps the password, readable by its owner only, so that it can be printed again. Raises
    `Occupied` where the split `demo` has other ground truth; nothing is submitted then.
    """
    login = _login(login_path)
    users = {entry.email: _user(entry) for entry in ENTRIES}
    _let_in(users[DEMO_EMAIL], password=login.password)
    missing = [entry for entry in ENTRIES if not _has_submitted(entry)]
    if missing or not Split.objects.get(name=SPLIT).has_ground_truth:
        truth = simulate(rng=np.random.default_rng(SEED))
        _open_split(truth, now=now)
        for entry in missing:
            _submit(entry, user=users[entry.email], truth=truth, now=now)
    return login


def _login(path: Path) -> Login:
    if not path.exists():
        path.touch(mode=0o600)
        path.write_text(secrets.token_urlsafe(9))
    return Login(email=DEMO_EMAIL, password=path.read_text().strip())


def _user(entry: Entry) -> User:
    """The account of an entry; nobody has its password."""
    return User.objects.filter(email=entry.email).first() or User.objects.create_user(
        entry.email, name=entry.team
    )


def _let_in(user: User, *, password: str) -> None:
    """Give the account this password and a proved address, once."""
    with transaction.atomic():
        EmailAddress.objects.get_or_create(
            user=user, email=user.email, defaults={"verified": True, "primary": True}
        )
        if not user.check_password(password):
            user.set_password(password)
            user.save(update_fields=["password"])


def _has_submitted(entry: Entry) -> bool:
    return Submission.objects.filter(
        split_id=SPLIT, method__name=entry.method, submitted_by__email=entry.email
    ).exists()


def _open_split(truth: evaluator.GroundTruth, *, now: datetime) -> None:
    """Make sure that the split is scored against this ground truth."""
    edition = Split.objects.select_related("published_edition").get(pk=SPLIT).published_edition
    if edition is None:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "simulated.csv"
            path.write_bytes(truth.to_csv())
            ground_truth.import_truth(split_name=SPLIT, path=path, now=now)
    elif edition.ground_truth_id != truth.digest:
        raise Occupied(
            f"The split '{SPLIT}' has the ground truth {edition.ground_truth_id}; "
            f"expected none, or the simulated one, {truth.digest}."
        )


def _submit(entry: Entry, *, user: User, truth: evaluator.GroundTruth, now: datetime) -> None:
    """Send the entry's file, and say and show of its method what the demo does: all of it, or nothing."""
    data = predictions_file(entry, truth=truth)
    with transaction.atomic():
        method = submissions.submit(
            user=user,
            split_name=SPLIT,
            method_name=entry.method,
            description=entry.description,
            upload=ContentFile(data),
            filename=f"{entry.method.lower().replace(',', '').replace(' ', '-')}.json",
            via=Submission.Via.WEB,
            now=now,
        ).submission.method
        methods.edit(method=method, changes=entry.details, actor=user)
        if entry.visibility != Visibility.PRIVATE:
            visibility.change(method=method, visibility=entry.visibility, actor=user, now=now)


def predictions_file(entry: Entry, *, truth: evaluator.GroundTruth) -> bytes:
    """The file that the entry's team sends; the same for the same truth."""
    manifest = truth.manifest
    if entry.estimator is None:
        return _file_with_faults(manifest)
    rng = np.random.default_rng([SEED, ENTRIES.index(entry)])
    ttc_s = entry.estimator.predict(truth=truth, rng=rng)
    if entry.unit == "ttc":
        return evaluator.write_predictions(manifest=manifest, ttc_s=ttc_s)
    alpha = np.round(ttc_to_scale_ratio(ttc_s, fps_hz=2), 9)
    usable = np.where(alpha > 0, alpha, 1e-9)
    return evaluator.write_predictions(keys=manifest.natural_keys, scale_ratio=usable, fps_hz=2)


def _file_with_faults(manifest: evaluator.Manifest) -> bytes:
    """A file whose sequences of the last recordings are missing, with a null and a NaN among its values."""
    values = dict.fromkeys(manifest.anno_id_keys[:-40], "10.0")
    values["17"] = "null"
    values["23"] = "NaN"
    return ("{" + ", ".join(f'"{key}": {value}' for key, value in values.items()) + "}").encode()
