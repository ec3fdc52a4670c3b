"""The queue of comparisons: requested ones in order, then others; last those that failed, in turn."""

import math
from collections.abc import Collection, Sequence
from datetime import datetime
from typing import Any
from uuid import UUID

from django.contrib.auth.models import AnonymousUser
from django.db import transaction
from django.db.models import F, QuerySet

from leaderboard.models import Comparison, Edition, User
from leaderboard.ops import broker, rate_limits

Key = tuple[UUID, UUID]


class TooManyComparisons(Exception):
    """The account or address has had too many pairs computed within a minute."""

    code = "throttled"
    field = "m"

    def __init__(self, *, wait_s: float) -> None:
        self.retry_after_s = max(1, math.ceil(wait_s))
        super().__init__(
            "You have asked for many new comparisons in a short time; "
            f"the next ones are computed in {self.retry_after_s} s."
        )


class NewComparisons(rate_limits.Throttle):
    """The rate of new comparisons of one account or address."""

    rates, scope = "PAGE_RATES", "compare"

    def identity(self, request: Any) -> object | None:
        return request


def ask(
    *, edition: Edition, pairs: Sequence[Key], user: User | AnonymousUser, address: str, now: datetime
) -> None:
    """Queue comparisons of new pairs of evaluations. Raises `TooManyComparisons`; nothing is written then."""
    throttle = NewComparisons()
    who = f"account:{user.pk}" if user.is_authenticated else address
    if pairs and not throttle.allow_request(who):
        raise TooManyComparisons(wait_s=throttle.wait_s)
    _write(edition=edition, pairs=pairs, asked_at=now)


def add(*, edition: Edition, pairs: Sequence[Key]) -> None:
    """Queue comparisons of these pairs behind all that a user asked for."""
    _write(edition=edition, pairs=pairs, asked_at=None)


def _write(*, edition: Edition, pairs: Sequence[Key], asked_at: datetime | None) -> None:
    if not pairs:
        return
    # In one order, so that two who ask for the same pairs cannot wait for each other's rows.
    rows = [
        Comparison(edition=edition, first_id=one, second_id=two, asked_at=asked_at)
        for one, two in sorted(pairs)
    ]
    with transaction.atomic():
        if asked_at is None:
            Comparison.objects.bulk_create(rows, ignore_conflicts=True)
        else:
            Comparison.objects.bulk_create(
                rows,
                update_conflicts=True,
                unique_fields=["edition", "first", "second"],
                update_fields=["asked_at"],
            )
        transaction.on_commit(broker.work_off, robust=True)


def waiting(*, readable_truths: Collection[str]) -> QuerySet[Comparison]:
    """Return comparisons to compute, in order, whose ground truth is in `readable_truths` (digests).

    Those that were begun without a result come behind all others, so that no failure blocks another pair.
    """
    rows = Comparison.objects.filter(computed_at=None, edition__ground_truth__in=readable_truths)
    return rows.order_by(F("begun_at").asc(nulls_first=True), F("asked_at").asc(nulls_last=True), "pk")


def begin(row: Comparison, *, now: datetime) -> None:
    """Send the pair to the end of the queue, where it waits if it fails."""
    Comparison.objects.filter(pk=row.pk, computed_at=None).update(begun_at=now)
