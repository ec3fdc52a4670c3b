"""The audit log: append-only rows, sealed into a chain of hashes."""

import hashlib
import json
import uuid
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, NoReturn

from django.db import models
from django.db.models import Count, Min
from django.db.models.functions import Now
from django.utils import timezone

from leaderboard.models.people import User

# What the first event follows.
GENESIS = "0" * 64


class AppendOnly(Exception):
    """Audit events cannot be changed or deleted."""

    def __init__(self) -> None:
        super().__init__("Audit events are append-only: they are neither changed nor deleted.")


def chained_hash(
    *,
    previous_hash: str,
    at: datetime,
    actor_id: int | None,
    verb: str,
    noun: str,
    noun_id: str,
    details: Mapping[str, Any],
) -> str:
    """Hash an event and the hash before it, by SHA-256. Never change it: old chains must hold."""
    content = {
        "at": at.astimezone(UTC).isoformat(timespec="microseconds"),
        "actor": actor_id,
        "verb": verb,
        "noun": noun,
        "noun_id": noun_id,
        "details": details,
    }
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(f"{previous_hash}\n{text}".encode()).hexdigest()


@dataclass(frozen=True)
class Unsealed:
    """How many events are not sealed, and the age of the oldest."""

    n_events: int
    oldest_age_s: float


class AuditEventQuerySet(models.QuerySet["AuditEvent"]):
    # On PostgreSQL a trigger refuses changes by others too.
    def unsealed(self) -> Unsealed:
        totals = self.filter(hash=None).aggregate(n=Count("pk"), age=Now() - Min("at"))
        return Unsealed(totals["n"], max(0.0, totals["age"].total_seconds()) if totals["age"] else 0.0)

    def update(self, **kwargs: Any) -> NoReturn:
        raise AppendOnly

    def delete(self) -> NoReturn:
        raise AppendOnly

    def _update(self, values: Any) -> NoReturn:
        # What `save()` of a row that exists comes down to.
        raise AppendOnly

    def _raw_delete(self, using: str | None) -> NoReturn:
        # What deleting rows that refer to another one comes down to.
        raise AppendOnly


class AuditText(models.Model):
    """A name in an event. It can be blanked without a change of any hash."""

    id = models.UUIDField(primary_key=True, default=uuid.uuid4, editable=False)
    text = models.CharField(max_length=300, blank=True, help_text="Empty: blanked.")
    actor = models.ForeignKey(User, null=True, blank=True, on_delete=models.SET_NULL, related_name="+")
    noun = models.CharField(max_length=40)
    noun_id = models.CharField(max_length=80)

    class Meta:
        indexes = [models.Index(fields=["noun", "noun_id"], name="audit_text_by_noun")]

    def __str__(self) -> str:
        return self.text


class AuditEvent(models.Model):
    """One action. Written by `leaderboard.audit.record`, then sealed by `leaderboard.audit.seal`."""

    at = models.DateTimeField(default=timezone.now, db_index=True)
    actor = models.ForeignKey(User, null=True, blank=True, on_delete=models.PROTECT, related_name="+")
    verb = models.CharField(max_length=40)
    noun = models.CharField(max_length=40)
    noun_id = models.CharField(max_length=80)
    details = models.JSONField(default=dict, blank=True)
    # The seal: None until a worker has put the event into the chain. All three are unique, so that the chain
    # cannot fork even if two sealed at once.
    seal_number = models.PositiveBigIntegerField(null=True, unique=True, editable=False)
    previous_hash = models.CharField(  # noqa: DJ001 - unique, and an empty text is one
        max_length=64, null=True, unique=True, editable=False
    )
    hash = models.CharField(  # noqa: DJ001 - likewise
        max_length=64, null=True, unique=True, editable=False
    )

    objects = AuditEventQuerySet.as_manager()

    class Meta:
        ordering = ["-id"]
        # The manager that `save()` itself uses.
        base_manager_name = "objects"
        indexes = [
            models.Index(fields=["noun", "noun_id"], name="audit_by_noun"),
            models.Index(fields=["id"], condition=models.Q(hash=None), name="audit_unsealed"),
        ]

    def __str__(self) -> str:
        return f"{self.at:%Y-%m-%d %H:%M:%S} {self.verb} {self.noun} {self.noun_id}"

    def delete(self, *args: Any, **kwargs: Any) -> NoReturn:
        raise AppendOnly

    def hash_after(self, previous_hash: str) -> str:
        """Return the hash of this event after the one before."""
        return chained_hash(
            previous_hash=previous_hash,
            at=self.at,
            actor_id=self.actor_id,
            verb=self.verb,
            noun=self.noun,
            noun_id=self.noun_id,
            details=self.details,
        )
