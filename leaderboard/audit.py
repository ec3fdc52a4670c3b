"""The audit log: who did what, and when. Rows are only added, and chained by hashes later (ADR 32)."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import structlog
from django.db import IntegrityError, transaction
from django.db.models import Model, QuerySet

from leaderboard.models import AuditEvent, AuditText, SweepBeat, User
from leaderboard.models.audit import GENESIS, Unsealed

log = structlog.get_logger(__name__)

_CHUNK = 500
# Each has a savepoint, of which PostgreSQL remembers 64 of a transaction without looking them up.
_SEALED_AT_ONCE = 60
# What stands in an event for a name that is in a table of its own.
_TEXT = "text:"
_IS_TEXT = re.compile(r"text:[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}", re.ASCII)
MAX_BREAKS = 20


def record(
    *,
    verb: str,
    noun: str,
    noun_id: object,
    actor: User | None = None,
    details: Mapping[str, Any] | None = None,
    names: Mapping[str, str] | None = None,
) -> AuditEvent:
    """Write one action, in the transaction of the action itself.

    `names` can be blanked later; `details` hold no names, addresses, secrets or hidden values.
    Raises `TypeError` for what is not JSON.
    """
    noun_id = _storable(str(noun_id))
    texts = {
        name: AuditText(text=_storable(text)[:300], actor=actor, noun=noun, noun_id=noun_id)
        for name, text in (names or {}).items()
    }
    AuditText.objects.bulk_create(texts.values())
    stored = _plain(details or {}) | {name: f"{_TEXT}{row.pk}" for name, row in texts.items()}
    return AuditEvent.objects.create(verb=verb, noun=noun, noun_id=noun_id, actor=actor, details=stored)


def record_of(row: Model, verb: str, **more: Any) -> AuditEvent:
    """Write one action on a row, which its model and its key name; `more` as in `record`."""
    return record(verb=verb, noun=type(row).__name__, noun_id=row.pk, **more)


def names_in(events: Iterable[AuditEvent]) -> dict[str, str]:
    """The names that these events speak of, by their reference in `details`; blanked ones are empty."""
    values = [value for event in events for value in event.details.values()]
    refs = [value for value in values if isinstance(value, str) and value.startswith(_TEXT)]
    ids = [value.removeprefix(_TEXT) for value in refs if _IS_TEXT.fullmatch(value)]
    texts = {
        f"{_TEXT}{pk}": text for pk, text in AuditText.objects.filter(pk__in=ids).values_list("pk", "text")
    }
    return dict.fromkeys(refs, "") | texts


def blank(rows: QuerySet[AuditText]) -> int:
    """Blank these names for good. The chain stays as it is. Returns how many there were."""
    return rows.exclude(text="").update(text="")


def record_many(actions: Iterable[tuple[str, str, object, Mapping[str, Any]]]) -> None:
    """Write many actions of the machine itself at once: verb, noun, noun_id, details."""
    AuditEvent.objects.bulk_create(
        AuditEvent(verb=verb, noun=noun, noun_id=_storable(str(noun_id)), details=_plain(details))
        for verb, noun, noun_id, details in actions
    )


def _plain(value: Any) -> Any:
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
    return text.replace("\x00", "�").encode("utf-8", "replace").decode()


# --- sealing it ------------------------------------------------------------------------------------------


def seal() -> int:
    """Seal every event that is committed and not sealed yet. Returns how many; 0 if another worker seals.

    An event that the database refuses to seal keeps no other one waiting; the next call tries it again.
    """
    SweepBeat.objects.get_or_create(pk=SweepBeat.THE_ONE)
    n_sealed, after = 0, None
    while (done := _seal_some(after=after)) is not None:
        n_now, after = done
        n_sealed += n_now
    return n_sealed


def _seal_some(*, after: int | None) -> tuple[int, int] | None:
    """Seal a few events behind that id. Returns how many and the id of the last; None without any."""
    with transaction.atomic():
        # Whoever has this row is the only one who seals. SQLite has one writer at a time.
        if not SweepBeat.objects.select_for_update(skip_locked=True, no_key=True):
            return None
        waiting = AuditEvent.objects.filter(hash=None).order_by("pk")
        some = waiting if after is None else waiting.filter(pk__gt=after)
        events = list(some[:_SEALED_AT_ONCE])
        number, tip = _end_of_chain()
        n_sealed = 0
        for event in events:
            seal = {"seal_number": number + 1, "previous_hash": tip, "hash": event.hash_after(tip)}
            try:
                with transaction.atomic():
                    # Not by the model's own queryset, which refuses every change. One after the other: the
                    # database compares each seal with the one before.
                    QuerySet[AuditEvent](AuditEvent).filter(pk=event.pk).update(**seal)
            except IntegrityError:
                # Its hash is taken, or somebody else has sealed: an intruder with the application's rights.
                log.exception("audit_event_not_sealed", event_id=event.pk)
                number, tip = _end_of_chain()
                continue
            number, tip, n_sealed = number + 1, str(seal["hash"]), n_sealed + 1
    return (n_sealed, events[-1].pk) if events else None


def _end_of_chain() -> tuple[int, str]:
    last = AuditEvent.objects.exclude(hash=None).order_by("-seal_number").first()
    return (last.seal_number or 0, last.hash or "") if last else (0, GENESIS)


# --- reading it ------------------------------------------------------------------------------------------


def events(
    *,
    actor: str = "",
    verb: str = "",
    noun: str = "",
    noun_id: str = "",
    since: datetime | None = None,
    until: datetime | None = None,
    people: bool = False,
) -> QuerySet[AuditEvent]:
    """The events that fit, the newest first. `actor` is a part of an e-mail address; `until` is excluded.

    With `people`, only what people did: not what workers and commands did.
    """
    wanted = {
        "actor__email__icontains": actor,
        "verb": verb,
        "noun": noun,
        "noun_id__startswith": noun_id,
        "at__gte": since,
        "at__lt": until,
        "actor__isnull": False if people else None,
    }
    given = {name: value for name, value in wanted.items() if value not in (None, "")}
    return AuditEvent.objects.filter(**given).select_related("actor").order_by("-pk")


@dataclass(frozen=True)
class Break:
    """An event at which the chain is broken."""

    event_id: int
    what: str


@dataclass(frozen=True)
class Verification:
    """The state of the chain: its length, its last hash, the first breaks."""

    n_events: int
    tip: str
    breaks: tuple[Break, ...]
    unsealed: Unsealed


def verify(*, expected_hash: str = "") -> Verification:
    """Compute every hash again. `expected_hash`, noted elsewhere, must be the hash of some event."""
    n_events, tip, breaks = 0, GENESIS, []
    is_known = not expected_hash
    not_yet = AuditEvent.objects.unsealed()
    sealed = AuditEvent.objects.exclude(hash=None).order_by("seal_number")
    for event in sealed.iterator(chunk_size=_CHUNK):
        if event.previous_hash != tip:
            before = f"after {n_events:,} events" if n_events else "as the first event"
            breaks.append(Break(event.pk, f"stands {before}, and follows another one: something is missing"))
        if event.hash != event.hash_after(event.previous_hash or ""):
            breaks.append(Break(event.pk, "says something else than when it was written"))
        is_known = is_known or event.hash == expected_hash
        n_events, tip = n_events + 1, event.hash or ""
    if not is_known:
        breaks.append(
            Break(0, f"no event has the hash {expected_hash[:64]}: the end was cut off or rewritten")
        )
    return Verification(n_events, tip, tuple(breaks[:MAX_BREAKS]), unsealed=not_yet)
