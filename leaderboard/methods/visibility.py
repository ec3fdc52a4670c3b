"""Visibility: who sees a method. It is private until its team decides otherwise, which it does on purpose.

    private  -> anonymous   everybody sees the numbers, under a pseudonym
    private  -> public      everybody sees everything, for good
    anonymous -> public     at once, or at a moment that was named

There is no way back. What everybody has seen cannot be unseen, and whoever could hide bad numbers again would
show good ones only.
"""

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from datetime import datetime, timedelta
from uuid import UUID

import structlog
from django.db import transaction

from leaderboard import audit, boards, standings, teams
from leaderboard.entries import Entry, Profile, profile_of
from leaderboard.methods import require_team
from leaderboard.models import Edition, Method, Split, Team, User, Visibility
from leaderboard.texts import Refused

log = structlog.get_logger(__name__)

MAX_ANONYMITY = timedelta(days=730)


@dataclass(frozen=True)
class Sight:
    """The row of one split's published board that everybody would see, and how it would stand there."""

    split: Split
    edition: Edition
    entry: Entry
    n_ranked: int
    n_attempts_now: int | None  # what the team's public rows say until then; None if it has none there
    before: Entry | None = None  # the row that everybody sees until then
    moved: tuple["Moved", ...] = ()


@dataclass(frozen=True)
class Moved:
    """Another row of the board, and the rank that it would have then."""

    entry: Entry
    rank_after: int | None


@dataclass(frozen=True)
class Preview:
    """Exactly what everybody would see of a method."""

    visibility: str
    profile: Profile
    sights: tuple[Sight, ...]


def choices(method: Method) -> tuple[Visibility, ...]:
    """What it can become: further than it is, or anonymous with another date."""
    if method.visibility == Visibility.PUBLIC:
        return ()
    return (Visibility.ANONYMOUS, Visibility.PUBLIC)


def preview(*, method: Method, visibility: str, now: datetime) -> Preview:
    """What everybody would see if the method were shown like this, made as the boards themselves are."""
    supposed = copy(method)
    supposed.visibility = visibility
    supposed.shown_at = method.shown_at or now
    others = _public_others(method)
    sights = []
    splits = Split.objects.exclude(published_edition=None).select_related("published_edition__ground_truth")
    for split in splits:
        edition = split.published_edition
        rows = standings.everybodys(split=split, edition=edition, supposed=supposed)
        entry = next((row for row in rows if row.method_id == method.pk), None)
        if entry is not None and edition is not None:
            before = standings.everybodys(split=split, edition=edition)
            sights.append(
                Sight(
                    split=split,
                    edition=edition,
                    entry=entry,
                    n_ranked=sum(row.rank is not None for row in rows),
                    n_attempts_now=next((row.n_attempts for row in before if row.method_id in others), None),
                    before=next((row for row in before if row.method_id == method.pk), None),
                    moved=_moved(before, rows, method=method),
                )
            )
    return Preview(
        visibility=visibility,
        profile=profile_of(supposed, is_masked=visibility == Visibility.ANONYMOUS),
        sights=tuple(sights),
    )


def _public_others(method: Method) -> set[UUID]:
    """The team's other methods that everybody sees under their names."""
    others = Method.objects.filter(team=method.team_id, visibility=Visibility.PUBLIC).exclude(pk=method.pk)
    return set(others.values_list("pk", flat=True))


def _moved(before: Sequence[Entry], after: Sequence[Entry], *, method: Method) -> tuple[Moved, ...]:
    """The other rows whose rank would change, in the order of the ranks that they have."""
    ranks = {_key(row): row.rank for row in after}
    moved = [
        Moved(entry=row, rank_after=ranks[_key(row)])
        for row in before
        if row.method_id != method.pk and ranks[_key(row)] != row.rank
    ]
    return tuple(sorted(moved, key=lambda row: (row.entry.rank or 0, row.entry.method.casefold())))


def _key(row: Entry) -> tuple[UUID | None, str, str]:
    """What a row is known by in two drawings of a board; a printed one has no id."""
    return (row.method_id, "", "") if row.method_id else (None, row.source, row.method)


def change(
    *, method: Method, visibility: str, actor: User, now: datetime, reveal_at: datetime | None = None
) -> Method:
    """Show a method to everybody, under its pseudonym or its name. It cannot be taken back.

    An anonymous one turns public by itself at `reveal_at`, if that is given, and can be given another such
    moment, or none. Raises `Refused`.
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
        if visibility == Visibility.PUBLIC:
            teams.show_name(row.team)
        row.shown_at = row.shown_at or now
        row.save(update_fields=["visibility", "reveal_at", "shown_at"])
        audit.record(
            verb="shown",
            noun="Method",
            noun_id=row.pk,
            actor=actor,
            details={
                "from": before["visibility"],
                "to": row.visibility,
                "reveal_at": reveal_at.isoformat() if reveal_at else None,
            },
        )
        boards.changed_by_methods([row.pk])
    log.info("method_shown", method_id=str(row.pk), visibility=row.visibility)
    return row


def require_possible(method: Method, *, visibility: str, reveal_at: datetime | None, now: datetime) -> None:
    """Raise `Refused` for what a method cannot become any more, and for a moment that is none."""
    if visibility not in (Visibility.ANONYMOUS, Visibility.PUBLIC):
        raise Refused(
            "bad-value",
            f"The visibility is {visibility[:60]!r}; expected ANONYMOUS or PUBLIC.",
            field="visibility",
        )
    if method.visibility == Visibility.PUBLIC and visibility != Visibility.PUBLIC:
        raise Refused(
            "shown-for-good", f"The method {method.name!r} is public, for good.", field="visibility"
        )
    if visibility == Visibility.PUBLIC:
        teams.require_showable(method.team)
    if reveal_at is None:
        return
    if visibility != Visibility.ANONYMOUS:
        raise Refused("bad-value", "A public method has no date of reveal; expected none.", field="reveal_at")
    if not now < reveal_at <= now + MAX_ANONYMITY:
        raise Refused(
            "bad-value",
            f"The method would be revealed at {reveal_at:%Y-%m-%d %H:%M} UTC; expected a moment to come, "
            f"at most {MAX_ANONYMITY.days} days from now.",
            field="reveal_at",
        )


def notice_of(method: Method) -> str:
    """Who sees the results of a method, in a sentence, for whoever is about to send one; empty if private.

    A method is shown on every split at once, so a file for another split is seen as soon as it is scored.
    """
    if method.visibility == Visibility.PUBLIC:
        return f"{method.name} is public: everybody sees its results on every split."
    if method.visibility == Visibility.ANONYMOUS:
        return (
            f"{method.name} is anonymous: everybody sees its results on every split, under the name "
            f"{method.pseudonym}."
        )
    return ""


def reveal_due(*, now: datetime) -> int:
    """Make public what was to be public by now. Returns how many; of two that do this at once, one does."""
    due = Method.objects.filter(visibility=Visibility.ANONYMOUS, reveal_at__lte=now)
    n_revealed = 0
    for method_id in list(due.values_list("pk", flat=True)):
        with transaction.atomic():
            teams.locked(*Team.objects.filter(methods=method_id))
            if not due.filter(pk=method_id).update(visibility=Visibility.PUBLIC, reveal_at=None):
                continue
            # Read only now: the method may have moved to another team until it was locked.
            teams.show_name_in_any_case(Team.objects.get(methods=method_id))
            details: Mapping[str, str] = {"from": Visibility.ANONYMOUS, "to": Visibility.PUBLIC}
            audit.record(verb="revealed", noun="Method", noun_id=method_id, details=details)
            boards.changed_by_methods([method_id])
        n_revealed += 1
    return n_revealed
