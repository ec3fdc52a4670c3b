"""Quotas: how much a team may still submit to a split, and when the next slot opens.

Use follows from the submissions: one costs a slot while it waits or runs, and for good once it is scored.
Rejected and cancelled files, and those that crashed their reader, have a limit of their own; a limit of bytes
a day covers all. Quota follows people: a team has used what its methods got, and what its present members
have sent anywhere. Accounts with a mailbox in common are one person's, former ones included (`mailboxes`).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta

from django.conf import settings
from django.db import transaction
from django.db.models import BooleanField, Exists, ExpressionWrapper, OuterRef, Q

from evaluator.counting import counted
from leaderboard import audit
from leaderboard.errors.refusals import Refused, require_maintainer
from leaderboard.models import Evaluation, Membership, QuotaOverride, Split, Status, Submission, Team, User
from leaderboard.models.quotas import QuotaRules, excess
from leaderboard.people import accounts
from leaderboard.quotas import mailboxes
from leaderboard.quotas.spans import span

DAY = timedelta(days=1)
UNLIMITED = QuotaOverride(quota_limit=None, quota_rejected_limit=None)


class QuotaExceeded(Exception):
    """The team has no slot now."""

    code = "quota-exceeded"
    field = "split"

    def __init__(self, quota: "Quota") -> None:
        super().__init__(quota.sentence)
        self.quota = quota


@dataclass(frozen=True)
class Quota:
    """The use of a split by a team, and what is left.

    `next_slot_at` is None while a slot is open, and where none will ever open by itself.
    """

    split: str
    rules: QuotaRules
    used: int
    n_rejected: int
    is_open: bool
    next_slot_at: datetime | None
    sentence: str

    @property
    def limit(self) -> int | None:
        """Return the submissions within the window; None is without limit."""
        return self.rules.quota_limit

    @property
    def left(self) -> int | None:
        return None if self.limit is None else max(0, self.limit - self.used)

    @property
    def window_s(self) -> float:
        return self.rules.quota_window.total_seconds()

    @property
    def min_gap_s(self) -> float:
        return self.rules.quota_min_gap.total_seconds()

    def retry_after_s(self, *, now: datetime) -> int | None:
        """Return whole seconds until the next slot; None where none opens by itself."""
        if self.next_slot_at is None:
            return None
        return max(1, math.ceil((self.next_slot_at - now).total_seconds()))


def rules_of(*, team: Team | None, split: Split) -> QuotaRules:
    """Return the team's own rules on a split, else the split's."""
    if not settings.QUOTAS:
        return UNLIMITED
    return QuotaOverride.objects.filter(team=team, split=split).first() or split


def state(*, team: Team | None, user: User, split: Split, now: datetime) -> Quota:
    """Return the team's quota on the split; that of the user without a team."""
    rules = rules_of(team=team, split=split)
    spent, rejected = _spent(team=team, user=user, split=split, rules=rules, now=now)
    return quota_at(split=split, rules=rules, spent=spent, rejected=rejected, now=now)


def lock(*, team: Team) -> bool:
    """Lock the team's quota until this transaction ends. Returns whether the team still exists."""
    # The teams of other accounts of its people spend the same quota.
    people = mailboxes.mates(team.members.all()).accounts
    others = Membership.objects.filter(user__in=people).values("team")
    rows = Team.objects.select_for_update(no_key=True).filter(Q(pk=team.pk) | Q(pk__in=others))
    return team.pk in {row.pk for row in rows.order_by("pk")}


def lock_accounts(*, user: User) -> None:
    """Lock the accounts that count with this one, so that two of them cannot take one slot.

    Raises `Refused` if this one is closed.
    """
    mates = mailboxes.mates(User.objects.filter(pk=user.pk))
    former = [row.account_id for row in mates.spent]
    together = Q(pk=user.pk) | Q(pk__in=mates.accounts.values("pk")) | Q(pk__in=former)
    rows = User.objects.select_for_update(no_key=True).filter(together).order_by("pk")
    accounts.require_open({row.pk: row for row in rows}[user.pk])


def require(*, team: Team | None, user: User, split: Split, size_bytes: int, now: datetime) -> None:
    """Raise `QuotaExceeded` unless a slot is open for a file of this size; certain after `lock`."""
    if not settings.QUOTAS:
        return
    quota = state(team=team, user=user, split=split, now=now)
    if quota.is_open and settings.MAX_TEAM_BYTES_PER_DAY:
        quota = _with_bytes(quota, team=team, user=user, size_bytes=size_bytes, now=now)
    if not quota.is_open:
        raise QuotaExceeded(quota)


def _is_rejected() -> Q:
    evaluations = Evaluation.objects.filter(submission=OuterRef("pk"))
    live = evaluations.filter(priority=Evaluation.PRIORITY_LIVE)
    # By its team: those of an edition that was given up are cancelled as well.
    cancelled = Q(Exists(live.filter(status=Status.CANCELLED)), withdrawn_at__isnull=False)
    rejected = Q(Exists(live.filter(status=Status.REJECTED))) | Q(Exists(live.suspect())) | cancelled
    return rejected & ~Q(Exists(evaluations.filter(status=Status.SCORED)))


def _spent(
    *, team: Team | None, user: User, split: Split, rules: QuotaRules, now: datetime
) -> tuple[list[datetime], list[datetime]]:
    """Return the times of submissions that cost a slot, and of rejected or cancelled ones, in order."""
    since = now - max(rules.quota_window, rules.quota_min_gap, DAY)
    evaluations = Evaluation.objects.filter(submission=OuterRef("pk"))
    # Scoring anew after a correction costs nothing. It gives a slot back where the board cannot score what
    # another edition has scored: the team has to send another file, and for no fault of its own.
    board = evaluations.filter(edition=split.current_edition_id)
    live = evaluations.filter(priority=Evaluation.PRIORITY_LIVE)
    rows = (
        Submission.objects.filter(_theirs(team, user), split=split, submitted_at__gt=since)
        .annotate(
            is_scored=Exists(evaluations.filter(status=Status.SCORED)),
            is_given_back=Exists(board.filter(status=Status.REJECTED)),
            is_pending=Exists(live.filter(status__in=[Status.QUEUED, Status.RUNNING])),
            is_rejected=ExpressionWrapper(_is_rejected(), BooleanField()),
        )
        .order_by("submitted_at")
        .values_list("submitted_at", "is_scored", "is_given_back", "is_pending", "is_rejected")
    )
    spent, rejected = [], []
    for submitted_at, is_scored, is_given_back, is_pending, is_rejected in rows:
        if is_scored and is_given_back:
            continue
        if is_scored or is_pending:
            spent.append(submitted_at)
        elif is_rejected:
            rejected.append(submitted_at)
    return spent, rejected


def _theirs(team: Team | None, user: User) -> Q:
    """Match what anybody sent for the team, and what its people sent anywhere."""
    people = User.objects.filter(membership__team=team) if team else User.objects.filter(pk=user.pk)
    theirs = mailboxes.mates(people).sent()
    return theirs if team is None else theirs | Q(method__team=team)


def _with_bytes(quota: Quota, *, team: Team | None, user: User, size_bytes: int, now: datetime) -> Quota:
    """Close the quota if this file exceeds the team's bytes of a day."""
    limit: int = settings.MAX_TEAM_BYTES_PER_DAY
    rows = Submission.objects.filter(_theirs(team, user), submitted_at__gt=now - DAY)
    sent = list(rows.order_by("submitted_at").values_list("submitted_at", "size_bytes"))
    n_sent = sum(n_bytes for _, n_bytes in sent)
    if n_sent + size_bytes <= limit:
        return quota
    opens_at, n_excess = None, n_sent + size_bytes - limit
    for submitted_at, n_bytes in sent:
        n_excess -= n_bytes
        if n_excess <= 0:
            opens_at = submitted_at + DAY
            break
    then = f"; there is room for it at {_minute_after(opens_at):%Y-%m-%d %H:%M} UTC" if opens_at else ""
    return replace(
        quota,
        is_open=False,
        next_slot_at=opens_at,
        sentence=f"Your team has sent {counted(n_sent, 'byte')} within 24 hours, and this file has "
        f"{size_bytes:,}; expected at most {counted(limit, 'byte')} together{then}.",
    )


def quota_at(
    *, split: Split, rules: QuotaRules, spent: Sequence[datetime], rejected: Sequence[datetime], now: datetime
) -> Quota:
    """Compute the quota from times, oldest first: of submissions that cost a slot, and of rejected ones."""
    in_window = [at for at in spent if at > now - rules.quota_window]
    rejected = [at for at in rejected if at > now - DAY]
    full_until = _until(in_window, limit=rules.quota_limit, window=rules.quota_window)
    gap_until = spent[-1] + rules.quota_min_gap if spent and rules.quota_min_gap else None
    rejected_until = _until(rejected, limit=rules.quota_rejected_limit, window=DAY)
    opens_at = max((at for at in (full_until, gap_until, rejected_until) if at and at > now), default=None)
    is_never = 0 in {rules.quota_limit, rules.quota_rejected_limit}
    if is_never:
        sentence = f"Your team may not submit to {split.title}."
    elif opens_at is None:
        sentence = _left(rules, n_used=len(in_window))
    else:
        why = {
            full_until: f"Your team has used {counted(rules.quota_limit or 0, 'submission')} to "
            f"{split.title}, its quota for {span(rules.quota_window)}",
            gap_until: f"Submissions of a team to {split.title} must be at least "
            f"{span(rules.quota_min_gap)} apart",
            rejected_until: f"Your team has reached its limit for {split.title}: within 24 hours, "
            f"{counted(len(rejected), 'file')} that were rejected, were cancelled, or stopped the process "
            "that read them",
        }
        sentence = f"{why[opens_at]}; the next slot opens at {_minute_after(opens_at):%Y-%m-%d %H:%M} UTC."
    return Quota(
        split=split.pk,
        rules=rules,
        used=len(in_window),
        n_rejected=len(rejected),
        is_open=opens_at is None and not is_never,
        next_slot_at=None if is_never else opens_at,
        sentence=sentence,
    )


def _until(times: Sequence[datetime], *, limit: int | None, window: timedelta) -> datetime | None:
    """Return when fewer than `limit` of these lie in the window; None if that is so already, or never."""
    if not limit or len(times) < limit:
        return None
    return times[len(times) - limit] + window


def _left(rules: QuotaRules, *, n_used: int) -> str:
    if rules.quota_limit is None:
        text = "No limit"
    else:
        n_left = max(0, rules.quota_limit - n_used)
        limit = counted(rules.quota_limit, "submission")
        text = f"{n_left} of {limit} left (limit per {span(rules.quota_window)})"
    return f"{text}, at least {span(rules.quota_min_gap)} apart." if rules.quota_min_gap else f"{text}."


def _minute_after(at: datetime) -> datetime:
    whole = at.replace(second=0, microsecond=0)
    return whole if whole == at else whole + timedelta(minutes=1)


# --- rules for one team ----------------------------------------------------------------------------------


def override(
    *,
    team: Team,
    split: Split,
    limit: int | None,
    window: timedelta,
    min_gap: timedelta,
    rejected_limit: int | None,
    reason: str,
    actor: User | None,
    now: datetime,
) -> QuotaOverride:
    """Give a team its own rules on a split. `actor` None is the command line.

    Raises `NotMaintainer`, `Refused`, and `Team.DoesNotExist` if the team has just ended.
    """
    require_maintainer(actor, to="change the quotas of a team")
    rules = {
        "quota_limit": limit,
        "quota_window": window,
        "quota_min_gap": min_gap,
        "quota_rejected_limit": rejected_limit,
    }
    too_large = excess(quota_limit=limit, quota_rejected_limit=rejected_limit)
    for name, fault in {**QuotaOverride(**rules).faults(), **too_large}.items():
        raise Refused("bad-value", fault, field=name)
    with transaction.atomic():
        # Before the row that names it: whoever ends the team holds it.
        if not lock(team=team):
            raise Team.DoesNotExist(
                f"The team {team.name!r} was deleted a moment ago; expected an existing team."
            )
        row, _ = QuotaOverride.objects.update_or_create(
            team=team, split=split, defaults={**rules, "reason": reason, "set_by": actor, "set_at": now}
        )
        texts = {name: str(value) if isinstance(value, timedelta) else value for name, value in rules.items()}
        audit.record_of(
            team, "quota_overridden", actor=actor, details={"split": split.pk, "reason": reason, **texts}
        )
    return row


def end_override(*, row: QuotaOverride, actor: User | None, reason: str = "") -> None:
    """Remove a team's own rules. Raises `NotMaintainer`."""
    require_maintainer(actor, to="change the quotas of a team")
    with transaction.atomic():
        row.delete()
        audit.record(
            verb="quota_restored",
            noun="Team",
            noun_id=row.team_id,
            actor=actor,
            details={"split": row.split_id, "reason": reason},
        )
