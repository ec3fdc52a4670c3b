"""Moderation of names, entries and accounts by maintainers, each with a reason."""

from datetime import datetime
from uuid import UUID

from django.db import transaction

from leaderboard import audit, board_versions
from leaderboard.errors.refusals import Refused, clean_text, require_maintainer
from leaderboard.methods import editing
from leaderboard.models import Method, Submission, Team, User, Visibility
from leaderboard.models.methods import MethodQuerySet
from leaderboard.people import public_names, teams
from leaderboard.people.names import clean_name
from leaderboard.queue import lifecycle

MAX_REASON = 500


def rename_team(*, team: Team, name: str, reason: str, actor: User | None, now: datetime) -> Team:
    """Rename a team at once; without a name, neutrally. Raises `Refused`."""
    require_maintainer(actor, to="rename teams")
    reason = _reason(reason)
    with transaction.atomic():
        [row] = _locked_teams(team)
        name = clean_name("name", name or masked("Team", row.pk))
        before = row.name
        teams.set_name(team=row, name=name, now=now)
        audit.record_of(
            row, "renamed", actor=actor, details={"reason": reason}, names={"from": before, "to": name}
        )
        _changed(Method.objects.filter(team=row))
    return row


def rename_method(*, method: Method, name: str, reason: str, actor: User | None, now: datetime) -> Method:
    """Rename a method, also a public one. Raises `Refused`."""
    require_maintainer(actor, to="rename methods of others")
    reason = _reason(reason)
    with transaction.atomic():
        row = _locked(method)
        name = clean_name("name", name or masked("Method", row.pk))
        editing.require_distinct_name(name, team=row.team, field="name", but=row)
        before, row.name, row.renamed_at = row.name, name, now
        if row.visibility == Visibility.PUBLIC:
            board_versions.lock()
            public_names.require_free(name, but=row, field="name")
            public_names.save(row, fields=["name", "renamed_at"])
        else:
            row.save(update_fields=["name", "renamed_at"])
        audit.record_of(
            row, "renamed", actor=actor, details={"reason": reason}, names={"from": before, "to": name}
        )
        _changed(Method.objects.filter(pk=row.pk))
    return row


def clear_texts(*, method: Method, reason: str, actor: User | None) -> Method:
    """Delete the description and the links of a method. Raises `Refused` without a reason."""
    require_maintainer(actor, to="clear the texts of others")
    reason = _reason(reason)
    with transaction.atomic():
        row = _locked(method)
        row.description = row.paper_url = row.code_url = ""
        row.save(update_fields=["description", "paper_url", "code_url"])
        audit.record_of(row, "cleared", actor=actor, details={"reason": reason})
        _changed(Method.objects.filter(pk=row.pk))
    return row


def move_method(*, method: Method, to: Team, reason: str, actor: User | None) -> Method:
    """Move a method and its submissions to another team. Raises `Refused`."""
    require_maintainer(actor, to="move methods between teams")
    reason = _reason(reason)
    with transaction.atomic():
        _locked_teams(method.team, to)
        row = Method.objects.select_for_update(no_key=True).select_related(None).get(pk=method.pk)
        if row.team_id == to.pk:
            raise Refused("bad-value", f"The method is in the team {to.name!r} already.", field="name")
        editing.require_distinct_name(row.name, team=to, field="name")
        before = row.team_id
        if row.visibility == Visibility.PUBLIC:
            teams.show_name(to)
        row.team = to
        row.save(update_fields=["team"])
        audit.record_of(
            row, "moved", actor=actor, details={"reason": reason, "from": str(before), "to": str(to.pk)}
        )
        _changed(Method.objects.filter(pk=row.pk))
    return row


def withdraw_entry(
    *, submission: Submission, reason: str, actor: User | None, now: datetime, is_hidden: bool
) -> Submission:
    """Take a submission's values off the boards; with `is_hidden` its row as well, on boards of the past too.

    Raises `Refused`.
    """
    require_maintainer(actor, to="withdraw submissions of others")
    reason = _reason(reason)
    with transaction.atomic():
        row = Submission.objects.select_for_update(of=("self",), no_key=True).get(pk=submission.pk)
        if row.hidden_at or (row.withdrawn_at and not is_hidden):
            raise Refused("bad-value", "The submission is withdrawn already.")
        if row.withdrawn_at is None:
            lifecycle.cancel(submission=row, actor=actor)
        row.withdrawn_at = row.withdrawn_at or now
        row.hidden_at = now if is_hidden else None
        row.save(update_fields=["withdrawn_at", "hidden_at"])
        audit.record_of(row, "hidden" if is_hidden else "withdrawn", actor=actor, details={"reason": reason})
        board_versions.bump(row.split_id)
    return row


def set_active(*, user: User, is_active: bool, reason: str, actor: User | None) -> User:
    """Close an account, or open it again. Raises `Refused` for one's own."""
    require_maintainer(actor, to="close accounts")
    reason = _reason(reason)
    if actor is not None and actor.pk == user.pk:
        raise Refused("not-yourself", "You cannot close your own account here; expected another account.")
    with transaction.atomic():
        row = User.objects.select_for_update(no_key=True).get(pk=user.pk)
        row.is_active = is_active
        row.save(update_fields=["is_active"])
        audit.record_of(row, "opened" if is_active else "closed", actor=actor, details={"reason": reason})
    return row


def masked(noun: str, pk: UUID) -> str:
    """Return a neutral name, as "Team 3f9c2a"."""
    return f"{noun} {pk.hex[:6]}"


def _locked_teams(*wanted: Team) -> list[Team]:
    locked = teams.locked(*wanted)
    if len(locked) < len({team.pk for team in wanted}):
        raise Refused(
            "changed-meanwhile",
            "The team was deleted a moment ago; reload the page and choose another team.",
        )
    return locked


def _locked(method: Method) -> Method:
    teams.locked(method.team)
    rows = Method.objects.select_for_update(of=("self",), no_key=True).select_related("team")
    return rows.get(pk=method.pk)


def _changed(rows: MethodQuerySet) -> None:
    board_versions.bump_for_methods(rows.shown().values_list("pk", flat=True))


def _reason(text: str) -> str:
    return clean_text("reason", text, limit=MAX_REASON)
