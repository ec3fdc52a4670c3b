"""A small scene that all verbs which take locks can be done in: people, methods, submissions, editions."""

import uuid
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path

from django.db import connection
from django.utils import timezone

from leaderboard.models import (
    ApiToken,
    Edition,
    Evaluation,
    GroundTruth,
    Membership,
    Method,
    Score,
    Submission,
    Team,
    User,
    Visibility,
)
from leaderboard.models.submissions import SentFile
from leaderboard.people import invitations, tokens
from leaderboard.people.names import skeleton

DAY = timedelta(days=1)
# What a scene adds to the world.
_SWEPT = (
    *("score", "analysis", "comparison", "truthcomparison", "evaluation"),
    *("submission", "publication", "apitoken", "invitation", "quotaoverride", "method", "membership"),
    *("admission", "team", "boardversion", "mail"),
)


@dataclass(frozen=True)
class World:
    """What stays from scene to scene: a board with two entries, and the maintainer."""

    edition: Edition
    files: Sequence[SentFile]  # whose sums per recording are kept
    correction: GroundTruth  # with its values, and no edition
    maintainer: User
    folder: Path


@dataclass(frozen=True)
class Scene:
    """People, methods and submissions that every verb of a round is about."""

    world: World
    team: Team
    owner: User
    member: User
    loner: User  # alone in a team
    newcomer: User  # in no team; another account of the loner's mailbox
    public: Method
    private: Method
    sent: Submission  # queued in both editions
    failed: Evaluation  # by our fault
    prepared: Edition  # beside the board
    truth: GroundTruth  # without an edition
    secret: str  # of an invitation
    token: ApiToken


def scene(world: World) -> Scene:
    """A new scene; nothing of the one before is left."""
    _sweep(world)
    now, split = timezone.now(), world.edition.split_id
    owner, member, loner, newcomer, reader = User.objects.bulk_create(
        User(email=f"{address}@example.org") for address in _addresses()
    )
    team, alone = (
        Team(name=f"Team {mark}", look=skeleton(f"Team {mark}"))
        for mark in (uuid.uuid4().hex, uuid.uuid4().hex)
    )
    Team.objects.bulk_create([team, alone])
    Membership.objects.bulk_create(
        [
            Membership(team=team, user=owner, is_owner=True),
            Membership(team=team, user=member),
            Membership(team=team, user=reader),
            Membership(team=alone, user=loner, is_owner=True),
        ]
    )
    public, private, hers = (
        Method(team=team, name="Public", visibility=Visibility.PUBLIC, shown_at=now),
        Method(team=team, name="Private"),
        Method(team=alone, name="Public"),
    )
    due = Method(team=team, name="Due", visibility=Visibility.ANONYMOUS, shown_at=now, reveal_at=now - DAY)
    Method.objects.bulk_create([public, private, hers, due])
    row = {"split_id": split, "submitted_by": owner, "via": "API", "size_bytes": 2, "submitted_at": now}
    sent, lost, scored, his, revealed = (
        Submission(method=method, **file._asdict(), **row)
        for method, file in zip((public, public, public, hers, due), world.files, strict=True)
    )
    Submission.objects.bulk_create([sent, lost, scored, his, revealed])
    truth = _truth_like(world)
    prepared = Edition.objects.create(
        split_id=split, number=2, ground_truth=world.correction, protocol=world.edition.protocol
    )
    failed = Evaluation(submission=lost, edition=world.edition, status="SYSTEM_ERROR", finished_at=now)
    Evaluation.objects.bulk_create(
        [
            failed,
            *(Evaluation(submission=row, edition=world.edition) for row in (sent, his)),
            *(
                Evaluation(submission=row, edition=prepared, priority=Evaluation.PRIORITY_RESCORE)
                for row in (sent, lost, scored)
            ),
        ]
    )
    decided = Evaluation(
        submission=scored, edition=world.edition, status="SCORED", finished_at=now, finished_attempt=0
    )
    decided.save()
    # No interval of this entry: whoever makes intervals changes it.
    Score.objects.create(
        evaluation=decided, metric="mid", interval="overall", value=12.5, low=12.0, high=13.0
    )
    _, secret = invitations.make(team=team, actor=owner, now=now)
    tokens.create(user=owner, name="CI", now=now)
    return Scene(
        world=world,
        team=team,
        owner=owner,
        member=member,
        loner=loner,
        newcomer=newcomer,
        public=public,
        private=private,
        sent=sent,
        failed=failed,
        prepared=prepared,
        truth=truth,
        secret=secret,
        token=ApiToken.objects.get(user=owner),
    )


def _addresses() -> list[str]:
    """Of five accounts, of which the third and the fourth have one mailbox."""
    found = [str(uuid.uuid4()) for _ in range(5)]
    found[3] = f"{found[2]}+second"
    return found


def _sweep(world: World) -> None:
    """Leave nothing but the world. The foreign keys are checked at the end, so the order is free."""
    edition, split, first = world.edition.pk, world.edition.split_id, world.edition.ground_truth_id
    statements = [f"DELETE FROM leaderboard_{table}" for table in _SWEPT]
    statements += [
        f"UPDATE leaderboard_split SET published_edition_id = {edition} WHERE name = '{split}'",
        f"DELETE FROM leaderboard_edition WHERE id <> {edition}",
        f"UPDATE leaderboard_edition SET inference_digest = '' WHERE id = {edition}",
        f"DELETE FROM leaderboard_groundtruth WHERE digest NOT IN ('{first}', '{world.correction.pk}')",
    ]
    with connection.cursor() as cursor:
        cursor.execute("; ".join(["BEGIN", *statements, "COMMIT"]))


def _truth_like(world: World) -> GroundTruth:
    """Another ground truth by its row; nothing is scored against it here."""
    row = GroundTruth.objects.get(pk=world.edition.ground_truth_id)
    row.digest = f"sha256:{uuid.uuid4().hex}{uuid.uuid4().hex}"
    row.save(force_insert=True)
    return row
