"""What everybody sees of a board, drawn once for all of its readers.

A snapshot is stamped with the number of its split (`leaderboard/boards.py`) as of which it was drawn; another
number, and it is drawn again: by a worker that was told of the change, or by the first reader who finds it.
Nobody is ever answered from an old one. Every snapshot is read from the database as of one moment, so none
mixes two; its `etag` is the digest of what it says, so that a change which nobody can see changes nothing.
"""

import hashlib
import threading
from collections import OrderedDict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from datetime import datetime, timedelta
from functools import lru_cache
from typing import Any
from uuid import UUID

import msgspec
import structlog
from django.contrib.auth.models import AnonymousUser
from django.db import connection, transaction
from django.db.models import F, FilteredRelation, Q, QuerySet
from django.utils import timezone

from leaderboard import boards, standings
from leaderboard.entries import Details, Entry, Interval
from leaderboard.filters import Filters
from leaderboard.models import Edition, Method, Score, Snapshot, Split, Status, User
from leaderboard.standings import Board

log = structlog.get_logger(__name__)

BOARD = "board"
"""The form in which the pages, the API and the exports read a board."""

# Many changes in a row are drawn once, by whoever reads next, instead of after each of them.
REDRAW_AFTER = timedelta(seconds=1)
# The sweep holds a few of the snapshots against what the database says, each after so long.
CHECK_AFTER = timedelta(minutes=2)
MAX_CHECKS = 3
_MAX_REMEMBERED = 12


@dataclass(frozen=True)
class Attempt:
    """One standing submission of a method that everybody sees, with its two overall errors."""

    method_id: UUID
    submission_id: UUID
    at: datetime
    mid: float | None = None
    rte: float | None = None


@dataclass(frozen=True)
class Drawn:
    """What everybody sees of an edition: the rows, ranked, and everything that was tried, newest first."""

    entries: tuple[Entry, ...]
    attempts: tuple[Attempt, ...] = ()

    def attempts_of(self, method_id: UUID) -> tuple[Attempt, ...]:
        """What one method tried, newest first."""
        return tuple(attempt for attempt in self.attempts if attempt.method_id == method_id)


@dataclass(frozen=True)
class Kept:
    """A snapshot as it is kept: what it says, and the digest of that."""

    version: int
    etag: str
    body: bytes


# --- finding out what holds: one statement ---------------------------------------------------------------


def splits() -> list[Split]:
    """Every split with its published edition, and with what is kept of it: a whole page's first statement."""
    return list(_stamped(Split.objects.order_by("position", "name"), "published_edition__", ""))


def editions() -> "QuerySet[Edition]":
    """Published editions with what is kept of them, to be filtered further."""
    rows = Edition.objects.exclude(published_at=None).select_related(
        "split__published_edition__ground_truth", "ground_truth"
    )
    return _stamped(rows, "", "split__")


def _stamped(rows: "QuerySet[Any]", to_edition: str, to_split: str) -> "QuerySet[Any]":
    relation = f"{to_edition}snapshots"
    if to_edition:
        rows = rows.select_related(f"{to_edition}ground_truth")
    return rows.annotate(
        kept=FilteredRelation(relation, condition=Q(**{f"{relation}__form": BOARD})),
        kept_version=F("kept__version"),
        kept_etag=F("kept__etag"),
        board_number=F(f"{to_split}board_version__number"),
    )


def _stamp(split: Split, edition: Edition) -> str:
    """The etag of what is kept of the edition, if it holds; else nothing. Asks only if it was not yet."""
    stamped: Any = next((row for row in (edition, split) if hasattr(row, "kept_etag")), None)
    if stamped is None or (stamped is split and split.published_edition_id != edition.pk):
        stamped = editions().filter(pk=edition.pk).first()
    if stamped is None or stamped.kept_version is None or stamped.kept_version != (stamped.board_number or 0):
        return ""
    return str(stamped.kept_etag)


# --- reading ---------------------------------------------------------------------------------------------


def board(
    *,
    split: Split,
    edition: Edition | None = None,
    viewer: User | AnonymousUser,
    sort: str = "rank",
    at: datetime | None = None,
    filters: Filters | None = None,
) -> Board:
    """The same as `standings.board`, from what is kept; with `at` it is drawn for this one reader."""
    standings.require_column(sort)
    frame = edition or split.published_edition
    if at is not None or frame is None:
        return standings.board(split=split, edition=edition, viewer=viewer, sort=sort, at=at, filters=filters)
    entries = shown(split=split, edition=frame).entries
    entries = standings.with_own(entries, split=split, edition=frame, viewer=viewer)
    return standings.arranged(entries, split=split, edition=frame, sort=sort, filters=filters)


def shown(*, split: Split, edition: Edition) -> Drawn:
    """What everybody sees of an edition that is or was the board, as of now."""
    etag = _stamp(split, edition)
    found = _remembered.get(etag)
    if found is None and etag:
        found = _read([edition.pk]).get(edition.pk)
    return found or _drawn_by_one(edition)


def shown_on(rows: Sequence[Split]) -> list[tuple[Split, Drawn]]:
    """What everybody sees of each of these splits' boards, where there is one; `rows` are of `splits()`."""
    with_board = [(split, split.published_edition) for split in rows if split.published_edition is not None]
    etags = {edition.pk: _stamp(split, edition) for split, edition in with_board}
    found = {pk: _remembered.get(etag) for pk, etag in etags.items()}
    unread = [pk for pk, etag in etags.items() if etag and found[pk] is None]
    if unread:
        found.update(_read(unread))
    return [(split, found[edition.pk] or _drawn_by_one(edition)) for split, edition in with_board]


def _read(edition_ids: Sequence[int]) -> dict[int, Drawn | None]:
    """What is kept of these editions; None where another version of this program wrote it."""
    rows = Snapshot.objects.filter(edition__in=edition_ids, form=BOARD)
    found = {}
    for pk, etag, body in rows.values_list("edition", "etag", "body"):
        drawn = _decoded(bytes(body))
        found[pk] = None if drawn is None else _remember(etag, drawn)
    return found


def _drawn_by_one(edition: Edition) -> Drawn:
    """Draw it, or wait for the thread of this process that does."""
    with _drawing:
        stamped = editions().get(pk=edition.pk)
        found = _remembered.get(_stamp(stamped.split, stamped))
        return found if found is not None else draw(edition)


# --- drawing ---------------------------------------------------------------------------------------------


def draw(edition: Edition) -> Drawn:
    """Draw an edition as everybody sees it now, and keep it."""
    kept, drawn = _at_present(edition)
    keep(edition=edition, form=BOARD, kept=kept)
    return _remember(kept.etag, drawn)


def _at_present(edition: Edition) -> tuple[Kept, Drawn]:
    with _one_moment():
        present = Edition.objects.select_related("split__published_edition", "ground_truth").get(
            pk=edition.pk
        )
        version = boards.number(present.split_id)
        drawn = Drawn(
            entries=standings.everybodys(split=present.split, edition=present), attempts=_attempts(present)
        )
    body = _ENCODER.encode({"shape": _shape(), "drawn": drawn})
    return Kept(version=version, etag=_digest(body), body=body), drawn


def _attempts(edition: Edition) -> tuple[Attempt, ...]:
    rows = Score.objects.filter(
        evaluation__edition=edition,
        evaluation__status=Status.SCORED,
        evaluation__submission__withdrawn_at=None,
        evaluation__submission__method__in=Method.objects.shown(),
        interval="overall",
    )
    columns = ("submission__method_id", "submission_id", "submission__submitted_at")
    found: dict[UUID, dict[str, Any]] = {}
    for method_id, pk, at, metric, value in rows.values_list(
        *(f"evaluation__{column}" for column in columns), "metric", "value"
    ):
        found.setdefault(pk, {"method_id": method_id, "submission_id": pk, "at": at})[metric] = value
    attempts = (Attempt(**said) for said in found.values())
    return tuple(sorted(attempts, key=lambda a: (a.at, a.submission_id.int), reverse=True))


@contextmanager
def _one_moment() -> Iterator[None]:
    """Everything that is read within is of the same moment, whatever is committed meanwhile."""
    is_outermost = not connection.in_atomic_block
    with transaction.atomic():
        if is_outermost and connection.vendor == "postgresql":
            with connection.cursor() as cursor:
                cursor.execute("SET TRANSACTION ISOLATION LEVEL REPEATABLE READ, READ ONLY")
        # SQLite: a transaction that begins IMMEDIATE is the only writer.
        yield


def keep(*, edition: Edition, form: str, kept: Kept) -> None:
    """Keep a form of an edition, unless a newer one is kept already."""
    values = {"version": kept.version, "body": kept.body, "etag": kept.etag, "made_at": timezone.now()}
    rows = Snapshot.objects.filter(edition=edition, form=form)
    if not rows.filter(version__lte=kept.version).update(**values):
        Snapshot.objects.bulk_create([Snapshot(edition=edition, form=form, **values)], ignore_conflicts=True)


# --- by workers, unasked ---------------------------------------------------------------------------------


def redraw(*, split_id: str, now: datetime) -> bool:
    """Draw a split's board, if nobody has since it changed. Returns whether there was anything to draw.

    One that was drawn a moment ago is left to its next reader: where changes come by the hundred, drawing
    each would be all that the workers do.
    """
    split = next((split for split in splits() if split.pk == split_id), None)
    edition = split.published_edition if split else None
    if split is None or edition is None or _stamp(split, edition):
        return False
    recent = Snapshot.objects.filter(edition=edition, form=BOARD, made_at__gt=now - REDRAW_AFTER)
    if recent.exists():
        return False
    draw(edition)
    return True


def check(*, now: datetime) -> int:
    """Draw the boards that changed, and hold some snapshots against the database. Returns how many differed.

    None should: a verb that changes what everybody sees says so. One that was changed by other means, such
    as by hand, is found here within minutes.
    """
    for split in splits():
        redraw(split_id=split.pk, now=now)
    n_differed = 0
    old = Snapshot.objects.filter(form=BOARD, made_at__lt=now - CHECK_AFTER).order_by("made_at")
    for row in old.select_related("edition").defer("body")[:MAX_CHECKS]:
        kept, _ = _at_present(row.edition)
        if kept.version == row.version and kept.etag != row.etag:
            n_differed += 1
            log.warning("snapshot_differed", split=row.edition.split_id, edition=row.edition.number)
            with transaction.atomic():
                boards.changed(row.edition.split_id)
            kept, _ = _at_present(row.edition)
        keep(edition=row.edition, form=BOARD, kept=kept)
    return n_differed


# --- bytes and memory ------------------------------------------------------------------------------------

# Sets and mappings in one order, so that what says the same has the same digest in every process.
_ENCODER = msgspec.json.Encoder(order="deterministic")
_drawing = threading.Lock()


class _Envelope(msgspec.Struct):
    shape: str
    drawn: msgspec.Raw


@lru_cache(maxsize=1)
def _shape() -> str:
    """Names what a row has: of a program that knows others, no snapshot is read."""
    known = [
        f"{kind.__name__}.{part.name}: {part.type}"
        for kind in (Drawn, Attempt, Entry, Details, Interval)
        for part in fields(kind)
    ]
    return _digest("\n".join(known).encode())


def _decoded(body: bytes) -> Drawn | None:
    """What the bytes say; None if another version of this program wrote them."""
    try:
        envelope = msgspec.json.decode(body, type=_Envelope)
        if envelope.shape != _shape():
            return None
        return msgspec.json.decode(envelope.drawn, type=Drawn)
    except msgspec.DecodeError:
        return None


def _digest(body: bytes) -> str:
    return hashlib.sha256(body).hexdigest()[:32]


class Memory:
    """What this process has read, by the digest of its content: never wrong, at worst forgotten."""

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._lock = threading.Lock()
        self._items: OrderedDict[str, Drawn] = OrderedDict()

    def get(self, etag: str) -> Drawn | None:
        """What has this digest, if it is known."""
        with self._lock:
            if etag in self._items:
                self._items.move_to_end(etag)
            return self._items.get(etag)

    def clear(self) -> None:
        """Forget everything."""
        with self._lock:
            self._items.clear()

    def put(self, etag: str, drawn: Drawn) -> None:
        """Remember it; what was not asked for longest is forgotten."""
        with self._lock:
            self._items[etag] = drawn
            while len(self._items) > self._limit:
                self._items.popitem(last=False)


_remembered = Memory(_MAX_REMEMBERED)


def _remember(etag: str, drawn: Drawn) -> Drawn:
    _remembered.put(etag, drawn)
    return drawn
