"""Methods: what a team's approach is, as its team says, and what it has achieved."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from django.contrib.auth.models import AnonymousUser
from django.db import transaction
from django.utils import timezone

from leaderboard import audit, boards, snapshots, standings, teams
from leaderboard.entries import Entry, Profile, profile_of
from leaderboard.models import (
    BoxSource,
    Cameras,
    Edition,
    Method,
    Score,
    Split,
    Submission,
    Team,
    User,
    Visibility,
)
from leaderboard.names import clean_name, like, require_rename_possible
from leaderboard.present import Attempt
from leaderboard.texts import Refused, clean_text, clean_url

MAX_PARAMETERS = 10**15
MAX_LATENCY_MS = 1e9


def profile(*, method: Method, viewer: User | AnonymousUser) -> Profile:
    """What this reader is told of a method that is visible to them: of an anonymous one little."""
    return profile_of(method, is_masked=not method.is_named_for(viewer))


@dataclass(frozen=True)
class Result:
    """What a method achieved on one split: its row of the published board, and what was tried."""

    split: Split
    edition: Edition
    entry: Entry
    n_ranked: int
    attempts: tuple[Attempt, ...]  # its standing, scored submissions, the newest first
    neighbours: tuple[Entry, ...]  # of the rows that everybody sees, up to two of the nearest rank


def results(
    *, method: Method, viewer: User | AnonymousUser, splits: Sequence[Split] | None = None
) -> tuple[Result, ...]:
    """A result for each split on whose published board the viewer sees the method, in the splits' order.

    `splits` are those of `snapshots.splits()`, where they are at hand.
    """
    found = []
    for split, drawn in snapshots.shown_on(splits if splits is not None else snapshots.splits()):
        edition = split.published_edition
        entries = standings.with_own(drawn.entries, split=split, edition=edition, viewer=viewer)
        entry = next((entry for entry in entries if entry.method_id == method.pk), None)
        if entry is None or edition is None:
            continue
        is_shown = entry.is_visible_to_all
        # One that is private is counted where it would stand.
        ranked = drawn.entries if is_shown else (*drawn.entries, entry)
        n_ranked = sum(other.rank is not None for other in ranked)
        attempts = drawn.attempts_of(method.pk) if is_shown else _private_attempts(method, edition)
        neighbours = _neighbours(entry, drawn.entries)
        found.append(Result(split, edition, entry, n_ranked, attempts, neighbours))
    return tuple(found)


def _private_attempts(method: Method, edition: Edition) -> tuple[Attempt, ...]:
    """What no snapshot has, because nobody else sees it."""
    rows = Score.objects.filter(
        evaluation__edition=edition,
        evaluation__submission__in=Submission.objects.standing().filter(method=method),
        interval="overall",
    ).select_related("evaluation__submission")
    values: dict[Submission, dict[str, float]] = {}
    for score in rows:
        values.setdefault(score.evaluation.submission, {})[score.metric] = score.value
    attempts = [Attempt(method.pk, sent.pk, sent.submitted_at, **known) for sent, known in values.items()]
    return tuple(sorted(attempts, key=lambda attempt: attempt.at, reverse=True))


def _neighbours(entry: Entry, rows: Sequence[Entry]) -> tuple[Entry, ...]:
    """The row before and the row after; at an end of the board the two next to it."""
    value = entry.scores["mid"]
    others = [row for row in rows if row.method_id != entry.method_id and row.scores["mid"] is not None]
    if value is None:
        return ()
    others.sort(key=lambda row: row.scores["mid"] or 0.0)
    place = sum((row.scores["mid"] or 0.0) < value for row in others)
    first = min(max(place - 1, 0), max(len(others) - 2, 0))
    return tuple(others[first : first + 2])


# --- what its team says ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class MethodDetails:
    """Details of a method that come with a file; an empty one says nothing, and changes nothing."""

    description: str = ""
    paper_url: str = ""
    code_url: str = ""

    @property
    def given(self) -> dict[str, str]:
        """Those that are not empty."""
        return {name: value for name, value in vars(self).items() if value}

    def changes_of(self, method: Method) -> dict[str, str]:
        """Those that are not empty and differ from the method's own."""
        return {name: value for name, value in self.given.items() if getattr(method, name) != value}


def edit(
    *, method: Method, changes: Mapping[str, object], actor: User, now: datetime | None = None
) -> Method:
    """Say something else of a method; what `changes` does not name stays. Returns it as it is now.

    Values are texts as people fill them in, or what they mean; None or an empty text takes back what was
    said. The name stays once it is public. Raises `Refused`.
    """
    unknown = next((name for name in changes if name not in _CLEANERS), None)
    if unknown is not None:
        raise Refused(
            "unknown-field",
            f"A method has no field {unknown[:60]!r}; expected some of {', '.join(_CLEANERS)}.",
        )
    clean = {name: _CLEANERS[name](name, value) for name, value in changes.items()}
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
        audit.record(
            verb="edited",
            noun="Method",
            noun_id=row.pk,
            actor=actor,
            details={"fields": sorted(changed)},
        )
        if row.was_shown():
            boards.changed_by_methods([row.pk])
    return row


def is_of(method: Method, user: User) -> bool:
    """Whether the method is this person's team's."""
    return method.team.memberships.filter(user=user).exists()


def require_team(method: Method, actor: User) -> None:
    """Raise `Refused` for anybody but the method's own team."""
    if not is_of(method, actor):
        raise Refused("not-yours", "Only the team of a method can change what is said of it.")


def require_own_look(name: str, *, team: Team, field: str, but: Method | None = None) -> None:
    """Raise `Refused` for a name that would be taken for another one of the team's methods.

    It stays true for whoever has the team's row locked.
    """
    others = Method.objects.filter(team=team)
    if but is not None:
        others = others.exclude(pk=but.pk)
    twin = like(name, others.values_list("name", flat=True))
    if twin is not None:
        raise Refused(
            "name-taken",
            f"Your team has a method {twin!r}, which {name!r} looks like; expected that very name, or "
            "one that cannot be taken for it.",
            field=field,
        )


def _require_sound(method: Method, changed: Mapping[str, Any]) -> None:
    if "name" in changed:
        if method.visibility == Visibility.PUBLIC:
            raise Refused(
                "public-name",
                "A public method keeps its name; only what is said of it can change.",
                field="name",
            )
        require_own_look(changed["name"], team=method.team, field="name", but=method)
    latency_ms = changed.get("latency_ms", method.latency_ms)
    if latency_ms is not None and not changed.get("hardware", method.hardware):
        raise Refused(
            "missing-field",
            "The field 'hardware' is empty; expected what the latency was measured on.",
            field="hardware",
        )


# --- one field each --------------------------------------------------------------------------------------


def _bad_value(name: str, found: object, expected: str) -> Refused:
    return Refused(
        "bad-value", f"The field '{name}' is {str(found)[:60]!r}; expected {expected}.", field=name
    )


def _text(name: str, value: object) -> str:
    if value is None:
        return ""
    if not isinstance(value, str):
        raise _bad_value(name, value, "a text")
    return value


def _cleaned_text(limit: int) -> Callable[[str, object], str]:
    return lambda name, value: clean_text(name, _text(name, value), limit=limit, required=False)


def _is_given(value: object) -> bool:
    return value is not None and value != ""


def _whole_number(low: int, high: int) -> Callable[[str, object], int | None]:
    def clean(name: str, value: object) -> int | None:
        if not _is_given(value):
            return None
        text = str(value).strip()
        # Not more digits than the limit has: Python refuses to read very long numbers at all.
        is_whole = not isinstance(value, bool) and text.isascii() and text.isdigit() and len(text) <= 16
        if not is_whole or not low <= int(text) <= high:
            raise _bad_value(name, value, f"a whole number from {low:,} to {high:,}, or nothing")
        return int(text)

    return clean


def _milliseconds(name: str, value: object) -> float | None:
    if not _is_given(value):
        return None
    expected = "milliseconds above 0, or nothing"
    try:
        if isinstance(value, bool) or not isinstance(value, str | int | float):
            raise _bad_value(name, value, expected)
        number = float(value)
    except (ValueError, OverflowError):
        raise _bad_value(name, value, expected) from None
    if not math.isfinite(number) or not 0 < number <= MAX_LATENCY_MS:
        raise _bad_value(name, value, expected)
    return number


def _choice(choices: Any) -> Callable[[str, object], str]:
    def clean(name: str, value: object) -> str:
        if not _is_given(value):
            return ""
        if not isinstance(value, str) or value not in choices.values:
            raise _bad_value(name, value, f"one of {', '.join(choices.values)}, or nothing")
        return value

    return clean


def _yes_or_no(name: str, value: object) -> bool | None:
    if not _is_given(value):
        return None
    found = {"yes": True, "no": False}.get(value) if isinstance(value, str) else value
    if not isinstance(found, bool):
        raise _bad_value(name, value, "yes, no or nothing")
    return found


_CLEANERS: Mapping[str, Callable[[str, object], Any]] = {
    "name": lambda name, value: clean_name(name, _text(name, value)),
    "description": _cleaned_text(2000),
    "paper_url": lambda name, value: clean_url(name, _text(name, value)),
    "code_url": lambda name, value: clean_url(name, _text(name, value)),
    "n_frames": _whole_number(2, 6),
    "cameras": _choice(Cameras),
    "box_source": _choice(BoxSource),
    "uses_nerf": _yes_or_no,
    "uses_extra_data": _yes_or_no,
    "pretraining": _cleaned_text(200),
    "n_parameters": _whole_number(1, MAX_PARAMETERS),
    "latency_ms": _milliseconds,
    "hardware": _cleaned_text(120),
}
FIELDS = tuple(_CLEANERS)
"""What can be said of a method, in the order in which forms ask for it."""
