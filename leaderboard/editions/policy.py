"""The policy of a split: what maintainers decide about it."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from datetime import datetime, timedelta
from typing import Any, Final

from django.core.exceptions import ValidationError
from django.db import transaction

from leaderboard import audit, board_versions
from leaderboard.editions.deadlines import formatted
from leaderboard.errors.refusals import Refused, clean_text, require_maintainer
from leaderboard.models import PageVersion, Split, User
from leaderboard.models.benchmark import NO_END, NO_TEXT, Listing
from leaderboard.models.pages import ANNOUNCEMENT

MAX_DESCRIPTION: Final = 1000
MAX_POSITION: Final = 32767
POSITION_FAULT: Final = f"The position is %(show_value)s; expected a whole number from 0 to {MAX_POSITION:,}."


@dataclass(frozen=True, kw_only=True)
class Policy:
    """The columns of a split that maintainers can change."""

    title: str
    description: str = ""
    position: int = 0
    listing: str = Listing.LISTED
    needs_admission: bool = False
    how_to_be_admitted: str = ""
    opens_at: datetime | None = None
    closes_at: datetime | None = None
    announcement: str = ""
    announcement_ends_at: datetime | None = None
    decimals: int = 1
    quota_limit: int | None = None
    quota_window: timedelta = timedelta(days=1)
    quota_min_gap: timedelta = timedelta(0)
    quota_rejected_limit: int | None = 20


HIDDEN_QUOTA: Final[Mapping[str, Any]] = {
    "quota_limit": 3,
    "quota_window": timedelta(days=30),
    "quota_min_gap": timedelta(hours=24),
}
"""The quota of a split with hidden ground truth, unless maintainers choose another one."""

NAMES: Final = tuple(field.name for field in fields(Policy))


FIRST_POLICY: Final = Policy(title="", listing=Listing.OFF, **HIDDEN_QUOTA)
"""What the form of a new split begins with: on no page, and the quota of hidden ground truth."""


FAR_AWAY: Final = timedelta(days=365)


def policy_of(split: Split) -> Policy:
    return Policy(**{name: getattr(split, name) for name in NAMES})


def change(*, split_name: str, policy: Policy, actor: User | None) -> Split:
    """Change a split's policy. `actor` None is the command line. Raises `NotMaintainer` and `Refused`."""
    require_maintainer(actor, to="change splits")
    with transaction.atomic():
        split = Split.objects.select_for_update(no_key=True).filter(pk=split_name).first()
        if split is None:
            known = ", ".join(Split.objects.values_list("name", flat=True))
            raise Refused("unknown-split", f"There is no split {split_name[:80]!r}; expected one of {known}.")
        before = policy_of(split)
        checked(split, policy)
        if before.listing == Listing.OFF:
            require_listable(split)
        after = policy_of(split)
        if after != before:
            pairs = {name: (getattr(before, name), getattr(after, name)) for name in NAMES}
            split.save(update_fields=list(NAMES))
            audit.record_of(
                split,
                "changed",
                actor=actor,
                details={name: f"{old} → {new}" for name, (old, new) in pairs.items() if old != new},
            )
            board_versions.bump(split.pk)
    return split


def doubtful_dates(before: Policy | None, after: Policy, *, now: datetime) -> tuple[str, ...]:
    """Return what to ask of dates that are new, since a wrong year is easily typed; one sentence for each.

    `before` None is a new split.
    """
    new = {name: at for name, at in vars(after).items() if before is None or at != getattr(before, name)}
    opens_at, closes_at, ends_at = (
        new.get(name) for name in ("opens_at", "closes_at", "announcement_ends_at")
    )
    was_open = before is not None and (before.opens_at is None or before.opens_at <= now)
    asked = (
        (_is_past(closes_at, now), closes_at, "Submissions close at once: {} is in the past."),
        (_is_far(closes_at, now), closes_at, "Submissions are open for more than a year, until {}."),
        (_is_far(opens_at, now), opens_at, "Submissions open in more than a year, at {}."),
        (was_open and _is_near(opens_at, now), opens_at, "Submissions are closed from now until {}."),
        (_is_past(ends_at, now), ends_at, "The announcement is not shown: {} is in the past."),
        (_is_far(ends_at, now), ends_at, "The announcement is shown for more than a year, until {}."),
    )
    return tuple(sentence.format(formatted(at)) for is_doubtful, at, sentence in asked if is_doubtful)


def _is_past(at: datetime | None, now: datetime) -> bool:
    return at is not None and at <= now


def _is_far(at: datetime | None, now: datetime) -> bool:
    return at is not None and at > now + FAR_AWAY


def _is_near(at: datetime | None, now: datetime) -> bool:
    return at is not None and now < at <= now + FAR_AWAY


def announce(*, text: str, ends_at: datetime | None, now: datetime, actor: User | None) -> None:
    """Show one line on all pages about splits until it ends; without a text, none.

    Raises `NotMaintainer`, and `Refused` without an end in the future.
    """
    require_maintainer(actor, to="announce something")
    text = " ".join(clean_text("announcement", text, limit=300, required=False).split())
    if ends_at is None:
        if text:
            raise Refused("bad-value", NO_END, field="announcement_ends_at")
    elif not text:
        raise Refused("bad-value", NO_TEXT, field="announcement")
    if ends_at is not None and ends_at <= now:
        raise Refused(
            "bad-value",
            f"The announcement would end at {ends_at:%Y-%m-%d %H:%M} UTC, which is in the past; expected a "
            "later time.",
            field="announcement_ends_at",
        )
    with transaction.atomic():
        if ends_at is None:
            PageVersion.announcement().delete()
        else:
            PageVersion.objects.update_or_create(
                page=ANNOUNCEMENT, number=1, defaults={"text": text, "ends_at": ends_at, "written_at": now}
            )
        audit.record(
            verb="announced",
            noun="SiteAnnouncement",
            noun_id="site",
            actor=actor,
            details={"text": text, "ends_at": ends_at.isoformat() if ends_at else None},
        )
        board_versions.bump_all()


def checked(split: Split, policy: Policy) -> Split:
    """Return the unsaved split with this policy. Raises `Refused` at the first field at fault."""
    values = asdict(policy) | {
        "title": clean_text("title", policy.title, limit=80),
        "description": clean_text("description", policy.description, limit=MAX_DESCRIPTION, required=False),
        "how_to_be_admitted": clean_text(
            "how_to_be_admitted", policy.how_to_be_admitted, limit=300, required=False
        ),
    }
    values["announcement"] = " ".join(
        clean_text("announcement", policy.announcement, limit=300, required=False).split()
    )
    for name, value in values.items():
        setattr(split, name, value)
    try:
        # Its name is checked where it is given; an edition has its own ways.
        split.full_clean(exclude=["current_edition", "name"], validate_unique=False)
    except ValidationError as error:
        [field, *_] = error.message_dict
        raise Refused(
            "bad-value", error.message_dict[field][0], field=field if field in NAMES else ""
        ) from None
    return split


def require_listable(split: Split) -> None:
    """Raise `Refused` where a split would be listed before it has ground truth."""
    if split.listing != Listing.OFF and not split.has_ground_truth:
        raise Refused(
            "bad-value",
            f"The split {split.pk!r} has no ground truth and would be listed; expected it to be switched off "
            f"until its ground truth is imported (manage.py import_truth {split.pk} PATH).",
            field="listing",
        )
