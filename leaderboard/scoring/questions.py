"""The queue of comparisons: askers take turns, and nobody's questions delay all others.

Each asker has a number of places. Askers take turns: whoever was served lets everybody go first who asks
within the next minute, however many questions they have left; within an asker's own the oldest is first.
Those who are signed in begin a minute ahead of visitors, who cannot take their places either.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final
from uuid import UUID

from django.contrib.auth.models import AnonymousUser
from django.db import transaction
from django.db.models import F, Min, QuerySet
from django.utils.crypto import salted_hmac

from leaderboard.db.clock import after
from leaderboard.models import Comparison, Edition, Question, User
from leaderboard.ops import broker

MAX_PLACES: Final = 20
# Of all visitors together, and of all who are signed in together.
MAX_WAITING: Final = 500
SIGNED_IN_AHEAD: Final = timedelta(minutes=1)
SERVED_BEHIND_S: Final = 60.0
KEPT: Final = timedelta(days=1)
Key = tuple[UUID, UUID]


class TooManyWaiting(Exception):
    """The asker's places are taken, or all are; after `retry_after_s` some are free again."""

    code = "throttled"
    field = "m"
    retry_after_s = 10


@dataclass(frozen=True)
class Asker:
    """Who asks, by a keyed hash that says nothing to anybody else."""

    name: str
    is_signed_in: bool


def asker_of(*, user: User | AnonymousUser, address: str) -> Asker:
    """The account, whatever address it comes from; else the address."""
    who = f"user {user.pk}" if user.is_authenticated else f"address {address}"
    name = salted_hmac("leaderboard.scoring.questions", who, algorithm="sha256").hexdigest()
    return Asker(name=name, is_signed_in=user.is_authenticated)


def ask(*, edition: Edition, pairs: Sequence[Key], asker: Asker, now: datetime) -> None:
    """Note that somebody waits for these pairs of evaluations, and tell the workers.

    Raises `TooManyWaiting`; nothing is noted then. What the asker waits for already takes no other place. Two
    requests at the same moment may take a few places more.
    """
    theirs = Question.objects.filter(asker=asker.name)
    has_asked = set(
        theirs.filter(comparison__edition=edition).values_list("comparison__first", "comparison__second")
    )
    # In one order, so that two who ask for the same pairs cannot wait for each other's rows.
    new = sorted(pair for pair in pairs if pair not in has_asked)
    if not new:
        return
    _require_places(theirs.count(), len(new), is_signed_in=asker.is_signed_in)
    rows = [Comparison(edition=edition, first_id=one, second_id=two, asked_at=now) for one, two in new]
    ahead = SIGNED_IN_AHEAD if asker.is_signed_in else timedelta(0)
    turn_at = theirs.aggregate(at=Min("turn_at"))["at"] or now - ahead
    with transaction.atomic():
        Comparison.objects.bulk_create(rows, ignore_conflicts=True)
        ids = {one for one, _ in new}
        there = Comparison.objects.filter(edition=edition, computed_at=None, first__in=ids).order_by("pk")
        Question.objects.bulk_create(
            [
                Question(
                    comparison=row,
                    asker=asker.name,
                    is_signed_in=asker.is_signed_in,
                    asked_at=now,
                    turn_at=turn_at,
                )
                for row in there
                if (row.first_id, row.second_id) in new
            ],
            ignore_conflicts=True,
        )
        transaction.on_commit(broker.work_off, robust=True)


def note(*, edition: Edition, pairs: Sequence[Key], now: datetime) -> None:
    """Have these pairs of evaluations compared when nothing waits that somebody asked for."""
    if not pairs:
        return
    rows = [
        Comparison(edition=edition, first_id=one, second_id=two, asked_at=now) for one, two in sorted(pairs)
    ]
    with transaction.atomic():
        Comparison.objects.bulk_create(rows, ignore_conflicts=True)
        transaction.on_commit(broker.work_off, robust=True)


def _require_places(n_taken: int, n_wanted: int, *, is_signed_in: bool) -> None:
    again = f"ask again in {TooManyWaiting.retry_after_s} s."
    if n_taken + n_wanted > MAX_PLACES:
        raise TooManyWaiting(
            f"You wait for {n_taken} comparisons and have asked for {n_wanted} more; expected at most "
            f"{MAX_PLACES} at a time. They are being computed: {again}"
        )
    n_all = Question.objects.filter(is_signed_in=is_signed_in).count()
    if n_all + n_wanted > MAX_WAITING:
        raise TooManyWaiting(
            f"Others wait for {n_all} comparisons; expected at most {MAX_WAITING} at a time. They are being "
            f"computed: {again}"
        )


def waiting(*, held: Collection[str]) -> QuerySet[Comparison]:
    """What is not computed, in the order in which it is to be, against ground truth of `held`."""
    rows = Comparison.objects.filter(computed_at=None, edition__ground_truth__in=held)
    rows = rows.annotate(turn_at=Min("questions__turn_at"))
    return rows.order_by(F("turn_at").asc(nulls_last=True), "asked_at", "pk")


def begin(row: Comparison, *, now: datetime) -> None:
    """Send the pair and those who asked for it to the end of the line, before it is computed.

    So what cannot be computed, again and again, keeps nothing else waiting.
    """
    Comparison.objects.filter(pk=row.pk, computed_at=None).update(asked_at=now)
    askers = row.questions.values_list("asker", flat=True)
    with transaction.atomic():
        # By the database's clock: a worker knows what time it was when it began a whole batch.
        _locked(Question.objects.filter(asker__in=list(askers))).update(turn_at=after(SERVED_BEHIND_S))


def end(row: Comparison) -> None:
    """Forget who asked for a pair that is computed."""
    with transaction.atomic():
        _locked(Question.objects.filter(comparison=row)).delete()


def delete_expired(*, now: datetime) -> int:
    """Forget who asked for what no worker could compute for a day. Returns how many questions that were."""
    with transaction.atomic():
        n_forgotten, _ = _locked(Question.objects.filter(asked_at__lt=now - KEPT)).delete()
    return n_forgotten


def _locked(rows: QuerySet[Question]) -> QuerySet[Question]:
    """The rows, locked in one order, so that two workers cannot wait for each other."""
    ids = rows.order_by("pk").select_for_update(no_key=True).values_list("pk", flat=True)
    return Question.objects.filter(pk__in=list(ids))
