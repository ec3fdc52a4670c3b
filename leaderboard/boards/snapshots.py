"""Snapshots: the public rows of a board, drawn once for all readers.

A snapshot is stamped with the version of its split (`leaderboard/versions.py`) as of which it was drawn; with
another version it is drawn again: by a worker that was told of the change, or by the first reader to find it.
Only the page cache answers from an old one, and says so. Every snapshot is read from the database as
of one moment, so none mixes two; its `etag` is the digest of what it says, so that a change which nobody can
see changes nothing.

A board as of a time is read in the same way for whoever asks, and remembered by this process alone: there are
more times than can be kept.
"""

import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import datetime, timedelta
from functools import partial
from typing import Any
from uuid import UUID

import structlog
from django.db import connection, transaction
from django.db.models import F, QuerySet
from django.http import HttpRequest
from django.utils import timezone

from evaluator.metrics.protocol import OVERALL
from leaderboard import versions
from leaderboard.boards import boards
from leaderboard.boards.rows import Entry
from leaderboard.boards.snapshot_store import (
    Attempt,
    BoundedCache,
    CurrentBoard,
    StoredSnapshot,
    decode,
    encode,
)
from leaderboard.models import (
    Edition,
    Method,
    Score,
    SiteAnnouncement,
    Snapshot,
    Split,
    Status,
    Visibility,
    days,
)
from leaderboard.models.benchmark import Listing
from leaderboard.models.methods import MethodQuerySet

log = structlog.get_logger(__name__)

# Many changes in a row are drawn once, by whoever reads next, instead of after each of them.
REDRAW_AFTER = timedelta(seconds=1)
# The sweep holds a few of the snapshots against what the database says, each after so long.
CHECK_AFTER = timedelta(minutes=2)
MAX_CHECKS = 3

# In rows; a small board counts as many as it may grow to. Ten thousand take 50 MB.
MAX_ROWS, MIN_ROWS = 24_000, 1000


def _n_rows(_: str, known: tuple[str, CurrentBoard]) -> int:
    return min(max(len(known[1].entries), MIN_ROWS), MAX_ROWS)


# By edition, each with the digest of its content: never wrong, at worst forgotten.
snapshot_cache = BoundedCache[tuple[str, CurrentBoard]](MAX_ROWS, cost=_n_rows)
# By split, edition, number and time.
as_of_cache = BoundedCache[tuple[Entry, ...]](4)
# One thread of this process draws, the others wait for it; who asks for one of the two never for the other.
_drawing, _drawing_as_of = threading.Lock(), threading.Lock()


# --- finding out what holds: one statement ---------------------------------------------------------------


def splits() -> list[Split]:
    """The splits that are not switched off, with their published editions and with what is kept of these.

    Archived ones come last. It is a whole page's first statement.
    """
    return _shown(_all_splits())


def splits_of(request: HttpRequest) -> list[Split]:
    """The same, read once a request."""
    return _shown(_all_splits_of(request))


def site_line_of(splits: Sequence[Split], *, now: datetime) -> str:
    """The announcement of the site, as `splits_of` has read it; empty once it has ended."""
    for split in splits:
        ends_at: datetime | None = getattr(split, "site_line_ends_at", None)
        if ends_at is not None and now < ends_at:
            return str(split.site_line)  # type: ignore[attr-defined]  # an annotation
    return ""


def state_of(request: HttpRequest) -> int:
    """The sum of the versions of all boards as this request found them; see `versions.state`."""
    return versions.state_of(_all_splits_of(request))


def numbers_of(request: HttpRequest) -> dict[str, int]:
    """The version of each of them, by split."""
    return versions.numbers_of(_all_splits_of(request))


def _all_splits() -> list[Split]:
    rows = Split.objects.order_by("position", "name").select_related("published_edition__ground_truth")
    rows = rows.annotate(**SiteAnnouncement.of_every_row())
    return list(_stamped(rows, to_edition="published_edition__"))


def _all_splits_of(request: HttpRequest) -> list[Split]:
    found: list[Split] | None = getattr(request, "splits", None)
    if found is None:
        found = _all_splits()
        request.splits = found  # type: ignore[attr-defined]  # our own, as `user` is Django's
    return found


def _shown(rows: Sequence[Split]) -> list[Split]:
    shown = [split for split in rows if split.listing != Listing.OFF]
    return sorted(shown, key=lambda split: split.is_archived)


def editions() -> "QuerySet[Edition]":
    """Published editions of splits that are not switched off, with what is kept of them; to be filtered."""
    rows = (
        Edition.objects.filter(split__in=Split.objects.shown())
        .exclude(published_at=None)
        .select_related("split__published_edition__ground_truth", "ground_truth")
    )
    return _stamped(rows, to_split="split__")


def _stamped(rows: "QuerySet[Any]", *, to_edition: str = "", to_split: str = "") -> "QuerySet[Any]":
    return rows.annotate(
        kept_version=F(f"{to_edition}snapshot__version"),
        kept_etag=F(f"{to_edition}snapshot__etag"),
        board_number=F(f"{to_split}board_version__number"),
    )


def _etag(split: Split, edition: Edition) -> str:
    """The etag of what is kept of the edition, if it holds; else nothing. Asks only if it was not yet."""
    row: Any = edition
    if not hasattr(row, "kept_etag") and split.published_edition_id == edition.pk:
        row = split
    if not hasattr(row, "kept_etag"):
        row = editions().filter(pk=edition.pk).first()
    holds = row is not None and row.kept_version == (row.board_number or 0)
    return str(row.kept_etag) if holds else ""


# --- reading ---------------------------------------------------------------------------------------------


def _public_rows(*, split: Split, edition: Edition | None, at: datetime | None) -> tuple[Entry, ...]:
    if at is not None:
        return _as_of(split, edition, at)
    if edition is None:
        return boards.public_rows(split=split, edition=None)
    return shown(split=split, edition=edition).entries


board = partial(boards.board, read=_public_rows)
"""The same as `boards.board`, from what is kept; `split` is of `splits()` or `editions()`."""


def _as_of(split: Any, edition: Edition | None, at: datetime) -> tuple[Entry, ...]:
    """What everybody saw at that time, read once as long as no board of the split changes."""
    key = f"{split.pk} {edition and edition.pk} {split.board_number} {at.isoformat()}"
    found = as_of_cache.get(key)
    if found is not None:
        return found
    with _drawing_as_of:
        found = as_of_cache.get(key)
        if found is None:
            with _repeatable_read():
                found = as_of_cache.put(key, boards.public_rows(split=split, edition=edition, at=at))
    return found


def shown(*, split: Split, edition: Edition) -> CurrentBoard:
    """What everybody sees of an edition that is or was the board, as of now."""
    etag = _etag(split, edition)
    found = _known(edition.pk, etag)
    if found is None and etag:
        found = _read([edition.pk]).get(edition.pk)
    return found or _drawn_by_one(edition)


def shown_on(rows: Sequence[Split]) -> list[tuple[Split, CurrentBoard]]:
    """What everybody sees of each of these splits' boards, where there is one; `rows` are of `splits()`."""
    with_board = [(split, split.published_edition) for split in rows if split.published_edition is not None]
    etags = {edition.pk: _etag(split, edition) for split, edition in with_board}
    found = {pk: _known(pk, etag) for pk, etag in etags.items()}
    unread = [pk for pk, etag in etags.items() if etag and found[pk] is None]
    if unread:
        found.update(_read(unread))
    return [(split, found[edition.pk] or _drawn_by_one(edition)) for split, edition in with_board]


def _read(edition_ids: Sequence[int]) -> dict[int, CurrentBoard | None]:
    """What is kept of these editions; None where another version of this program wrote it."""
    rows = Snapshot.objects.filter(edition__in=edition_ids)
    found = {}
    for pk, etag, body in rows.values_list("edition", "etag", "body"):
        # Of a large board, two at a time would be twice the memory.
        snapshot_cache.forget(str(pk))
        drawn = decode(bytes(body))
        found[pk] = None if drawn is None else _remembered(pk, etag, drawn)
    return found


def _known(edition_id: int, etag: str) -> CurrentBoard | None:
    """What this process knows of an edition, if it is what this etag names."""
    found = snapshot_cache.get(str(edition_id))
    return found[1] if found is not None and found[0] == etag else None


def _remembered(edition_id: int, etag: str, drawn: CurrentBoard) -> CurrentBoard:
    return snapshot_cache.put(str(edition_id), (etag, drawn))[1]


def _drawn_by_one(edition: Edition) -> CurrentBoard:
    """Draw it, or wait for the thread of this process that does."""
    with _drawing:
        stamped = editions().get(pk=edition.pk)
        return _known(edition.pk, _etag(stamped.split, stamped)) or draw(edition)


# --- drawing ---------------------------------------------------------------------------------------------


def draw(edition: Edition) -> CurrentBoard:
    """Draw an edition as everybody sees it now, and keep it."""
    snapshot_cache.forget(str(edition.pk))
    kept, drawn = _as_of_now(edition)
    save(edition=edition, kept=kept)
    return _remembered(edition.pk, kept.etag, drawn)


def _as_of_now(edition: Edition) -> tuple[StoredSnapshot, CurrentBoard]:
    with _repeatable_read():
        rows = Edition.objects.select_related("split__published_edition", "ground_truth")
        row = rows.get(pk=edition.pk)
        version = versions.number(row.split_id)
        drawn = read(row)
    return encode(drawn, version=version), drawn


@contextmanager
def _repeatable_read() -> Iterator[None]:
    """Everything that is read within is of the same moment, whatever is committed meanwhile."""
    is_outermost = not connection.in_atomic_block
    with transaction.atomic():
        if is_outermost and connection.vendor == "postgresql":
            with connection.cursor() as cursor:
                cursor.execute("SET TRANSACTION ISOLATION LEVEL REPEATABLE READ, READ ONLY")
        # SQLite: a transaction that begins IMMEDIATE is the only writer.
        yield


def save(*, edition: Edition, kept: StoredSnapshot) -> None:
    """Keep what was drawn of an edition, unless something newer is kept already."""
    values = {"version": kept.version, "body": kept.body, "etag": kept.etag, "made_at": timezone.now()}
    if not Snapshot.objects.filter(edition=edition, version__lte=kept.version).update(**values):
        Snapshot.objects.bulk_create([Snapshot(edition=edition, **values)], ignore_conflicts=True)


# --- by workers, unasked ---------------------------------------------------------------------------------


def redraw(*, now: datetime) -> int:
    """Draw the boards that changed and that nobody has drawn since. Returns how many that were.

    One that was drawn a moment ago is left to its next reader: where changes come by the hundred, drawing
    each would be all that the workers do.
    """
    return sum(_redraw(split, now=now) for split in splits())


def _redraw(split: Split, *, now: datetime) -> bool:
    if split.published_edition is None:
        return False
    recent = Snapshot.objects.filter(edition=split.published_edition, made_at__gt=now - REDRAW_AFTER)
    if _etag(split, split.published_edition) or recent.exists():
        return False
    draw(split.published_edition)
    return True


def check(*, now: datetime) -> int:
    """Draw the boards that changed, and hold some snapshots against the database. Returns how many differed.

    None should: a verb that changes what everybody sees says so. One that was changed by other means, such
    as by hand, is found here within minutes.
    """
    redraw(now=now)
    old = Snapshot.objects.filter(made_at__lt=now - CHECK_AFTER).order_by("made_at")
    return sum(_differed(row) for row in old.select_related("edition").defer("body")[:MAX_CHECKS])


def _differed(row: Snapshot) -> bool:
    """Draw it anew. Returns whether it said something else, though nobody had said that it changed."""
    kept, _ = _as_of_now(row.edition)
    has_differed = kept.version == row.version and kept.etag != row.etag
    if has_differed:
        log.warning("snapshot_differed", split=row.edition.split_id, edition=row.edition.number)
        with transaction.atomic():
            versions.changed(row.edition.split_id)
        kept, _ = _as_of_now(row.edition)
    save(edition=row.edition, kept=kept)
    return has_differed


# --- what everybody sees now -----------------------------------------------------------------------------


def read(edition: Edition) -> CurrentBoard:
    """The edition as the database has it, which comes with its split."""
    entries = boards.public_rows(split=edition.split, edition=edition)
    return CurrentBoard(entries=entries, attempts=attempts(edition, methods=Method.objects.shown()))


def attempts(edition: Edition, *, methods: MethodQuerySet) -> tuple[Attempt, ...]:
    """The standing, scored submissions of these methods, the newest first."""
    rows = Score.objects.filter(
        evaluation__edition=edition,
        evaluation__status=Status.SCORED,
        evaluation__submission__withdrawn_at=None,
        evaluation__submission__method__in=methods,
        interval=OVERALL,
    )
    columns = (
        *("submission__method_id", "submission__method__visibility"),
        *("submission_id", "submission__submitted_at"),
    )
    found: dict[UUID, Attempt] = {}
    values: dict[UUID, dict[str, float | None]] = {}
    for method_id, visibility, pk, sent_at, metric, value in rows.values_list(
        *(f"evaluation__{column}" for column in columns), "metric", "value"
    ):
        if pk not in found:
            at = days.truncate_to_day(sent_at, is_masked=visibility == Visibility.ANONYMOUS)
            values[pk] = dict.fromkeys(edition.rules.overall_names)
            found[pk] = Attempt(method_id, pk, at, values[pk])
        values[pk][metric] = value
    return tuple(sorted(found.values(), key=lambda a: (a.at, a.submission_id.int), reverse=True))
