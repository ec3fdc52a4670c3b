"""What `lifecycle` asks of the queue; it reads and locks rows, and writes none."""

import uuid
from collections.abc import Collection
from typing import Any

from django.db.models import QuerySet
from django.db.models.functions import Now

from leaderboard.models import Evaluation, Status


def waiting(held: Collection[str] | None) -> QuerySet[Evaluation, tuple[Any, ...]]:
    """What may be claimed, the most urgent and oldest first: pk, attempt, priority, edition. All of `held`.

    Whoever asks locks what it gets; what others have locked is left out.
    """
    # SQLite has one writer, and skips nothing.
    due = Evaluation.objects.due().select_for_update(skip_locked=True, no_key=True)
    scorable = due if held is None else due.scorable(held)
    return scorable.values_list("pk", "attempt", "priority", "edition")


def running(ids: Collection[uuid.UUID]) -> QuerySet[Evaluation, tuple[Any, ...]]:
    """Of these, what is claimed, locked: pk, attempt, lease_token, and the present time."""
    return (
        Evaluation.objects.select_for_update(no_key=True)
        .filter(pk__in=ids, status=Status.RUNNING)
        .order_by("pk")  # every batch locks in the same order, so that two cannot wait for each other
        .values_list("pk", "attempt", "lease_token", Now())
    )
