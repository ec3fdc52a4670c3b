"""The verbs of maintainers that take locks on what belongs to others, ready to be done in a shared scene."""

import uuid
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from django.utils import timezone

from leaderboard.benchmark import policy, splits
from leaderboard.mails import announcements
from leaderboard.models import Split, Team
from leaderboard.submissions import forgetting, moderation
from tests.editions import paper
from tests.locking_scene import Scene

Deed = Callable[[], object]


def _told(scene: Scene) -> dict[str, Any]:
    return {"actor": scene.world.maintainer, "reason": "Asked for."}


def _timed(scene: Scene) -> dict[str, Any]:
    return {**_told(scene), "now": timezone.now()}


def _move(scene: Scene) -> Deed:
    to = Team.objects.get(memberships__user=scene.loner)
    return partial(moderation.move_method, method=scene.private, to=to, **_told(scene))


def _withdraw(scene: Scene, *, is_hidden: bool) -> Deed:
    return partial(moderation.withdraw_entry, submission=scene.sent, is_hidden=is_hidden, **_timed(scene))


def _change_split(scene: Scene) -> Deed:
    split = Split.objects.get(pk=scene.world.edition.split_id)
    wanted = replace(policy.policy_of(split), description=uuid.uuid4().hex)
    return partial(policy.change, split_name=split.pk, policy=wanted, actor=scene.world.maintainer)


def _mail(scene: Scene) -> Deed:
    split = Split.objects.get(pk=scene.world.edition.split_id)
    announcement = announcements.written(split=split, subject=uuid.uuid4().hex, text="T")
    return partial(announcements.announce, announcement, now=timezone.now(), actor=scene.world.maintainer)


def _quote(scene: Scene) -> Deed:
    document = paper(f"p-{uuid.uuid4().hex}", split=scene.world.edition.split_id)
    return partial(
        splits.import_published, document=document, now=timezone.now(), actor=scene.world.maintainer
    )


VERBS: Mapping[str, Callable[[Scene], Deed]] = {
    "moderate a team's name": lambda scene: partial(
        moderation.rename_team, team=scene.team, name=uuid.uuid4().hex, **_timed(scene)
    ),
    "moderate a method's name": lambda scene: partial(
        moderation.rename_method, method=scene.public, name=uuid.uuid4().hex, **_timed(scene)
    ),
    "clear texts": lambda scene: partial(moderation.clear_texts, method=scene.public, **_told(scene)),
    "move a method": _move,
    "withdraw for a team": partial(_withdraw, is_hidden=False),
    "hide": partial(_withdraw, is_hidden=True),
    "close an account": lambda scene: partial(
        moderation.set_active, user=scene.member, is_active=False, **_told(scene)
    ),
    "forget a person": lambda scene: partial(forgetting.forget, user=scene.member, **_timed(scene)),
    "forget an owner": lambda scene: partial(forgetting.forget, user=scene.owner, **_timed(scene)),
    "forget a newcomer": lambda scene: partial(forgetting.forget, user=scene.newcomer, **_timed(scene)),
    "change a split": _change_split,
    "mail the teams": _mail,
    "quote a paper": _quote,
}
