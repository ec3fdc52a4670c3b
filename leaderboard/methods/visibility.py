"""Visibility: who sees a method. It is private until its team shows it, which cannot be taken back.

    private  -> anonymous   everybody sees the numbers, under a pseudonym
    private  -> public      everybody sees everything
    anonymous -> public     at once, or at a set time

A way back would let teams hide bad numbers.
"""

from collections.abc import Mapping
from datetime import datetime, timedelta

import structlog
from django.db import transaction

from leaderboard import audit, board_versions
from leaderboard.errors.refusals import Refused
from leaderboard.methods.editing import require_team
from leaderboard.models import Method, Team, User, Visibility
from leaderboard.people import public_names, teams
from leaderboard.people.names import confusable_with, numbered

log = structlog.get_logger(__name__)

MAX_ANONYMITY = timedelta(days=730)


def choices(method: Method) -> tuple[Visibility, ...]:
    """Return the visibilities that are possible next; an anonymous method may get another date."""
    if method.visibility == Visibility.PUBLIC:
        return ()
    return (Visibility.ANONYMOUS, Visibility.PUBLIC)


def change(
    *, method: Method, visibility: str, actor: User, now: datetime, reveal_at: datetime | None = None
) -> Method:
    """Show a method under its pseudonym or its name, which cannot be taken back.

    An anonymous one turns public at `reveal_at`, if given. Raises `Refused`.
    """
    with transaction.atomic():
        teams.locked(method.team)
        row = Method.objects.select_for_update(no_key=True).get(pk=method.pk)
        require_team(row, actor)
        require_possible(row, visibility=visibility, reveal_at=reveal_at, now=now)
        before = {"visibility": row.visibility, "reveal_at": row.reveal_at}
        row.visibility, row.reveal_at = visibility, reveal_at
        if before == {"visibility": row.visibility, "reveal_at": row.reveal_at}:
            return row
        row.shown_at = row.shown_at or now
        fields = ["visibility", "reveal_at", "shown_at"]
        if visibility == Visibility.PUBLIC:
            teams.show_name(row.team)
            # Whoever shows a name holds this until it is shown: of two that look alike, one is refused.
            board_versions.lock()
            public_names.require_free(row.name, but=row, field="visibility")
            public_names.save(row, fields=fields)
        else:
            row.save(update_fields=fields)
        audit.record_of(
            row,
            "shown",
            actor=actor,
            details={
                "from": before["visibility"],
                "to": row.visibility,
                "reveal_at": reveal_at.isoformat() if reveal_at else None,
            },
        )
        board_versions.bump_for_methods([row.pk])
    log.info("method_shown", method_id=str(row.pk), visibility=row.visibility)
    return row


def require_possible(method: Method, *, visibility: str, reveal_at: datetime | None, now: datetime) -> None:
    """Raise `Refused` for an impossible change."""
    if visibility not in (Visibility.ANONYMOUS, Visibility.PUBLIC):
        raise Refused(
            "bad-value",
            f"The visibility is {visibility[:60]!r}; expected ANONYMOUS or PUBLIC.",
            field="visibility",
        )
    if method.visibility == Visibility.PUBLIC and visibility != Visibility.PUBLIC:
        raise Refused(
            "shown-for-good", f"The method {method.name!r} is public; this is permanent.", field="visibility"
        )
    if visibility == Visibility.PUBLIC:
        teams.require_showable(method.team)
        public_names.require_free(method.name, but=method, field="visibility")
    if reveal_at is None:
        return
    if visibility != Visibility.ANONYMOUS:
        raise Refused(
            "bad-value",
            "The field 'reveal_at' has a date, but the method becomes public at once; expected no date.",
            field="reveal_at",
        )
    if not now < reveal_at <= now + MAX_ANONYMITY:
        raise Refused(
            "bad-value",
            f"The date is {reveal_at:%Y-%m-%d %H:%M} UTC; expected a future date, at most "
            f"{MAX_ANONYMITY.days} days from now.",
            field="reveal_at",
            advice="Choose a future date (within 2 years).",
        )


def notice_of(method: Method) -> str:
    """Say who sees the results of a method; empty if private."""
    if method.visibility == Visibility.PUBLIC:
        return f"“{method.name}” is public: everyone sees its results on every split."
    if method.visibility == Visibility.ANONYMOUS:
        return (
            f"“{method.name}” is anonymous: everyone sees its results on every split, under the name "
            f"{method.pseudonym}."
        )
    return ""


def reveal_due(*, now: datetime) -> int:
    """Make public what is due. Returns how many; safe against a second process."""
    due = Method.objects.filter(visibility=Visibility.ANONYMOUS, reveal_at__lte=now)
    n_revealed = 0
    for method_id in list(due.values_list("pk", flat=True)):
        with transaction.atomic():
            teams.locked(*Team.objects.filter(methods=method_id))
            if not due.filter(pk=method_id).update(visibility=Visibility.PUBLIC, reveal_at=None):
                continue
            # Read only now: the method may have moved to another team until it was locked.
            teams.show_name_in_any_case(Team.objects.get(methods=method_id))
            board_versions.lock()
            _number_taken_name(Method.objects.get(pk=method_id))
            details: Mapping[str, str] = {"from": Visibility.ANONYMOUS, "to": Visibility.PUBLIC}
            audit.record(verb="revealed", noun="Method", noun_id=method_id, details=details)
            board_versions.bump_for_methods([method_id])
        n_revealed += 1
    return n_revealed


def _number_taken_name(method: Method) -> None:
    before = method.name
    own = Method.objects.existing().filter(team=method.team_id).exclude(pk=method.pk)
    names_of_team = list(own.values_list("name", flat=True))
    method.name = numbered(
        before,
        is_taken=lambda name: public_names.twin_of(name, but=method) or confusable_with(name, names_of_team),
    )
    public_names.save(method, fields=["name"])
    if method.name != before:
        details = {"reason": "another method used this name on the boards first"}
        names = {"from": before, "to": method.name}
        audit.record_of(method, "renamed", details=details, names=names)
