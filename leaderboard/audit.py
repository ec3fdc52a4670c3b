"""The audit trail: who did what to what, when."""

from collections.abc import Iterable, Mapping
from typing import Any

from leaderboard.models import AuditEvent, User


def record(
    *,
    verb: str,
    noun: str,
    noun_id: object,
    actor: User | None = None,
    details: Mapping[str, Any] | None = None,
) -> AuditEvent:
    """Write one deed. Call it inside the transaction of the deed itself: both happen, or neither."""
    return AuditEvent.objects.create(
        verb=verb, noun=noun, noun_id=str(noun_id), actor=actor, details=dict(details or {})
    )


def record_many(deeds: Iterable[tuple[str, str, object, Mapping[str, Any]]]) -> None:
    """Write many deeds of the machine itself at once: verb, noun, noun_id, details."""
    AuditEvent.objects.bulk_create(
        AuditEvent(verb=verb, noun=noun, noun_id=str(noun_id), details=dict(details))
        for verb, noun, noun_id, details in deeds
    )
