"""Methods, edited by their team."""

from collections.abc import Callable, Mapping
from datetime import datetime
from typing import Any
from uuid import UUID

from django.db import transaction
from django.utils import timezone

from leaderboard import audit, board_versions
from leaderboard.errors.refusals import Refused, clean_url
from leaderboard.methods.details import DETAILS, free_text, text_of
from leaderboard.models import Method, Team, User, Visibility
from leaderboard.people import teams
from leaderboard.people.names import clean_name, confusable_with, require_rename_possible

UUID_CHARACTERS = 36


def edit(
    *, method: Method, changes: Mapping[str, object], actor: User, now: datetime | None = None
) -> Method:
    """Change a method's fields; None or an empty text clears one. Raises `Refused`."""
    clean = cleaned(changes)
    with transaction.atomic():
        teams.locked(method.team)
        row = Method.objects.select_for_update(no_key=True).select_related(None).get(pk=method.pk)
        require_team(row, actor)
        changed = {name: value for name, value in clean.items() if getattr(row, name) != value}
        if not changed:
            return row
        _require_sound(row, changed)
        if "name" in changed:
            renamed_at = now or timezone.now()
            require_rename_possible(renamed_at=row.renamed_at, now=renamed_at)
            row.renamed_at = renamed_at
        for name, value in changed.items():
            setattr(row, name, value)
        row.save(update_fields=[*changed, *(["renamed_at"] if "name" in changed else [])])
        audit.record_of(row, "edited", actor=actor, details={"fields": sorted(changed)})
        if row.was_shown():
            board_versions.bump_for_methods([row.pk])
    return row


def cleaned(changes: Mapping[str, object]) -> dict[str, Any]:
    """Convert values of a form or the API, by field. Raises `Refused`."""
    unknown = next((name for name in changes if name not in _CLEANERS), None)
    if unknown is not None:
        raise Refused(
            "unknown-field",
            f"A method has no field {unknown[:60]!r}; expected some of {', '.join(_CLEANERS)}.",
        )
    return {name: _CLEANERS[name](name, value) for name, value in changes.items()}


def is_of(method: Method, user: User) -> bool:
    return method.team.memberships.filter(user=user).exists()


def require_team(method: Method, actor: User) -> None:
    """Raise `Refused` unless the actor is in the method's team."""
    if not is_of(method, actor):
        raise Refused("not-yours", "Only the team of a method can change its details.")


def require_distinct_name(
    name: str, *, team: Team, field: str, but: Method | None = None, may_exist: bool = False
) -> None:
    """Raise `Refused` for a name that looks like that of another method of the team.

    `may_exist` allows this very name: another request may just create it.
    """
    others = Method.objects.existing().filter(team=team)
    if but is not None:
        others = others.exclude(pk=but.pk)
    if may_exist:
        others = others.exclude(name=name)
    twin = confusable_with(name, others.values_list("name", flat=True))
    if twin is not None:
        raise Refused(
            "name-taken",
            f"The name {name!r} looks like {twin!r}, the name of a method of your team; expected exactly "
            f"{twin!r}, or a name that looks different.",
            field=field,
        )


def _require_sound(method: Method, changed: Mapping[str, Any]) -> None:
    if "name" in changed:
        if method.visibility == Visibility.PUBLIC:
            raise Refused(
                "public-name",
                "A public method keeps its name; only its details can change.",
                field="name",
            )
        require_distinct_name(changed["name"], team=method.team, field="name", but=method)
    require_hardware(changed, method=method)


def require_hardware(changed: Mapping[str, Any], *, method: Method | None) -> None:
    """Raise `Refused` for a latency without hardware."""
    before = method or Method()
    latency_ms = changed.get("latency_ms", before.latency_ms)
    if latency_ms is not None and not changed.get("hardware", before.hardware):
        raise Refused(
            "missing-field",
            "The field 'hardware' is empty; expected what the latency was measured on.",
            field="hardware",
            advice="Enter the hardware on which the latency was measured, e.g. one RTX 4090.",
        )


# --- one field each --------------------------------------------------------------------------------------


_CLEANERS: Mapping[str, Callable[[str, object], Any]] = {
    "name": lambda name, value: clean_name(name, text_of(name, value)),
    "description": free_text(2000).clean,
    "paper_url": lambda name, value: clean_url(name, text_of(name, value)),
    "code_url": lambda name, value: clean_url(name, text_of(name, value)),
    **{detail.name: detail.kind.clean for detail in DETAILS},
}
FIELDS = tuple(_CLEANERS)
"""The fields that a team edits, in the order in which forms ask for them."""


def method_name_of(*, user: User, text: str) -> str:
    """Return the name for a name or id of the person's own method. Raises `Refused` for another's id."""
    text = text.strip()
    try:
        pk = UUID(text) if len(text) == UUID_CHARACTERS else None
    except ValueError:
        pk = None
    own = Method.objects.of(user)
    if pk is None or own.filter(name=text).exists():
        return text
    name = own.filter(pk=pk).values_list("name", flat=True).first()
    if name is None:
        raise Refused("unknown-method", f"Your team has no method with the id {pk}.", field="method")
    return name
