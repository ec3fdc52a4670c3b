"""The audit trail: who did what to what, when. Each event is bound to the one before it by its hash.

Of two transactions that write events the second waits for the end of the first, whose hash it has to know.
A verb therefore records last of all that it writes: the wait is then as long as a COMMIT. And nobody who has
the chain waits for a row that somebody has who waits for the chain: see `hold`.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from django.db import connection, transaction
from django.db.models import QuerySet
from django.utils import timezone

from leaderboard import bulk
from leaderboard.models import AuditEvent, User
from leaderboard.models.audit import GENESIS

# Names the chain among PostgreSQL's advisory locks: "audit" in ASCII.
_LOCK = 0x6175646974
_CHECK_AND_LOCK = f"SET CONSTRAINTS ALL IMMEDIATE; SELECT pg_advisory_xact_lock({_LOCK})"
_CHUNK = 2000
MAX_BREAKS = 20


def record(
    *,
    verb: str,
    noun: str,
    noun_id: object,
    actor: User | None = None,
    details: Mapping[str, Any] | None = None,
) -> AuditEvent:
    """Write one deed. Call it inside the transaction of the deed itself: both happen, or neither.

    `details` are texts, whole numbers, truth values, None, and lists and mappings of them; never a secret,
    never a value of a hidden ground truth. Raises `TypeError` for anything else, also for floats, which no
    two databases give back alike.
    """
    with transaction.atomic():
        [event] = _chained([(verb, noun, noun_id, details or {})], actor=actor)
        event.save(force_insert=True)
    return event


def record_many(deeds: Iterable[tuple[str, str, object, Mapping[str, Any]]]) -> None:
    """Write many deeds of the machine itself at once: verb, noun, noun_id, details."""
    columns = ["at", "verb", "noun", "noun_id", "details", "previous_hash", "hash"]
    with transaction.atomic():
        events = _chained(list(deeds), actor=None)
        bulk.insert(AuditEvent, columns, [[getattr(event, name) for name in columns] for event in events])


def _chained(
    deeds: Sequence[tuple[str, str, object, Mapping[str, Any]]], *, actor: User | None
) -> list[AuditEvent]:
    """The deeds as events that follow the last one, to be written before the transaction ends."""
    if not deeds:
        return []
    previous_hash = _locked_tip(actor)
    at = timezone.now()
    events = []
    for verb, noun, noun_id, details in deeds:
        event = AuditEvent(
            at=at,
            actor=actor,
            verb=verb,
            noun=noun,
            noun_id=_storable(str(noun_id)),
            details=_plain(details),
            previous_hash=previous_hash,
        )
        event.hash = previous_hash = event.expected_hash()
        events.append(event)
    return events


def hold(actor: User | None = None) -> None:
    """Let nobody else record until the transaction ends; to be called where it ends soon.

    Foreign keys that are checked at COMMIT would wait there, with the chain in hand, for whoever holds a row
    that they name. So those of all rows written until now are checked here, before the chain is taken; and
    that of the events to come is held: their `actor`.
    """
    if connection.vendor != "postgresql":
        # SQLite has one writer at a time: a transaction that begins IMMEDIATE is it.
        return
    with connection.cursor() as cursor:
        if actor is not None:
            cursor.execute("SELECT 1 FROM leaderboard_user WHERE id = %s FOR KEY SHARE", [actor.pk])
        cursor.execute(_CHECK_AND_LOCK)


def _locked_tip(actor: User | None) -> str:
    """The hash of the last event, which stays the last until the transaction ends."""
    hold(actor)
    return AuditEvent.objects.order_by("-pk").values_list("hash", flat=True).first() or GENESIS


def _plain(value: Any) -> Any:
    """A copy of what every database gives back as it was."""
    if isinstance(value, str):
        return _storable(value)
    if value is None or isinstance(value, bool | int):
        return value
    if isinstance(value, Mapping):
        return {_storable(str(key)): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    raise TypeError(f"details of an audit event hold {type(value).__name__}; expected texts or whole numbers")


def _storable(text: str) -> str:
    """The text without what PostgreSQL cannot keep: NUL and lone surrogates."""
    return text.replace("\x00", "�").encode("utf-8", "replace").decode()


# --- reading it ------------------------------------------------------------------------------------------


def events(
    *,
    actor: str = "",
    verb: str = "",
    noun: str = "",
    noun_id: str = "",
    since: datetime | None = None,
    until: datetime | None = None,
) -> QuerySet[AuditEvent]:
    """The events that fit, the newest first. `actor` is a part of an e-mail address; `until` is excluded."""
    wanted = {
        "actor__email__icontains": actor,
        "verb": verb,
        "noun": noun,
        "noun_id__startswith": noun_id,
        "at__gte": since,
        "at__lt": until,
    }
    given = {name: value for name, value in wanted.items() if value}
    return AuditEvent.objects.filter(**given).select_related("actor").order_by("-pk")


@dataclass(frozen=True)
class Break:
    """A place where the chain does not hold."""

    event_id: int
    what: str


@dataclass(frozen=True)
class Verification:
    """What going through the chain found: its length, its last hash, the first places that do not hold."""

    n_events: int
    tip: str
    breaks: tuple[Break, ...]


def verify(*, expected_hash: str = "") -> Verification:
    """Compute every hash anew, from the first event to the last.

    A chain whose end was cut off, or which was written anew from some event on, is sound in itself: only a
    hash that was noted elsewhere shows it. With `expected_hash`, some event has to have it.
    """
    n_events, tip, breaks = 0, GENESIS, []
    is_found = not expected_hash
    for event in AuditEvent.objects.order_by("pk").iterator(chunk_size=_CHUNK):
        if event.previous_hash != tip:
            before = f"after {n_events:,} events" if n_events else "as the first event"
            breaks.append(Break(event.pk, f"stands {before}, and follows another one: something is missing"))
        if event.hash != event.expected_hash():
            breaks.append(Break(event.pk, "says something else than when it was written"))
        is_found = is_found or event.hash == expected_hash
        n_events, tip = n_events + 1, event.hash
    if not is_found:
        breaks.append(
            Break(0, f"no event has the hash {expected_hash[:64]}: the end was cut off or rewritten")
        )
    return Verification(n_events=n_events, tip=tip, breaks=tuple(breaks[:MAX_BREAKS]))
