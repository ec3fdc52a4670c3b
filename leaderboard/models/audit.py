"""Who did what to what, when: a chain in which nothing can be changed, and of which nothing can be taken."""

import hashlib
import json
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any, NoReturn

from django.db import models
from django.utils import timezone

from leaderboard.models.people import User

# What the first event follows.
GENESIS = "0" * 64


class AppendOnly(Exception):
    """Audit events are written once and stay."""

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
    """SHA-256 of the event before and of all that this one says. Never changes: old chains must hold."""
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


class AuditEventQuerySet(models.QuerySet["AuditEvent"]):
    """Reads and appends. On PostgreSQL a trigger refuses the rest as well, whoever asks for it."""

    def update(self, **kwargs: Any) -> NoReturn:
        """Refused."""
        raise AppendOnly

    def delete(self) -> NoReturn:
        """Refused."""
        raise AppendOnly

    def _update(self, values: Any) -> NoReturn:
        # What `save()` of a row that exists comes down to.
        raise AppendOnly

    def _raw_delete(self, using: str | None) -> NoReturn:
        # What deleting rows that refer to another one comes down to.
        raise AppendOnly


class AuditEvent(models.Model):
    """One deed. Written by `leaderboard.audit.record`, never changed."""

    at = models.DateTimeField(default=timezone.now, db_index=True)
    actor = models.ForeignKey(User, null=True, blank=True, on_delete=models.PROTECT, related_name="+")
    verb = models.CharField(max_length=40)
    noun = models.CharField(max_length=40)
    noun_id = models.CharField(max_length=80)
    details = models.JSONField(default=dict, blank=True)
    # Unique, so that the chain cannot fork even if two writers did not wait for each other.
    previous_hash = models.CharField(max_length=64, unique=True)
    hash = models.CharField(max_length=64, unique=True)

    objects = AuditEventQuerySet.as_manager()

    class Meta:
        ordering = ["-id"]
        # The manager that `save()` itself uses.
        base_manager_name = "objects"
        indexes = [models.Index(fields=["noun", "noun_id"], name="audit_by_noun")]

    def __str__(self) -> str:
        return f"{self.at:%Y-%m-%d %H:%M:%S} {self.verb} {self.noun} {self.noun_id}"

    def delete(self, *args: Any, **kwargs: Any) -> NoReturn:
        """Refused."""
        raise AppendOnly

    def expected_hash(self) -> str:
        """The hash that what the event says ought to have."""
        return chained_hash(
            previous_hash=self.previous_hash,
            at=self.at,
            actor_id=self.actor_id,
            verb=self.verb,
            noun=self.noun,
            noun_id=self.noun_id,
            details=self.details,
        )
