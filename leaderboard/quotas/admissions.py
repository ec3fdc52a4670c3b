"""When a split takes submissions, and from which teams."""

from dataclasses import replace
from datetime import datetime

from django.db import transaction

from leaderboard import audit
from leaderboard.errors.refusals import Refused, require_maintainer
from leaderboard.models import Admission, Split, Team, User
from leaderboard.quotas import usage


def refusal_of(*, team: Team | None, split: Split) -> Refused | None:
    """Return the reason why this team is not admitted, if any."""
    if not split.needs_admission:
        return None
    if team is not None and Admission.objects.filter(team=team, split=split).exists():
        return None
    ask = split.how_to_be_admitted.rstrip(". ") or "ask the maintainers of this site for access"
    return Refused(
        "not-admitted",
        f"Only admitted teams can submit to {split.title}, and your team is not one of them; {ask}.",
        field="split",
    )


def require(*, team: Team | None, split: Split) -> None:
    """Raise `Refused` unless the team is admitted."""
    refusal = refusal_of(team=team, split=split)
    if refusal is not None:
        raise refusal


def admit(*, team: Team, split: Split, reason: str, actor: User | None, now: datetime) -> Admission:
    """Admit a team to a split, or change the reason. `actor` None is the command line.

    Raises `NotMaintainer`, and `Team.DoesNotExist` if the team has just ended.
    """
    require_maintainer(actor, to="admit teams")
    with transaction.atomic():
        # Before the row that names it: whoever ends the team holds it.
        if not usage.lock(team=team):
            raise Team.DoesNotExist(
                f"The team {team.name!r} was deleted a moment ago; expected an existing team."
            )
        row, _ = Admission.objects.update_or_create(
            team=team, split=split, defaults={"reason": reason, "admitted_by": actor, "admitted_at": now}
        )
        details = {"split": split.pk, "reason": reason}
        audit.record_of(team, "admitted", actor=actor, details=details)
    return row


def end(*, row: Admission, reason: str, actor: User | None) -> None:
    """End an admission; submissions stay. Raises `NotMaintainer`."""
    require_maintainer(actor, to="admit teams")
    with transaction.atomic():
        row.delete()
        details = {"split": row.split_id, "reason": reason}
        audit.record(verb="admission_ended", noun="Team", noun_id=row.team_id, actor=actor, details=details)


def refusal_for_all(split: Split, *, now: datetime) -> Refused | None:
    """Return the reason why a split takes nothing from anybody now, if any."""
    code, sentence = "", ""
    opens_at, closes_at = split.opens_at, split.closes_at
    if split.is_archived:
        code, sentence = "split-closed", "are closed: the split is archived."
    elif not split.has_ground_truth:
        code, sentence = "split-not-open", "open once the maintainers provide the ground truth."
    elif opens_at and now < opens_at:
        code, sentence = "split-not-open", f"open at {opens_at:%Y-%m-%d %H:%M} UTC."
    elif closes_at and now >= closes_at:
        code, sentence = "split-closed", f"closed at {closes_at:%Y-%m-%d %H:%M} UTC."
    return Refused(code, f"Submissions to {split.title} {sentence}", field="split") if code else None


def is_open(split: Split, *, now: datetime) -> bool:
    """Tell whether the split takes submissions from teams that have a slot left."""
    return refusal_for_all(split, now=now) is None


def sentence_of(split: Split, *, now: datetime) -> str:
    """Say since when, until when or why not the split takes submissions; may be empty."""
    return str(refusal_for_all(split, now=now) or closing_of(split))


def label_of(split: Split, *, now: datetime) -> str:
    """Say the same in a few words; empty for a split that is open without an end."""
    opens_at, closes_at = split.opens_at, split.closes_at
    if split.is_archived:
        return "Archived: closed for submissions"
    if not split.has_ground_truth:
        return "Not open for submissions yet"
    if opens_at and now < opens_at:
        return f"Opens for submissions {opens_at:%Y-%m-%d %H:%M} UTC"
    if closes_at and now >= closes_at:
        return f"Closed for submissions since {closes_at:%Y-%m-%d}"
    return f"Open for submissions until {closes_at:%Y-%m-%d %H:%M} UTC" if closes_at else ""


def closing_of(split: Split) -> str:
    """Say until when an open split takes submissions; may be empty."""
    at = split.closes_at
    return f"Submissions to {split.title} close at {at:%Y-%m-%d %H:%M} UTC." if at else ""


def left(*, team: Team | None, user: User, split: Split, now: datetime) -> usage.Quota:
    """Return the team's quota on the split; none of it is available while the split takes nothing from it."""
    quota = usage.state(team=team, user=user, split=split, now=now)
    refusal = refusal_for_all(split, now=now)
    not_admitted = refusal_of(team=team, split=split)
    if refusal is None and not_admitted is not None:
        return replace(quota, is_open=False, next_slot_at=None, sentence=str(not_admitted))
    if refusal is None:
        return quota
    opens_at = split.opens_at
    is_to_come = opens_at is not None and opens_at > now and split.has_ground_truth
    return replace(quota, is_open=False, next_slot_at=opens_at if is_to_come else None, sentence=str(refusal))
