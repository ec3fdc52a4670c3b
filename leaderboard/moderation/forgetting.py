"""A person's data: their own export, and the deletion of what names them. Scores and files stay."""

from datetime import datetime
from typing import Any, Final

from allauth.account.models import EmailAddress
from allauth.mfa.models import Authenticator
from allauth.socialaccount.models import SocialAccount
from django.db import transaction
from django.db.models import Q

from leaderboard import audit, board_versions
from leaderboard.errors.refusals import Refused, require_maintainer
from leaderboard.models import (
    ApiToken,
    AuditEvent,
    AuditText,
    Invitation,
    Mail,
    Membership,
    Method,
    OldAddress,
    Submission,
    Team,
    User,
)
from leaderboard.moderation.hiding import masked
from leaderboard.people import sessions, teams
from leaderboard.quotas import mailboxes

# Addresses below it exist nowhere (RFC 2606).
NOWHERE = "forgotten.invalid"
# The fields of a submission that a person has typed, or named a file.
_TEXTS: Final = ("filename", "note", "commit")


def export(*, user: User) -> dict[str, Any]:
    """Return all that is kept about a person as plain values, without secrets or other people."""
    team = Team.objects.filter(memberships__user=user).first()
    sent = Submission.objects.filter(submitted_by=user).select_related("method").order_by("submitted_at")
    # A team that they have left may call a method something else by now, which is not theirs to know.
    used = Method.objects.filter(submissions__submitted_by=user).select_related("team").distinct()
    names = {method.pk: method.name if method.is_named_for(user) else None for method in used}
    actions = AuditEvent.objects.filter(actor=user).order_by("pk")
    return {
        "account": {
            "email": user.email,
            "addresses": list(EmailAddress.objects.filter(user=user).values("email", "verified", "primary")),
            "name": user.name,
            "date_joined": _moment(user.date_joined),
            "last_login": _moment(user.last_login),
            "is_maintainer": user.is_maintainer,
        },
        "team": {"id": str(team.pk), "name": team.name} if team else None,
        "submissions": [
            {
                "id": str(row.pk),
                "split": row.split_id,
                "method_id": str(row.method_id),
                "method": names[row.method_id],
                **{name: getattr(row, name) for name in _TEXTS},
                "digest": row.digest,
                "size_bytes": row.size_bytes,
                "submitted_at": _moment(row.submitted_at),
                "withdrawn_at": _moment(row.withdrawn_at),
            }
            for row in sent
        ],
        "tokens": [
            {"name": row.name, "begins_with": row.token_key, "created_at": _moment(row.created)}
            for row in ApiToken.objects.filter(user=user).order_by("created")
        ],
        "second_factor": [
            {
                "type": row.type,
                "created_at": _moment(row.created_at),
                "last_used_at": _moment(row.last_used_at),
            }
            for row in Authenticator.objects.filter(user=user).order_by("type")
        ],
        "connected_accounts": [
            {
                "provider": row.provider,
                "id": row.uid,
                "said": row.extra_data,
                "connected_at": _moment(row.date_joined),
            }
            for row in SocialAccount.objects.filter(user=user).order_by("provider")
        ],
        "invitations": [
            {"team": str(row.team_id), "created_at": _moment(row.created_at)}
            for row in Invitation.objects.filter(Q(created_by=user) | Q(accepted_by=user))
        ],
        "changes_of_the_account": [
            {"at": _moment(row.at), "what": row.what, "addresses_before": row.before}
            for row in user.changes.order_by("at")
        ],
        "mails_not_wanted": user.muted_kinds.split(),
        "audit_log": [
            {"at": _moment(row.at), "action": row.verb, "object": row.noun, "id": row.noun_id}
            for row in actions
        ],
    }


def forget(*, user: User, reason: str, actor: User | None, now: datetime) -> None:
    """Delete everything that names a person. `actor` is the person, a maintainer, or None.

    The oldest member owns the team then; a team without other members loses its name.
    Raises `NotMaintainer`, and `Refused` for a maintainer.
    """
    if actor is None or actor.pk != user.pk:
        require_maintainer(actor, to="delete accounts of others")
    with transaction.atomic():
        membership = teams.current_membership(user)
        row = User.objects.get(pk=user.pk)
        if row.is_staff:
            raise Refused(
                "permission-denied",
                "A maintainer's account cannot be deleted; another maintainer ends the role first.",
            )
        if row.email == _nowhere(row) and not row.is_active:
            return  # another request was first
        # What the mailbox has spent is decided while the account still has it.
        mailboxes.keep(user=row, now=now)
        team = membership.team if membership else None
        heir = team.memberships.exclude(user=row).order_by("-is_owner", "joined_at").first() if team else None
        if team is not None and heir is None:
            teams.set_name(team=team, name=masked("Team", team.pk), now=now)
            audit.blank(AuditText.objects.filter(noun="Team", noun_id=str(team.pk)))
        elif heir is not None and membership is not None and membership.is_owner:
            heir.is_owner = True
            heir.save(update_fields=["is_owner"])
        known = _addresses_of(row)
        _delete_rows(row, known=known)
        _blank(row)
        audit.record_of(
            row, "forgotten", actor=actor, details={"reason": reason, "team": str(team.pk) if team else None}
        )
        if team is not None:
            board_versions.bump_for_methods(
                Method.objects.filter(team=team).shown().values_list("pk", flat=True)
            )
    # Sign-ins and sign-ups keep addresses in sessions, also in those of others.
    sessions.end_all(user=row, addresses=known)


def delete_late_rows() -> None:
    # Requests may write into the tables of allauth while their account is being deleted.
    for model in (EmailAddress, Authenticator, SocialAccount):
        model.objects.filter(user__is_active=False, user__email__endswith=f"@{NOWHERE}").delete()


def _addresses_of(user: User) -> list[str]:
    """Return the present and the former addresses of an account."""
    present = EmailAddress.objects.filter(user=user).values_list("email", flat=True)
    former = [address for row in user.changes.all() for address in row.before]
    return sorted({user.email, *present, *former})


def _delete_rows(user: User, *, known: list[str]) -> None:
    ApiToken.objects.filter(user=user).delete()
    Invitation.objects.filter(created_by=user).delete()
    user.changes.all().delete()
    Mail.objects.filter(Q(user=user) | Q(recipient__in=known)).delete()
    OldAddress.objects.filter(address__in=known).delete()
    EmailAddress.objects.filter(user=user).delete()
    Authenticator.objects.filter(user=user).delete()
    SocialAccount.objects.filter(user=user).delete()
    Membership.objects.filter(user=user).delete()


def _blank(user: User) -> None:
    user.email = _nowhere(user)
    user.name, user.muted_kinds, user.is_active, user.last_login = "", "", False, None
    # Sessions rest on the password: they all end with it.
    user.set_unusable_password()
    user.save(update_fields=["email", "name", "muted_kinds", "is_active", "last_login", "password"])
    Submission.objects.filter(submitted_by=user).update(**dict.fromkeys(_TEXTS, ""))
    audit.blank(AuditText.objects.filter(Q(actor=user) | Q(noun="User", noun_id=str(user.pk))))


def _nowhere(user: User) -> str:
    return f"{user.pk}@{NOWHERE}"


def _moment(at: datetime | None) -> str | None:
    return at.isoformat() if at else None
