"""Versions of boards: a number for each split, raised in the transaction of every public change."""

import uuid
from collections.abc import Iterable
from datetime import datetime

from django.db import connection, transaction
from django.db.models import F, Sum

from leaderboard.models import (
    BoardVersion,
    Evaluation,
    PageVersion,
    Split,
    Submission,
    Visibility,
)
from leaderboard.ops import broker

# Names who changes boards among PostgreSQL's advisory locks: "board" in ASCII.
_LOCK = 0x626F617264
_CHECK_AND_LOCK = f"SET CONSTRAINTS ALL IMMEDIATE; SELECT pg_advisory_xact_lock({_LOCK})"


def bump(*split_ids: str) -> None:
    """Raise the version of these splits' boards, after all other writes of the transaction (see `lock`)."""
    lock()
    for split_id in split_ids:
        if not BoardVersion.objects.filter(split=split_id).update(number=F("number") + 1):
            BoardVersion.objects.create(split_id=split_id, number=1)
    # Workers hear of it, once for each event, to compute intervals. Robust: the rows are committed by then.
    transaction.on_commit(broker.work_off, robust=True)


def lock() -> None:
    """Prevent other changes of boards until the transaction ends.

    Foreign keys are checked first: at COMMIT they would wait for rows whose holder waits for this lock.
    """
    if not transaction.get_connection().in_atomic_block:
        raise RuntimeError("a board was changed outside of the transaction of the change")
    # SQLite has one writer at a time: a transaction that begins IMMEDIATE is it.
    if connection.vendor == "postgresql":
        with connection.cursor() as cursor:
            cursor.execute(_CHECK_AND_LOCK)


def number_of(split_id: str) -> int:
    """How often a split's boards have changed."""
    number = BoardVersion.objects.filter(split=split_id).values_list("number", flat=True).first()
    return number or 0


def sum_of_all() -> int:
    """The sum of all versions: the key of everything cached that any board appears in."""
    return BoardVersion.objects.aggregate(n=Sum("number"))["n"] or 0


def bump_all() -> None:
    """Bump every split, as when a team's name changes, which may be on each board."""
    bump(*Split.objects.order_by("name").values_list("name", flat=True))


def bump_passed_deadlines(*, now: datetime) -> int:
    """Bump each split that has opened or closed since, or whose announcement has ended. Returns how many."""
    n_bumped = 0
    site_ends_at = PageVersion.announcement().values_list("ends_at", flat=True).first()
    for split in Split.objects.all():
        times = (split.opens_at, split.closes_at, split.announcement_ends_at, site_ends_at)
        n_passed = sum(at is not None and at <= now for at in times)
        known = BoardVersion.objects.filter(split=split).values_list("n_times_passed", flat=True).first()
        if n_passed != (known or 0):
            with transaction.atomic():
                bump(split.pk)
                BoardVersion.objects.filter(split=split).update(n_times_passed=n_passed)
            n_bumped += 1
    return n_bumped


def bump_for_methods(method_ids: Iterable[uuid.UUID]) -> None:
    """Bump the splits that these methods have submissions to."""
    methods = list(method_ids)
    submissions = Submission.objects.filter(method__in=methods)
    split_ids = sorted(set(submissions.order_by().values_list("split", flat=True).distinct()))
    if methods and not split_ids:
        # On no board, and yet with a page of its own: any of the numbers will do.
        split_ids = list(Split.objects.order_by("name").values_list("name", flat=True)[:1])
    if split_ids:
        bump(*split_ids)


def bump_for_evaluations(evaluation_ids: Iterable[uuid.UUID]) -> None:
    """Bump the splits whose public boards show these evaluations; else notify workers alone."""
    # Before looking who is private: whoever shows a method holds this until it is shown.
    lock()
    shown = Evaluation.objects.filter(pk__in=list(evaluation_ids), edition__published_at__isnull=False)
    public = shown.exclude(submission__method__visibility=Visibility.PRIVATE)
    split_ids = public.order_by().values_list("edition__split", flat=True).distinct()
    bump(*sorted(split_ids))
