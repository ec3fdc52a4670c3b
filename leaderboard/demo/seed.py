"""Seed the demo: a split with simulated ground truth, three teams, and their submissions.

All but the password comes from one fixed seed and goes through the functions that the site uses.
"""

import secrets
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

from allauth.account.models import EmailAddress
from django.core.files.base import ContentFile
from django.db import transaction

import evaluator
from leaderboard.demo.runs import FRAMES, Run, demo_split, get_run
from leaderboard.editions import ground_truth
from leaderboard.errors.refusals import Refused
from leaderboard.methods import editing, visibility
from leaderboard.models import Split, Submission, User, Visibility
from leaderboard.people import teams
from leaderboard.submissions import intake

SPLIT = "demo"
DEMO_EMAIL = "demo@example.org"
MAINTAINER_EMAIL = "maintainer@example.org"

TEAMS = {
    "Demo team": DEMO_EMAIL,
    "Baselines on boxes": "boxes@example.org",
    "Baselines on pixels": "pixels@example.org",
}
"""Each team with the address of its one account."""
_PERSON = "Robin Larsen"
_PAPER = "https://arxiv.org/abs/2309.01539"
_RENDERED = (
    "The frames are rendered, not filmed. Rendered vehicles are flat and do not turn or reflect light. "
    "So methods that compare brightness score better here than on real images."
)


@dataclass(frozen=True)
class DemoEntry:
    """A submission of the demo; without a run, its file has faults."""

    team: str
    method: str
    description: str
    run: Run | None
    visibility: str = Visibility.PUBLIC
    details: Mapping[str, object] = field(default_factory=dict)

    @property
    def email(self) -> str:
        return TEAMS[self.team]

    @property
    def full_description(self) -> str:
        if self.run is None:
            return self.description
        return f"{self.description} {_RENDERED}\n\nCommands:\n\n```\n{FRAMES}\n{self.run.command}\n```"


def _measured(n_frames: int, **others: object) -> Mapping[str, object]:
    return {
        "cameras": "ONE",
        "box_source": "GIVEN",
        "uses_nerf": False,
        "uses_extra_data": False,
        "hardware": "one shared CPU core",
        "n_frames": n_frames,
        **others,
    }


ENTRIES = (
    DemoEntry(
        team="Baselines on boxes",
        method="Detection, box area",
        description=(
            "The ratio of the areas of the two boxes, taken as the scale ratio: the rule behind the "
            "published row. Areas grow with the square of the scale, so times to contact are half as long."
        ),
        run=get_run("detection-area"),
        details=_measured(2, latency_ms=0.1, paper_url=_PAPER),
    ),
    DemoEntry(
        team="Baselines on boxes",
        method="Detection, root of the area",
        description="The root of the ratio of the areas of the two boxes.",
        run=get_run("detection-sqrt-area"),
        visibility=Visibility.ANONYMOUS,
        details=_measured(2, latency_ms=0.1),
    ),
    DemoEntry(
        team="Demo team",
        method="Detection, box height",
        description="The ratio of the heights of the two boxes.",
        run=get_run("detection-height"),
        details=_measured(2, latency_ms=0.1),
    ),
    DemoEntry(
        team="Baselines on pixels",
        method="Pixel MSE, as in the paper",
        description="The scale at which the reference frame looks most like the target, as in the paper.",
        run=get_run("pixel-mse"),
        details=_measured(2, latency_ms=5.7, paper_url=_PAPER),
    ),
    DemoEntry(
        team="Baselines on pixels",
        method="Pixel MSE, as in the toolkit",
        description=(
            "What the dataset's toolkit computes under this name: it scales the target instead, by the "
            "nearest pixel, and its reference patch is off centre where the object moves away."
        ),
        run=get_run("pixel-mse-toolkit"),
        details=_measured(2, paper_url=_PAPER),
    ),
    DemoEntry(
        team="Baselines on pixels",
        method="SOT, median flow",
        description=(
            "The target box is followed back to the reference frame by median flow; the paper follows it "
            "with OSTrack and takes the ratio of the areas."
        ),
        run=get_run("tracking"),
        details=_measured(6, paper_url=_PAPER),
    ),
    DemoEntry(
        team="Baselines on pixels",
        method="Photometric alignment",
        description=(
            "Scale, shift, gain and offset under which the reference frame shows the target: a baseline of "
            "this project, not of the paper."
        ),
        run=get_run("alignment"),
        details=_measured(2, latency_ms=15.4),
    ),
    DemoEntry(
        team="Baselines on pixels",
        method="Deep Scale features, own fit",
        description=(
            "We use the features of the paper's network, but our own fit instead of the paper's estimator. "
            "The weights come with this project and were trained on other rendered sequences, and on nothing "
            "else: expect larger errors on real footage."
        ),
        run=get_run("deep-scale"),
        details=_measured(2, latency_ms=150, n_parameters=83_832, paper_url=_PAPER),
    ),
    DemoEntry(
        team="Baselines on pixels",
        method="Deep Scale, our weights",
        description=(
            "The paper's network with its own output layer (the head). The weights come from this project. "
            "They were trained on other rendered sequences, and on nothing else."
        ),
        run=get_run("deep-scale-head"),
        details=_measured(2, n_parameters=83_832, paper_url=_PAPER),
    ),
    DemoEntry(
        team="Demo team",
        method="First try",
        description="A file with the faults that first files have; see its page for the list.",
        run=None,
        visibility=Visibility.PRIVATE,
    ),
)


def seed(*, now: datetime, password_path: Path) -> str:
    """Make what is missing of the demo. Returns the password of its two accounts, kept at `password_path`.

    Raises `Refused` where the split `demo` has other ground truth.
    """
    if not password_path.exists():
        password_path.touch(mode=0o600)
        password_path.write_text(secrets.token_urlsafe(9))
    password = password_path.read_text().strip()
    users = {entry.email: _user(entry, now=now) for entry in ENTRIES}
    _create_account(users[DEMO_EMAIL], password=password)
    maintainer, _ = User.objects.get_or_create(
        email=MAINTAINER_EMAIL, defaults={"name": "Maintainer", "is_staff": True}
    )
    _create_account(maintainer, password=password)
    sent = Submission.objects.filter(split_id=SPLIT).values_list("method__name", "submitted_by__email")
    missing = [entry for entry in ENTRIES if (entry.method, entry.email) not in sent]
    if missing or not Split.objects.get(name=SPLIT).has_ground_truth:
        truth = demo_split().truth
        _open_split(truth, now=now)
        for entry in missing:
            _submit(entry, user=users[entry.email], truth=truth, now=now)
    return password


def _user(entry: DemoEntry, *, now: datetime) -> User:
    user = User.objects.filter(email=entry.email).first()
    if user is None:
        user = User.objects.create_user(entry.email, name=_PERSON)
        teams.create(user=user, name=entry.team, now=now)
    return user


def _create_account(user: User, *, password: str) -> None:
    with transaction.atomic():
        EmailAddress.objects.get_or_create(
            user=user, email=user.email, defaults={"verified": True, "primary": True}
        )
        if not user.check_password(password):
            user.set_password(password)
            user.save(update_fields=["password"])


def _open_split(truth: evaluator.GroundTruth, *, now: datetime) -> None:
    edition = Split.objects.select_related("current_edition").get(pk=SPLIT).current_edition
    if edition is None:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "simulated.csv"
            path.write_bytes(truth.to_csv())
            ground_truth.import_truth(split_name=SPLIT, path=path, now=now)
    elif edition.ground_truth_id != truth.digest:
        raise Refused(
            "edition-refused",
            f"The split '{SPLIT}' has the ground truth {edition.ground_truth_id}; "
            f"expected none, or the simulated one, {truth.digest}. "
            "A demo of an earlier release has another one; move its folder var/ away to start anew.",
        )


def _submit(entry: DemoEntry, *, user: User, truth: evaluator.GroundTruth, now: datetime) -> None:
    """Send the entry's file, and edit and show its method: all or nothing."""
    data = predictions_file(entry, truth=truth)
    with transaction.atomic():
        request = intake.SubmissionRequest(
            user=user,
            split_name=SPLIT,
            method_name=entry.method,
            details={"description": entry.full_description},
            upload=ContentFile(data),
            filename=f"{entry.method.lower().replace(',', '').replace(' ', '-')}.json",
            via=Submission.Via.WEB,
            now=now,
        )
        method = intake.submit(request).submission.method
        editing.edit(method=method, changes=entry.details, actor=user)
        if entry.visibility != Visibility.PRIVATE:
            visibility.change(method=method, visibility=entry.visibility, actor=user, now=now)


def predictions_file(entry: DemoEntry, *, truth: evaluator.GroundTruth) -> bytes:
    """Make the file that the entry's team sends."""
    manifest = truth.manifest
    if entry.run is None:
        return _file_with_faults(manifest)
    return evaluator.write_predictions(
        manifest=manifest,
        scale_ratio=entry.run.kept(),
        frame_gap=5,
        meta={"method": entry.run.method, "parameters": dict(entry.run.parameters), "frames": FRAMES},
    )


def _file_with_faults(manifest: evaluator.Manifest) -> bytes:
    values = dict.fromkeys(manifest.anno_id_keys[:-40], "10.0")
    values["17"] = "null"
    values["23"] = "NaN"
    return ("{" + ", ".join(f'"{key}": {value}' for key, value in values.items()) + "}").encode()
