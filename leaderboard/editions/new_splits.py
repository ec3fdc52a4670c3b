"""New splits, and challenges: splits that share the ground truth of another one."""

import re
from datetime import datetime
from typing import Final

from django.db import transaction
from django.db.models import Max

from leaderboard import audit, board_versions
from leaderboard.editions import ground_truth
from leaderboard.editions.policy import Policy, checked, require_listable
from leaderboard.errors.refusals import Refused, require_maintainer
from leaderboard.models import Publication, Split, User

_NAME: Final = re.compile(r"[a-z][a-z0-9-]{0,31}", re.ASCII)
# Names that mean something else in addresses of maintainers' pages.
_RESERVED: Final = frozenset(
    {"add", "announcement", "audit", "actions", "pages", "published", "queue", "quotas", "splits", "teams"}
)


def add_split(
    *,
    name: str,
    policy: Policy,
    is_hidden: bool | None,
    same_truth_as: str,
    now: datetime,
    actor: User | None,
    is_simulated: bool = False,
) -> Split:
    """Make a split, at the end of the list if the policy says 0.

    `same_truth_as` names a split whose ground truth it shares; its first edition is published at once.
    Otherwise `is_hidden` says whether the ground truth to be imported is hidden. `actor` None is the command
    line. Raises `NotMaintainer` and `Refused`.
    """
    require_maintainer(actor, to="add splits")
    if not _NAME.fullmatch(name) or name in _RESERVED:
        raise Refused(
            "bad-value",
            f"The name {name[:60]!r} cannot be used; expected 1 to 32 small letters, digits and hyphens, "
            f"the first a letter, and none of {', '.join(sorted(_RESERVED))}.",
            field="name",
        )
    if policy.closes_at is not None and policy.closes_at <= now:
        raise Refused(
            "bad-value",
            f"The split would close at {policy.closes_at:%Y-%m-%d %H:%M} UTC, which is in the past; "
            "expected a later time.",
            field="closes_at",
        )
    with transaction.atomic():
        other = _sharing(same_truth_as) if same_truth_as else None
        if other is None and is_hidden is None:
            raise Refused(
                "missing-field",
                "The ground truth is neither hidden nor open; expected one of the two.",
                field="is_hidden",
            )
        split = Split(
            name=name,
            is_hidden=other.is_hidden if other else bool(is_hidden),
            is_simulated=other.is_simulated if other else is_simulated,
            same_truth_as=other,
        )
        checked(split, policy)
        if not split.position:
            split.position = (Split.objects.aggregate(last=Max("position"))["last"] or 0) + 1
        if Split.objects.filter(pk=name).exists():
            raise Refused(
                "name-taken", f"There is a split {name!r} already; expected another name.", field="name"
            )
        if other is None:
            require_listable(split)
        split.save(force_insert=True)
        audit.record(
            verb="added",
            noun="Split",
            noun_id=name,
            actor=actor,
            details={"title": split.title, "is_hidden": split.is_hidden, "same_truth_as": same_truth_as},
        )
        if other is not None and other.current_edition is not None:
            _publish_like(other, split, now=now, actor=actor)
        board_versions.bump(name)
    return split


def _sharing(name: str) -> Split:
    split = Split.objects.select_for_update(no_key=True).filter(pk=name).first()
    if split is None or split.current_edition_id is None or split.same_truth_as_id is not None:
        able = Split.objects.filter(same_truth_as=None).exclude(current_edition=None)
        known = ", ".join(able.values_list("name", flat=True)) or "none, because none has ground truth yet"
        raise Refused(
            "unknown-split",
            f"There is no split {name[:60]!r} with ground truth of its own; expected one of: {known}.",
            field="same_truth_as",
        )
    return split


def _publish_like(other: Split, split: Split, *, now: datetime, actor: User | None) -> None:
    board = other.current_edition
    assert board is not None  # noqa: S101 - the caller has looked
    edition = ground_truth.new_edition(
        split=split, row=board.ground_truth, protocol=board.protocol, now=now, actor=actor
    )
    ground_truth.make_board(
        edition=edition, kind=Publication.Kind.PUBLISHED, reason="The first edition.", now=now, actor=actor
    )
