"""Invitations: links that let one person into a team, once, for a while. Only their hashes are kept."""

import hashlib
import re
import secrets
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime, timedelta

from django.conf import settings
from django.db import IntegrityError, transaction
from django.urls import reverse

from leaderboard import audit, board_versions
from leaderboard.errors.refusals import Refused
from leaderboard.models import Invitation, Membership, Method, Team, User, Visibility
from leaderboard.people import accounts, public_names, teams
from leaderboard.people.names import confusable_with, numbered, skeleton

LIFETIME = timedelta(days=7)
MAX_OPEN = 20
_SECRET = re.compile(r"[A-Za-z0-9_-]{43}")


class UnusableInvitation(Refused):
    pass


@dataclass(frozen=True)
class Meaning:
    """The effect of accepting: the team left, and the methods of a team of one that come along."""

    invitation: Invitation
    left: Team | None
    n_methods: int
    n_private: int
    renamed: tuple[tuple[str, str], ...]  # names that look like one that is there, and the new ones
    comes_along: bool
    refusal: str = ""


def make(*, team: Team, actor: User, now: datetime) -> tuple[Invitation, str]:
    """Make an invitation into one's team. Returns it and its secret, which is not kept. Raises `Refused`."""
    secret = secrets.token_urlsafe(32)
    with transaction.atomic():
        row = teams.locked_team(team)
        teams.require_owner(row, actor, doing="invites")
        usable = Invitation.objects.filter(accepted_at=None, revoked_at=None, expires_at__gt=now)
        n_open = usable.filter(team=row).count()
        if n_open >= MAX_OPEN:
            raise Refused(
                "too-many-invitations",
                f"The team has {n_open} unused invitations, the maximum; revoke one.",
            )
        invitation = Invitation.objects.create(
            team=row,
            secret_hash=_hash(secret),
            created_by=actor,
            created_at=now,
            expires_at=now + LIFETIME,
        )
        audit.record_of(row, "invited", actor=actor, details=_named(invitation))
    return invitation, secret


def link(secret: str) -> str:
    return settings.SITE_URL + reverse("join_team", args=[secret])


def state_of(invitation: Invitation, *, now: datetime) -> str:
    if invitation.accepted_at:
        return "used"
    if invitation.revoked_at:
        return "revoked"
    return "expired" if invitation.expires_at <= now else "open"


def revoke(*, invitation: Invitation, actor: User, now: datetime) -> bool:
    """Revoke an unused invitation. Returns False if it had ended. Raises `Refused`."""
    with transaction.atomic():
        row = teams.locked_team(invitation.team)
        teams.require_owner(row, actor, doing="revokes invitations")
        fresh = Invitation.objects.filter(pk=invitation.pk, accepted_at=None, revoked_at=None)
        if not fresh.update(revoked_at=now):
            return False
        audit.record_of(row, "revoked_invitation", actor=actor, details=_named(invitation))
    return True


def find(*, secret: str, now: datetime) -> Invitation | None:
    """Find the invitation of a link. Raises `UnusableInvitation` if it has ended."""
    if not _SECRET.fullmatch(secret):
        return None
    row = Invitation.objects.select_related("team", "created_by").filter(secret_hash=_hash(secret)).first()
    if row is not None:
        _require_open(row, now=now)
    return row


def meaning(*, invitation: Invitation, user: User) -> Meaning:
    """Return the effect of accepting, for the page that asks first."""
    membership = Membership.objects.filter(user=user).select_related("team").first()
    left = membership.team if membership else None
    comes_along = left is not None and not left.memberships.exclude(user=user).exists()
    existing = Method.objects.existing()
    methods = list(existing.filter(team=left).order_by("name")) if left and comes_along else []
    there = existing.filter(team=invitation.team).values_list("name", flat=True)
    names = _names_there([method.name for method in methods], there)
    refusal = ""
    if membership is not None:
        refusal = _refusal(membership, invitation.team, is_alone=comes_along)
    return Meaning(
        invitation=invitation,
        left=left,
        n_methods=len(methods),
        n_private=sum(method.visibility == Visibility.PRIVATE for method in methods),
        renamed=tuple((old, new) for old, new in names.items() if old != new),
        comes_along=comes_along,
        refusal=refusal,
    )


def accept(*, secret: str, user: User, now: datetime) -> Team:
    """Join the team by a link, once. A user who was alone in a team brings its methods. Raises `Refused`."""
    seen = find(secret=secret, now=now)
    if seen is None:
        raise _nothing()
    with transaction.atomic():
        accounts.hold_open(user)
        membership = teams.current_membership(user, seen.team)
        invitation = Invitation.objects.select_for_update(no_key=True).filter(pk=seen.pk).first()
        if invitation is None:
            raise _nothing()  # its team has ended meanwhile
        _require_open(invitation, now=now)
        team, moved = seen.team, {}
        former = membership.team if membership else None
        if membership is None or former is None:
            _enter(team, user, now=now)
        else:
            is_alone = not former.memberships.exclude(user=user).exists()
            refusal = _refusal(membership, team, is_alone=is_alone)
            if refusal:
                raise Refused("cannot-join", refusal)
            if is_alone:
                if Method.objects.filter(team=former, visibility=Visibility.PUBLIC).exists():
                    # Under this team's name everybody sees them from now on.
                    teams.show_name(team)
                moved = _bring_methods(former, team)
            Membership.objects.filter(pk=membership.pk).update(team=team, is_owner=False, joined_at=now)
            teams.end_invitations(former, of=user)
            teams.end_if_empty(former)
        Invitation.objects.filter(pk=invitation.pk).update(accepted_by=user, accepted_at=now)
        audit.record_of(
            team,
            "joined",
            actor=user,
            details={
                **_named(invitation),
                "left": str(former.pk) if former else None,
                "brought": sorted(moved),
            },
        )
        board_versions.bump_for_methods(
            Method.objects.shown().filter(pk__in=list(moved)).values_list("pk", flat=True)
        )
    return team


# --- what several of these need --------------------------------------------------------------------------


def _nothing() -> UnusableInvitation:
    return UnusableInvitation("no-invitation", "There is no such invitation; ask for a new link.")


def _hash(secret: str) -> str:
    return hashlib.sha256(secret.encode()).hexdigest()


def _named(invitation: Invitation) -> dict[str, str]:
    return {"invitation": str(invitation.pk)}


def _require_open(invitation: Invitation, *, now: datetime) -> None:
    state = state_of(invitation, now=now)
    sentence = {
        "used": "This invitation was already used; each works once.",
        "revoked": "This invitation was revoked by the team.",
        "expired": f"This invitation expired at {invitation.expires_at:%Y-%m-%d %H:%M} UTC.",
    }.get(state)
    if sentence:
        raise UnusableInvitation(f"invitation-{state}", f"{sentence} Ask the team for a new link.")


def _refusal(membership: Membership, team: Team, *, is_alone: bool) -> str:
    if membership.team_id == team.pk:
        return f"You are in the team {team.name!r} already."
    if membership.is_owner and not is_alone:
        return (
            f"You own the team {membership.team.name!r}, which has other members; "
            "make one of them its owner before you join another team."
        )
    return ""


def _enter(team: Team, user: User, *, now: datetime) -> None:
    try:
        with transaction.atomic():
            Membership.objects.create(team=team, user=user, joined_at=now)
    except IntegrityError:
        raise Refused(
            "changed-meanwhile", "Your team has just changed; reload the page and try again."
        ) from None


def _bring_methods(former: Team, team: Team) -> dict[str, str]:
    methods = list(Method.objects.select_for_update(no_key=True).filter(team=former).order_by("name"))
    there = Method.objects.existing().filter(team=team).values_list("name", flat=True)
    names = _names_there([method.name for method in methods if method.deleted_at is None], there)
    # A deleted one comes along with its files, and takes no name.
    moved = {method: method.name if method.deleted_at else names[method.name] for method in methods}
    public = [method for method in methods if method.visibility == Visibility.PUBLIC]
    renamed = [method for method in public if moved[method] != method.name]
    if renamed:
        board_versions.lock()
    for method in renamed:
        others = [*there, *(name for other, name in moved.items() if other != method)]
        moved[method] = _public_name(method, others)
    for method, name in moved.items():
        look = skeleton(name) if method in renamed else method.look
        Method.objects.filter(pk=method.pk).update(team=team, name=name, look=look)
    return {str(method.pk): name for method, name in moved.items()}


def _public_name(method: Method, others: Iterable[str]) -> str:
    taken = list(others)

    def is_taken(name: str) -> object:
        return public_names.twin_of(name, but=method) or confusable_with(name, taken)

    return numbered(method.name, is_taken=is_taken)


def _names_there(names: Iterable[str], taken: Iterable[str]) -> dict[str, str]:
    numbered_names: dict[str, str] = {}
    others = list(taken)
    for name in names:
        numbered_names[name] = numbered(name, is_taken=lambda new: confusable_with(new, others))
        others.append(numbered_names[name])
    return numbered_names
