"""Two worlds that are the same to everybody but the people who have something to hide in one of them.

Both have the same public methods, the same people who may look, and the same published numbers. The second
has, besides: accounts, teams and tokens that came earlier and in between, private methods with submissions in
every state, another team behind the anonymous method, and other values in the file of the ground truth.
"""

import random
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path
from typing import Any
from uuid import UUID

from django.conf import settings
from django.utils import timezone

from leaderboard.editions import ground_truth, splits
from leaderboard.methods import visibility
from leaderboard.models import (
    Edition,
    Evaluation,
    Membership,
    Method,
    Split,
    Submission,
    Team,
    User,
)
from leaderboard.people import teams, tokens
from leaderboard.storage import seeds, truth_values
from leaderboard.submissions import intake
from tests import builders
from tests.caching import forget_boards

START = datetime(2026, 3, 1, 12, 0, tzinfo=UTC)
WITH_IDS = (Team, Method, Submission, Evaluation)
# What guessing would find in the second world, and in the first one not.
HIDDEN_METHODS = tuple(UUID(int=0xA000_0000_0000_4000_8000_0000_0000_0000 + n) for n in range(8))
HIDDEN_SUBMISSIONS = tuple(UUID(int=0xB000_0000_0000_4000_8000_0000_0000_0000 + n) for n in range(8))
HIDDEN_TEAM = UUID(int=0xC000_0000_0000_4000_8000_0000_0000_0000)
submit = partial(builders.submit, visibility="PRIVATE")
PUBLIC = (
    # team, method, factor, visibility
    ("Owls", "Foo++", 1.05, "PUBLIC"),
    ("Owls", "Foo", 1.20, "PUBLIC"),
    ("Crows", "Deep Range", 1.10, "PUBLIC"),
    ("Jays", "Wide", 1.30, "PUBLIC"),
    ("Strangers", "Their own", 1.25, "PUBLIC"),
    ("Strangers", "Their secret", 1.15, "PRIVATE"),
)
# What methods say of themselves, one after the other: so that each filter lets something through.
DETAILS: tuple[dict[str, Any], ...] = (
    {
        "n_frames": 6,
        "cameras": "ONE",
        "box_source": "GIVEN",
        "uses_nerf": False,
        "uses_extra_data": False,
        "pretraining": "ImageNet",
        "n_parameters": 31_000_000,
        "latency_ms": 12.5,
        "hardware": "one GPU",
        "code_url": "https://example.org/code",
    },
    {"n_frames": 2, "cameras": "SEVERAL", "box_source": "NONE", "uses_nerf": True, "uses_extra_data": True},
    {"box_source": "DETECTED", "n_parameters": 400_000, "pretraining": "none", "paper_url": "https://a.org"},
)


@dataclass
class Scene:
    """What is there to be looked at; the same in both worlds."""

    stranger: User
    methods: list[UUID] = field(default_factory=list)
    submissions: list[UUID] = field(default_factory=list)
    teams: list[UUID] = field(default_factory=list)


@contextmanager
def ids_from(seed: str) -> Iterator[None]:
    """Let what is made meanwhile have ids that another world's can be equal to."""
    rng = random.Random(seed)
    fields = [model._meta.get_field("id") for model in WITH_IDS]
    for each in fields:
        each.__dict__["_get_default"] = lambda: UUID(int=rng.getrandbits(128), version=4)
    try:
        yield
    finally:
        for each in fields:
            del each.__dict__["_get_default"]


def build(directory: Path, *, has_secrets: bool) -> Scene:
    directory.mkdir()
    settings.GROUND_TRUTH_DIR = directory / "ground-truth"
    # The random numbers of hidden splits come from it: what differs by chance alone is not to differ.
    settings.GROUND_TRUTH_DIR.mkdir()
    seeds.path().write_text("0" * 2 * seeds.N_BYTES)
    settings.FILES_DIR = directory / "files"
    truth_values.load.cache_clear()
    splits.ensure_splits()
    Split.objects.update(quota_limit=None, quota_min_gap=timedelta(0), quota_rejected_limit=None)
    path = builders.truth_csv(directory / "truth.csv")
    edition = ground_truth.import_truth(split_name="test", path=path, now=START)
    secrets = Secrets(edition) if has_secrets else None
    people = {}
    for number, team in enumerate(("Owls", "Crows", "Jays", "Strangers")):
        if secrets:
            secrets.someone_comes()
        with ids_from(f"team {number}"):
            people[team] = User.objects.create_user(f"{team}@example.org", "correct horse", name=team)
            teams.team_of(user=people[team])
    scene = Scene(stranger=people["Strangers"], teams=[people[name].membership.team_id for name in people])
    for number, (team, method, factor, shown) in enumerate(PUBLIC):
        if secrets:
            secrets.something_is_tried(people["Owls"], number)
        with ids_from(f"method {number}"):
            _enter(scene, people[team], method, factor, shown, edition=edition, number=number)
    with ids_from("anonymous"):
        larks = _larks(has_secrets=has_secrets)
        name = "Very Secret Net" if has_secrets else "Larknet"
        _enter(scene, larks, name, 1.18, "ANONYMOUS", edition=edition, number=9)
    builders.infer_all()
    if secrets:
        secrets.something_waits(people["Crows"])
        _change_the_values(edition, directory)
    _settle(scene, edition)
    return scene


def _larks(*, has_secrets: bool) -> User:
    """The user behind the anonymous method: another one in each world."""
    name = "Hidden Larks" if has_secrets else "Larks"
    user = User.objects.create_user(f"{name.replace(' ', '')}@example.org", "correct horse", name=name)
    teams.team_of(user=user)
    return user


def _enter(
    scene: Scene, user: User, name: str, factor: float, shown: str, *, edition: Edition, number: int
) -> None:
    """One method with one scored submission."""
    now = START + timedelta(days=1 + number)
    sent = submit(user, builders.predictions(edition, factor=factor), method=name, now=now)
    builders.score_all()
    if shown != "PRIVATE":
        visibility.change(method=sent.method, visibility=shown, actor=user, now=now + timedelta(hours=1))
    scene.methods.append(sent.method_id)
    scene.submissions.append(sent.pk)
    Method.objects.filter(pk=sent.method_id).update(**DETAILS[number % len(DETAILS)])
    if shown == "ANONYMOUS":
        # What an anonymous method says of itself beyond choices and numbers is nobody's business either.
        Method.objects.filter(pk=sent.method_id).update(
            description=f"By {user.name}.",
            pretraining=f"{user.name}'s corpus",
            hardware=f"{user.name}'s GPU",
            paper_url=f"https://{user.pk}.example.org/",
        )


class Secrets:
    """What happens in the second world alone."""

    def __init__(self, edition: Edition) -> None:
        self._edition = edition
        self._n = 0

    def someone_comes(self) -> User:
        """Sign a user up, in a team of their own, with a token."""
        self._n += 1
        user = User.objects.create_user(
            f"secret{self._n}@example.org", "correct horse", name=f"Secret {self._n}"
        )
        team = teams.team_of(user=user)
        if self._n == 1:
            Membership.objects.filter(team=team).delete()
            team.delete()
            team = Team.objects.create(pk=HIDDEN_TEAM, name="Secret Agency", look="secret agency")
            Membership.objects.create(team=team, user=user, is_owner=True)
        tokens.create(user=user, name="secret", now=timezone.now())
        return user

    def something_is_tried(self, insider: User, number: int) -> None:
        """A private method, of a secret team or of one with public ones: scored, rejected, withdrawn."""
        user = self.someone_comes() if number % 2 else insider
        now = START + timedelta(days=1 + number, hours=-3)
        good = builders.predictions(self._edition, factor=1.01 + number / 100)
        made = self._kept(submit(user, good, method=f"Secret Method {number}", now=now), number)
        details = DETAILS[number % len(DETAILS)] | {"pretraining": "Secret corpus", "hardware": "Secret GPU"}
        Method.objects.filter(pk=made.method_id).update(**details)
        submit(user, b"{}" + b" " * number, method=f"Secret Method {number}", now=now)
        builders.score_all()
        if number == 2:
            intake.withdraw(submission=made, actor=user, now=now + timedelta(hours=1))

    def something_waits(self, insider: User) -> None:
        """What is not scored yet."""
        good = builders.predictions(self._edition, factor=1.4)
        now = START + timedelta(days=20)
        self._kept(submit(insider, good, method="Secret and waiting", now=now), 7)

    def _kept(self, made: Submission, number: int) -> Submission:
        """Give a submission and its method ids that a person may guess."""
        if HIDDEN_SUBMISSIONS[number] not in _ids(Submission):
            made = _renamed(made, HIDDEN_SUBMISSIONS[number])
        if HIDDEN_METHODS[number] not in _ids(Method):
            method = made.method
            old, method.pk = method.pk, HIDDEN_METHODS[number]
            method.name, name = f"{method.name} (moved)", method.name
            method.save(force_insert=True)
            Submission.objects.filter(method=old).update(method=method)
            Method.objects.filter(pk=old).delete()
            Method.objects.filter(pk=method.pk).update(name=name)
            made.refresh_from_db()
        return made


def _ids(model: type[Submission] | type[Method]) -> set[UUID]:
    return set(model._default_manager.values_list("pk", flat=True))


def _renamed(made: Submission, pk: uuid.UUID) -> Submission:
    old = made.pk
    copy = Submission.objects.get(pk=old)
    copy.pk = pk
    Submission.objects.filter(pk=old).update(digest="moved")
    copy.save(force_insert=True)
    Evaluation.objects.filter(submission=old).update(submission=copy)
    Submission.objects.filter(pk=old).delete()
    return copy


def _change_the_values(edition: Edition, directory: Path) -> None:
    """Other hidden values than those that were scored against: what reads them now would show it."""
    other = builders.truth_csv(directory / "other.csv", seed=1)
    values = truth_values.values_path(edition.ground_truth_id)
    values.write_bytes(other.read_bytes())
    truth_values.load.cache_clear()


def _settle(scene: Scene, edition: Edition) -> None:
    """Give what the database's clock wrote the same times in both worlds, and forget every copy."""
    for number, pk in enumerate(scene.submissions):
        at = START + timedelta(days=1 + number, minutes=1)
        times = dict.fromkeys(("queued_at", "due_at", "started_at", "finished_at"), at)
        Evaluation.objects.filter(submission=pk).update(**times)
    Team.objects.filter(pk__in=scene.teams).update(created_at=START)
    Membership.objects.filter(team__in=scene.teams).update(joined_at=START)
    User.objects.filter(membership__team__in=scene.teams).update(date_joined=START)
    Edition.objects.update(inferred_at=START + timedelta(days=12))
    forget_boards()
