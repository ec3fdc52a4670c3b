"""What everybody sees of a board: read once for all readers, and kept under its version.

A board as of a time has a cache of its own: anybody can ask for any number of times.
"""

import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime
from functools import partial
from typing import Any, Final
from uuid import UUID

import msgspec
from django.core.cache import caches
from django.db import connection, transaction
from django.db.models import F, QuerySet
from django.http import HttpRequest

from evaluator.metrics.protocol import OVERALL, primary_value
from leaderboard import board_versions
from leaderboard.boards import listing
from leaderboard.boards.rows import Entry
from leaderboard.models import (
    Edition,
    Method,
    PageVersion,
    Score,
    Split,
    Status,
    Visibility,
    days,
)
from leaderboard.models.methods import MethodQuerySet


@dataclass(frozen=True, slots=True)
class Attempt:
    method_id: UUID
    submission_id: UUID
    at: datetime
    scores: Mapping[str, float | None]

    @property
    def value(self) -> float | None:
        """The score that ranks."""
        return primary_value(self.scores)


@dataclass(frozen=True)
class CurrentBoard:
    """The public rows of an edition, ranked, and its submissions, newest first."""

    entries: tuple[Entry, ...]
    attempts: tuple[Attempt, ...] = ()


_BOARD: Final = msgspec.json.Decoder(CurrentBoard)
# One thread of this process reads what another one needs as well.
_reading = threading.Lock()


# --- splits and editions: one statement ------------------------------------------------------------------


def splits() -> list[Split]:
    """Return the splits that are switched on, with published editions and versions; archived ones last."""
    rows = Split.objects.shown().order_by("position", "name").select_related("current_edition__ground_truth")
    rows = rows.annotate(**PageVersion.announcement_of_every_row(), board_number=F("board_version__number"))
    return sorted(rows, key=lambda split: split.is_archived)


def splits_of(request: HttpRequest) -> list[Split]:
    """Return `splits`, read once in a request."""
    cached: list[Split] | None = getattr(request, "splits", None)
    if cached is None:
        cached = splits()
        request.splits = cached  # type: ignore[attr-defined]  # our own, as `user` is Django's
    return cached


def site_line_of(splits: Sequence[Split], *, now: datetime) -> str:
    """Return the announcement of the site; empty once it has ended."""
    for split in splits:
        ends_at: datetime | None = getattr(split, "site_line_ends_at", None)
        if ends_at is not None and now < ends_at:
            return str(split.site_line)  # type: ignore[attr-defined]  # an annotation
    return ""


def editions() -> "QuerySet[Edition]":
    """Published editions of splits that are not switched off, with their boards' versions; to be filtered."""
    rows = (
        Edition.objects.filter(split__in=Split.objects.shown())
        .exclude(published_at=None)
        .select_related("split__current_edition__ground_truth", "ground_truth")
    )
    return rows.annotate(board_number=F("split__board_version__number"))


def _number(split: Any, edition: Any) -> int:
    """Return the version of a split's board, read with the split or the edition, or else now."""
    for row in (split, edition):
        if hasattr(row, "board_number"):
            return row.board_number or 0
    return board_versions.number_of(split.pk)


# --- reading ---------------------------------------------------------------------------------------------


def _public_rows(*, split: Split, edition: Edition | None, at: datetime | None) -> tuple[Entry, ...]:
    if at is not None:
        return _as_of(split, edition, at)
    if edition is None:
        return listing.public_rows(split=split, edition=None)
    return shown(split=split, edition=edition).entries


board = partial(listing.board, read=_public_rows)
"""The same as `listing.board`, from what is kept; `split` is of `splits()` or `editions()`."""


def _as_of(split: Split, edition: Edition | None, at: datetime) -> tuple[Entry, ...]:
    def rows() -> CurrentBoard:
        return CurrentBoard(listing.public_rows(split=split, edition=edition, at=at))

    key = f"{split.pk}:{edition and edition.pk}:{_number(split, edition)}:{at.isoformat()}"
    return _kept(key, rows, cache="views").entries


def shown(*, split: Split, edition: Edition) -> CurrentBoard:
    """Return what everybody sees of a published edition, as of now."""
    return _kept(f"rows:{edition.pk}:{_number(split, edition)}", partial(_now, edition.pk), cache="boards")


def shown_on(rows: Sequence[Split]) -> list[tuple[Split, CurrentBoard]]:
    """Return what everybody sees of each board of these rows of `splits()`."""
    with_board = [(split, split.current_edition) for split in rows if split.current_edition is not None]
    return [(split, shown(split=split, edition=edition)) for split, edition in with_board]


def _kept(key: str, read: Callable[[], CurrentBoard], *, cache: str) -> CurrentBoard:
    body: bytes | None = caches[cache].get(key)
    if body is None:
        with _reading:
            body = caches[cache].get(key) or _encoded(read)
            caches[cache].set(key, body)
    return _BOARD.decode(body)


def _encoded(read: Callable[[], CurrentBoard]) -> bytes:
    with _repeatable_read():
        return msgspec.json.encode(read())


def _now(edition_id: int) -> CurrentBoard:
    edition = Edition.objects.select_related("split__current_edition", "ground_truth").get(pk=edition_id)
    entries = listing.public_rows(split=edition.split, edition=edition)
    return CurrentBoard(entries=entries, attempts=attempts(edition, methods=Method.objects.shown()))


@contextmanager
def _repeatable_read() -> Iterator[None]:
    is_outermost = not connection.in_atomic_block
    with transaction.atomic():
        if is_outermost and connection.vendor == "postgresql":
            with connection.cursor() as cursor:
                cursor.execute("SET TRANSACTION ISOLATION LEVEL REPEATABLE READ, READ ONLY")
        # SQLite: a transaction that begins IMMEDIATE is the only writer.
        yield


def attempts(edition: Edition, *, methods: MethodQuerySet) -> tuple[Attempt, ...]:
    """Return the active, scored submissions of these methods, the newest first."""
    rows = Score.objects.filter(
        evaluation__edition=edition,
        evaluation__status=Status.SCORED,
        evaluation__submission__withdrawn_at=None,
        evaluation__submission__method__in=methods,
        ttc_range=OVERALL,
    )
    columns = (
        *("submission__method_id", "submission__method__visibility"),
        *("submission_id", "submission__submitted_at"),
    )
    by_id: dict[UUID, Attempt] = {}
    values: dict[UUID, dict[str, float | None]] = {}
    for method_id, visibility, pk, sent_at, metric, value in rows.values_list(
        *(f"evaluation__{column}" for column in columns), "metric", "value"
    ):
        if pk not in by_id:
            at = days.truncate_to_day(sent_at, is_masked=visibility == Visibility.ANONYMOUS)
            values[pk] = dict.fromkeys(edition.rules.overall_names)
            by_id[pk] = Attempt(method_id, pk, at, values[pk])
        values[pk][metric] = value
    return tuple(sorted(by_id.values(), key=lambda a: (a.at, a.submission_id.int), reverse=True))
