"""What was done since a backup, for maintainers to do again after they restored it: it is undone by that.

Read from the audit log of the newer database, or from an export of the log.
"""

import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, Final

from allauth.account.models import EmailAddress
from allauth.mfa.models import Authenticator
from django.apps import apps
from django.core.exceptions import ValidationError
from django.db import Error as DatabaseProblem
from django.db import connection, connections
from django.db.models import Model
from django.db.utils import load_backend

from leaderboard.backups.contents import NoBackup
from leaderboard.models import ApiToken, AuditEvent, AuditText, Submission, User

NEWER: Final = "_newer"
_ALIAS: Final = "newer"
_TEXT: Final = "text:"
# What these events did comes back by itself, or is no action of a person.
_BY_ITSELF: Final = frozenset({("Method", "revealed"), ("Submission", "cancelled"), ("FileStore", "claimed")})
_NOUNS_BY_ITSELF: Final = frozenset({"Evaluation", "File"})
# Only the person concerned can do these again.
_LOST: Final = frozenset(
    {
        ("Submission", "submitted"),
        ("ApiToken", "created"),
        ("Team", "created"),
        ("Team", "invited"),
        ("Team", "joined"),
    }
)
# What they act on need not be here.
_MAKING: Final = frozenset({"added", "imported", "opened", "announced", "acknowledged"})
_FIRST: Final = frozenset(
    {
        *("revoked", "forgotten", "closed", "hidden", "withdrawn", "removed", "cleared", "shown", "deleted"),
        *("removed_member", "left", "handed_over", "appointed_owner", "revoked_invitation"),
        *("admission_ended", "second factor reset", "recovered", "given back"),
    }
)
"""After these, somebody may again see or do what was taken from them."""


@dataclass(frozen=True)
class Event:
    """An event of the newer log; `details` with names in place of references."""

    at: datetime
    verb: str
    noun: str
    noun_id: str
    actor: str
    details: Mapping[str, Any]

    @property
    def key(self) -> tuple[datetime, str, str, str]:
        return self.at, self.verb, self.noun, self.noun_id


@dataclass(frozen=True)
class Missing:
    """What is undone, as lines: what protects a person, then the rest; and what people lost, counted."""

    first: Sequence[str]
    rest: Sequence[str]
    lost: Mapping[str, int]

    def lines(self) -> list[str]:
        lines = []
        if self.first:
            lines += ["To be done again first, since it protects people, values or entries:", *self.first]
        if self.rest:
            lines += ["To be done again:", *self.rest]
        if self.lost:
            counts = ", ".join(f"{what}: {n:,}" for what, n in sorted(self.lost.items()))
            lines.append(f"Lost, for the teams to do again: {counts}.")
        return lines or ["Nothing is to be done again."]


def since_backup(events: Sequence[Event]) -> Missing:
    """Compare the events of a newer log with this database's."""
    here = set(AuditEvent.objects.order_by().values_list("at", "verb", "noun", "noun_id"))
    missing = sorted((event for event in events if event.key not in here), key=lambda event: event.key)
    first: list[str] = []
    rest: list[str] = []
    lost = Counter[str]()
    for event in missing:
        kind = (event.noun, event.verb)
        if kind in _LOST:
            lost[f"{event.noun} {event.verb}"] += 1
        elif event.noun not in _NOUNS_BY_ITSELF and kind not in _BY_ITSELF:
            subject = _subject(event)
            if subject:
                # The role of a maintainer is a change of an account.
                is_first = event.verb in _FIRST or kind == ("User", "changed")
                (first if is_first else rest).append(_line(event, subject))
    return Missing(first, rest, dict(lost))


def _line(event: Event, subject: str) -> str:
    actor = f", by {event.actor}" if event.actor else ""
    texts = [f"{name}: {value}" for name, value in event.details.items() if value not in (None, "", [], {})]
    details = f" ({'; '.join(texts)})" if texts else ""
    verb = event.verb.replace("_", " ")
    return f"  {event.at:%Y-%m-%d %H:%M} UTC: {event.noun} {subject}: {verb}{actor}{details}"


def _subject(event: Event) -> str:
    """Name what the event is about; "" if it is of the time after the backup, so that nothing is undone."""
    try:
        model = apps.get_model("leaderboard", event.noun)
    except LookupError:
        return event.noun_id
    try:
        # Events name a token by its beginning.
        key = "token_key" if model is ApiToken else "pk"
        row: Model | None = model._default_manager.filter(**{key: event.noun_id}).first()
    except (ValueError, ValidationError):
        return event.noun_id
    if row is None:
        return event.noun_id if event.verb in _MAKING or event.noun == "PublishedResult" else ""
    return _name(row)


def _name(row: Model) -> str:
    if isinstance(row, User):
        return row.email
    if isinstance(row, ApiToken):
        return f"{row.name!r} of {row.user.email}"
    if isinstance(row, Submission):
        return f"{row.pk} of {row.method.name!r}"
    return f"{row} ({row.pk})" if str(row) != str(row.pk) else str(row)


# --- the two sources ----------------------------------------------------------------------------------------


def exported(path: Path) -> list[Event]:
    """Read an export of the audit log (`/maintain/audit/`). Raises `NoBackup`."""
    try:
        return [
            Event(
                at=datetime.fromisoformat(row["at"]),
                verb=row["verb"],
                noun=row["noun"],
                noun_id=row["noun_id"],
                actor=row["actor"] or "",
                details=row["details"] | row.get("names", {}),
            )
            for row in json.loads(path.read_text(encoding="utf-8"))
        ]
    except OSError as fault:
        raise NoBackup(f"{path} cannot be read ({fault.strerror}).") from fault
    except (ValueError, KeyError, TypeError) as fault:
        raise NoBackup(
            f"{path} is no export of the audit log; expected the JSON of /maintain/audit/."
        ) from fault


@contextmanager
def newer_database(config: Mapping[str, Any] | None = None) -> Iterator[str]:
    """Connect to the newer database, and yield its alias: by default NAME_newer on the same server.

    Raises `NoBackup` if it does not answer.
    """
    configured: dict[str, Any] = {**connections.settings["default"]}
    if config:
        configured |= {**config, "OPTIONS": configured["OPTIONS"] | config.get("OPTIONS", {})}
    elif connection.vendor == "postgresql":
        configured["NAME"] = f"{configured['NAME']}{NEWER}"
    else:
        raise NoBackup("SQLite has no database beside this one; expected --database or --audit.")
    if configured["ENGINE"] != connections.settings["default"]["ENGINE"]:
        raise NoBackup(f"The newer database is one of {configured['ENGINE']}; expected the kind of this one.")
    connections[_ALIAS] = load_backend(configured["ENGINE"]).DatabaseWrapper(configured, _ALIAS)
    try:
        connections[_ALIAS].ensure_connection()
        yield _ALIAS
    except DatabaseProblem as fault:
        name = configured["NAME"]
        raise NoBackup(f"The database {name} cannot be read: {str(fault).strip()}") from fault
    finally:
        connections[_ALIAS].close()
        del connections[_ALIAS]


def events_of(alias: str) -> list[Event]:
    """Read the whole log of a database. Raises the database's error."""
    rows = AuditEvent.objects.using(alias).order_by("pk")
    fields = rows.values_list("at", "verb", "noun", "noun_id", "actor__email", "details")
    texts = {f"{_TEXT}{pk}": text for pk, text in AuditText.objects.using(alias).values_list("pk", "text")}
    return [
        Event(at, verb, noun, noun_id, actor or "", _with_names(details, texts))
        for at, verb, noun, noun_id, actor, details in fields.iterator(chunk_size=2000)
    ]


def _with_names(details: Mapping[str, Any], texts: Mapping[str, str]) -> dict[str, Any]:
    return {
        name: texts.get(value, "") if isinstance(value, str) and value.startswith(_TEXT) else value
        for name, value in details.items()
    }


def changed_sign_ins(alias: str) -> list[str]:
    """Return lines on accounts that sign in otherwise in the newer database; the audit log has none of it."""
    here, newer = _sign_ins("default"), _sign_ins(alias)
    lines = []
    for pk, (email, *old) in sorted(here.items()):
        # An account that is forgotten there is in the log.
        _, *new = newer.get(pk, (email, *old))
        kinds = ("password", "addresses", "two-factor authentication")
        changed = [kind for kind, before, after in zip(kinds, old, new, strict=True) if before != after]
        if changed:
            lines.append(f"  {email}: {', '.join(changed)}")
    return lines


def _sign_ins(alias: str) -> dict[int, tuple[Any, ...]]:
    addresses: dict[int, set[str]] = {}
    for pk, email in EmailAddress.objects.using(alias).values_list("user_id", "email"):
        addresses.setdefault(pk, set()).add(email)
    factors: dict[int, set[Any]] = {}
    for row in Authenticator.objects.using(alias).values_list("user_id", "type", "created_at"):
        factors.setdefault(row[0], set()).add(row[1:])
    users = User.objects.using(alias).filter(is_active=True).values_list("pk", "email", "password")
    return {
        pk: (email, password, addresses.get(pk, set()), factors.get(pk, set()))
        for pk, email, password in users
    }
