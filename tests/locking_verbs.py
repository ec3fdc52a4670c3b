"""Every verb that takes locks, ready to be done once in a scene that all of them share."""

import uuid
from collections.abc import Callable, Mapping
from functools import partial
from itertools import combinations
from typing import Any

import numpy as np
from allauth.account.models import EmailAddress
from django.contrib.auth.models import AnonymousUser
from django.core.files.base import ContentFile
from django.db import transaction
from django.utils import timezone

from evaluator.metrics.protocol import SCORE_NAMES
from leaderboard import versions
from leaderboard.db import clock
from leaderboard.editions import corrections, ground_truth
from leaderboard.methods import methods, visibility
from leaderboard.models import (
    Admission,
    Edition,
    Evaluation,
    Invitation,
    Method,
    QuotaOverride,
    Split,
    Submission,
    Team,
    User,
)
from leaderboard.people import invitations, teams, tokens
from leaderboard.quotas import admissions, quotas
from leaderboard.scoring import comparisons, confidence, lifecycle, questions, recording_sums
from leaderboard.storage import files, orphans, truth_values
from leaderboard.submissions import empty_methods, submissions
from tests import builders, moderation_verbs
from tests.leaderboard.web.maintain import queue_rows
from tests.locking_scene import DAY, Scene

Deed = Callable[[], object]


def _submission(scene: Scene, user: User) -> Callable[[], submissions.Submitted]:
    name = "Public" if user == scene.owner else "New"
    return partial(
        submissions.submit,
        user=user,
        split_name=scene.world.edition.split_id,
        method_name=name,
        upload=ContentFile(uuid.uuid4().bytes, name="p.json"),
        via=Submission.Via.API,
        now=timezone.now(),
        description="What it is." if user == scene.owner else "",
    )


def _first_submission(scene: Scene) -> Deed:
    """Of somebody whose team is founded with it."""
    return _submission(scene, scene.newcomer)


def _leases(n: int) -> list[lifecycle.Lease]:
    """Of what is most urgent, whoever has claimed it."""
    lifecycle.claim(lease_s=60, wall_s=300, limit=n)
    rows = Evaluation.objects.filter(status="RUNNING").order_by("priority", "pk")
    return [lifecycle.Lease(row.pk, row.attempt, row.lease_token) for row in rows[:n] if row.lease_token]


def _finalise(scene: Scene, *, n: int) -> Deed:
    return partial(lifecycle.finalise_many, [(lease, queue_rows.SCORED) for lease in _leases(n)])


def _give_back(scene: Scene) -> Deed:
    [lease] = _leases(1)
    Evaluation.objects.filter(pk=lease.evaluation_id).update(n_poison_strikes=2)
    return partial(queue_rows.give_back, lease, lifecycle.Strike.POISON)


def _hand_back(scene: Scene) -> Deed:
    return partial(lifecycle.release, _leases(9))


def _release(scene: Scene) -> Deed:
    for lease in _leases(9):
        queue_rows.expire(lease)
    Evaluation.objects.update(n_infrastructure_strikes=9)
    return queue_rows.release_expired


def _infer(scene: Scene) -> Deed:
    edition = _with_sums(scene)
    return lambda: confidence.infer(confidence.Entries.of(edition), now=timezone.now())


def _with_sums(scene: Scene) -> Edition:
    edition = Edition.objects.select_related("ground_truth").get(pk=scene.world.edition.pk)
    for submission in Submission.objects.all():
        # The files of the scene are names alone; what inference reads of them is here.
        sums = recording_sums.path(edition, file=submission.sent_file)
        sums.parent.mkdir(parents=True, exist_ok=True)
        sums.write_bytes(np.ones((edition.ground_truth.n_recordings, len(SCORE_NAMES))).tobytes())
    return edition


def _ask(scene: Scene, *, who: str) -> Deed:
    # Of the team: what the loner has is deleted for another verb.
    theirs = Evaluation.objects.filter(edition=scene.world.edition, submission__method__team=scene.team)
    ids = theirs.order_by("pk").values_list("pk", flat=True)
    pairs = list(combinations(ids, 2))
    return partial(
        questions.ask,
        edition=scene.world.edition,
        pairs=pairs,
        user=AnonymousUser(),
        address=who,
        now=timezone.now(),
    )


def _compare(scene: Scene) -> Deed:
    _with_sums(scene)
    waiting = questions.waiting(held=truth_values.readable_digests())
    if not waiting.exists():
        _ask(scene, who="192.0.2.1")()
    return partial(comparisons.compute, waiting.all()[0], now=timezone.now())


def _clean(scene: Scene) -> Deed:
    """A file that is gone already: it takes the same locks, and leaves no trace."""
    digest, now = f"sha256:{uuid.uuid4().hex}{uuid.uuid4().hex}", timezone.now()
    orphan = orphans.Orphan(files.predictions_name(digest), digest, 1, now - 2 * DAY)
    return partial(orphans.remove, orphan, now=now)


def _by_maintainer(scene: Scene) -> dict[str, Any]:
    return {"actor": scene.world.maintainer, "now": timezone.now()}


def _publish(scene: Scene) -> Deed:
    return partial(
        corrections.publish,
        edition=scene.prepared,
        reason="Corrected.",
        replaces=1,
        leave_out=True,
        **_by_maintainer(scene),
    )


def _roll_back(scene: Scene) -> Deed:
    if not scene.prepared.publications.exists():
        _publish(scene)()
    split = scene.world.edition.split_id
    return partial(
        corrections.roll_back, split_name=split, reason="Wrong.", replaces=2, **_by_maintainer(scene)
    )


def _discard(scene: Scene) -> Deed:
    return partial(corrections.discard, edition=scene.prepared, reason="Wrong.", **_by_maintainer(scene))


def _open(scene: Scene) -> Deed:
    split, digest = scene.world.edition.split_id, scene.truth.pk
    return partial(corrections.open_edition, split_name=split, digest=digest, **_by_maintainer(scene))


def _import(scene: Scene) -> Deed:
    split = scene.world.edition.split_id
    path = builders.truth_csv(scene.world.folder / "truth.csv", n=40, n_recordings=10, seed=1)
    return partial(ground_truth.add, split_name=split, path=path, **_by_maintainer(scene))


def _override(scene: Scene, team: Team) -> Deed:
    return partial(builders.override, team, **_by_maintainer(scene))


def _end_override(scene: Scene) -> Deed:
    if not scene.team.quota_overrides.exists():
        _override(scene, scene.team)()
    row = QuotaOverride.objects.get(team=scene.team)
    return partial(quotas.end_override, row=row, actor=scene.world.maintainer)


def _admit(scene: Scene, team: Team) -> Deed:
    split = scene.world.edition.split
    return partial(admissions.admit, team=team, split=split, reason="A study.", **_by_maintainer(scene))


def _end_admission(scene: Scene) -> Deed:
    if not scene.team.admissions.exists():
        _admit(scene, scene.team)()
    row = Admission.objects.get(team=scene.team)
    return partial(admissions.end, row=row, reason="Left.", actor=scene.world.maintainer)


def _token(scene: Scene) -> Deed:
    split = scene.world.edition.split_id
    return partial(tokens.create, user=scene.owner, name="CI", now=timezone.now(), split_name=split)


def _leave_alone(scene: Scene) -> Deed:
    """The last one goes, and the team with them."""
    Evaluation.objects.filter(submission__method__team=_alone(scene)).delete()
    Submission.objects.filter(method__team=_alone(scene)).delete()
    Method.objects.filter(team=_alone(scene)).delete()
    return partial(teams.leave, user=scene.loner)


def _alone(scene: Scene) -> Team:
    return Team.objects.get(memberships__user=scene.loner)


def _remove(scene: Scene) -> Deed:
    return partial(teams.remove, team=scene.team, member=_reader(scene), actor=scene.owner)


def _reader(scene: Scene) -> User:
    """The member of the team with nothing else to do."""
    return User.objects.filter(membership__team=scene.team).latest("pk")


def _accept(scene: Scene, user: User) -> Deed:
    return partial(invitations.accept, secret=scene.secret, user=user, now=timezone.now())


def _revoke_invitation(scene: Scene) -> Deed:
    row = Invitation.objects.get(team=scene.team)
    return partial(invitations.revoke, invitation=row, actor=scene.owner, now=timezone.now())


def _show(scene: Scene) -> Deed:
    return partial(
        visibility.change, method=scene.private, visibility="PUBLIC", actor=scene.owner, now=timezone.now()
    )


def _edit(scene: Scene, method: Method, changes: Mapping[str, str]) -> Deed:
    return partial(methods.edit, method=method, changes=changes, actor=scene.owner)


def _other_address(scene: Scene) -> Deed:
    """Somebody chooses another e-mail address, which is a key of their row."""
    address = EmailAddress.objects.create(
        user=scene.owner, email=f"{uuid.uuid4()}@example.org", verified=True
    )

    def change() -> None:
        with transaction.atomic():
            address.set_as_primary()

    return change


def _times_passed(scene: Scene) -> Deed:
    Split.objects.filter(pk=scene.world.edition.split_id).update(opens_at=timezone.now() - DAY)
    return partial(versions.times_passed, now=clock.database_now())


def _delete_method(scene: Scene) -> Deed:
    """Of a method that a rejected file made."""
    now, edition = timezone.now(), scene.world.edition
    method = Method.objects.create(team=scene.team, name=uuid.uuid4().hex)
    sent = Submission.objects.create(
        split=edition.split,
        method=method,
        submitted_by=scene.owner,
        via=Submission.Via.WEB,
        digest=f"sha256:{uuid.uuid4().hex}",
        manifest_digest=edition.ground_truth.manifest_digest,
        size_bytes=1,
    )
    Evaluation.objects.create(
        submission=sent, edition=edition, status="REJECTED", finished_at=now, finished_attempt=0
    )
    return partial(empty_methods.delete, method=method, actor=scene.owner, now=now)


VERBS: Mapping[str, Callable[[Scene], Deed]] = {
    "submit": lambda scene: _submission(scene, scene.owner),
    "submit for the first time": _first_submission,
    "withdraw": lambda scene: partial(
        submissions.withdraw, submission=scene.sent, actor=scene.owner, now=timezone.now()
    ),
    "claim": lambda scene: partial(lifecycle.claim, lease_s=60, wall_s=300, limit=9),
    "finalise": partial(_finalise, n=1),
    "finalise a batch": partial(_finalise, n=9),
    "strike": _give_back,
    "hand back": _hand_back,
    "release expired": _release,
    "retry": lambda scene: partial(
        lifecycle.retry, evaluation=scene.failed, actor=scene.world.maintainer, reason="Mended."
    ),
    "infer": _infer,
    "ask for comparisons": lambda scene: _ask(scene, who="192.0.2.2"),
    "compare": _compare,
    "clean": _clean,
    "import a ground truth": _import,
    "open an edition": _open,
    "publish": _publish,
    "roll back": _roll_back,
    "discard": _discard,
    "times passed": _times_passed,
    "override a quota": lambda scene: _override(scene, scene.team),
    "override a loner's quota": lambda scene: _override(scene, _alone(scene)),
    "end an override": _end_override,
    "admit a loner": lambda scene: _admit(scene, _alone(scene)),
    "end an admission": _end_admission,
    "make a token": _token,
    "revoke a token": lambda scene: partial(
        tokens.revoke, token=scene.token, now=timezone.now(), actor=scene.owner
    ),
    "change an address": _other_address,
    "found a team": lambda scene: partial(
        teams.create, user=scene.newcomer, name=uuid.uuid4().hex, now=timezone.now()
    ),
    "rename the team": lambda scene: partial(
        teams.rename, team=scene.team, name=uuid.uuid4().hex, actor=scene.owner, now=timezone.now()
    ),
    "leave": lambda scene: partial(teams.leave, user=scene.member),
    "leave alone": _leave_alone,
    "remove a member": _remove,
    "hand over": lambda scene: partial(teams.hand_over, team=scene.team, to=scene.member, actor=scene.owner),
    "appoint": lambda scene: partial(
        teams.appoint, team=scene.team, to=scene.member, reason="Gone.", actor=None
    ),
    "invite": lambda scene: partial(invitations.make, team=scene.team, actor=scene.owner, now=timezone.now()),
    "revoke an invitation": _revoke_invitation,
    "join": lambda scene: _accept(scene, scene.newcomer),
    "join with methods": lambda scene: _accept(scene, scene.loner),
    "show a method": _show,
    "reveal": lambda scene: partial(visibility.reveal_due, now=timezone.now()),
    "edit a method": lambda scene: _edit(scene, scene.public, {"description": uuid.uuid4().hex}),
    "delete a method": _delete_method,
    "rename a method": lambda scene: _edit(scene, scene.private, {"name": uuid.uuid4().hex}),
    **moderation_verbs.VERBS,
}
