"""Admissions: which teams submit to a split that only admitted teams submit to."""

from datetime import datetime

from django.db import transaction

from leaderboard import audit
from leaderboard.errors.refusals import Refused, require_maintainer
from leaderboard.models import Admission, Split, Team, User
from leaderboard.quotas import quotas


class NotAdmitted(Refused):
    """The split takes files of admitted teams alone, and this team is not one of them."""


def refusal_of(*, team: Team | None, split: Split) -> NotAdmitted | None:
    """Why the split takes nothing from this team; None if it does, as far as admission goes."""
    if not split.needs_admission:
        return None
    if team is not None and Admission.objects.filter(team=team, split=split).exists():
        return None
    ask = split.how_to_be_admitted.rstrip(". ") or "ask the maintainers of this site for access"
    return NotAdmitted(
        "not-admitted",
        f"Only admitted teams can submit to {split.pk}, and your team is not one of them; {ask}.",
        field="split",
    )


def require(*, team: Team | None, split: Split) -> None:
    """Raise `NotAdmitted` unless the split takes files of this team."""
    refusal = refusal_of(team=team, split=split)
    if refusal is not None:
        raise refusal


def admit(*, team: Team, split: Split, reason: str, actor: User | None, now: datetime) -> Admission:
    """Let a team submit to a split; once more gives another reason. `actor` None is the command line.

    Raises `NotMaintainer`, and `Team.DoesNotExist` if the team has just ended.
    """
    require_maintainer(actor, to="admit teams")
    with transaction.atomic():
        # Before the row that names it: whoever ends the team holds it.
        if not quotas.lock(team=team):
            raise Team.DoesNotExist(f"The team {team.name!r} has just ended; expected one that is there.")
        row, _ = Admission.objects.update_or_create(
            team=team, split=split, defaults={"reason": reason, "admitted_by": actor, "admitted_at": now}
        )
        details = {"split": split.pk, "reason": reason}
        audit.record(verb="admitted", noun="Team", noun_id=team.pk, actor=actor, details=details)
    return row


def end(*, row: Admission, actor: User | None) -> None:
    """Take the admission back; what was sent stays. Raises `NotMaintainer`."""
    require_maintainer(actor, to="admit teams")
    with transaction.atomic():
        row.delete()
        details = {"split": row.split_id}
        audit.record(verb="admission_ended", noun="Team", noun_id=row.team_id, actor=actor, details=details)
