"""What everybody sees of a board, drawn once for all of its readers.

A snapshot is stamped with the number of its split (`leaderboard/boards.py`) as of which it was drawn; another
number, and it is drawn again: by a worker that was told of the change, or by the first reader who finds it.
Nobody is ever answered from an old one. Every snapshot is read from the database as of one moment, so none
mixes two; its `etag` is the digest of what it says, so that a change which nobody can see changes nothing.

An edition is kept in two forms: its board as of now, and what its boards of the past are made of.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import datetime, timedelta
from typing import Any, Final, TypeVar

import structlog
from django.contrib.auth.models import AnonymousUser
from django.db import connection, transaction
from django.db.models import F, FilteredRelation, Q, QuerySet, Value
from django.utils import timezone

from leaderboard import boards, past, present, standings
from leaderboard.entries import Details, Entry, Interval, Profile
from leaderboard.filters import Filters
from leaderboard.models import Edition, Snapshot, Split, User
from leaderboard.past import Past, Quoted, Run, Shown
from leaderboard.present import Attempt, Drawn
from leaderboard.snapshot_forms import Form, Kept
from leaderboard.standings import Board

log = structlog.get_logger(__name__)
T = TypeVar("T")

# Many changes in a row are drawn once, by whoever reads next, instead of after each of them.
REDRAW_AFTER = timedelta(seconds=1)
# The sweep holds a few of the snapshots against what the database says, each after so long.
CHECK_AFTER = timedelta(minutes=2)
MAX_CHECKS = 3

BOARD: Final = Form(
    "board", Drawn, parts=[Attempt, Entry, Details, Interval], make=present.drawn, n_remembered=12
)
"""The form in which the pages, the API and the exports read a board."""

# Every attempt is in it, so it is larger, and it is asked for less.
PAST: Final = Form(
    "past", Past, parts=[Shown, Run, Quoted, Entry, Profile, Details], make=past.facts, n_remembered=4
)
"""The form of which they make the board as it stood at any time."""

FORMS: Final[Mapping[str, Form[Any]]] = {form.name: form for form in (BOARD, PAST)}


# --- finding out what holds: one statement ---------------------------------------------------------------


def splits() -> list[Split]:
    """Every split with its published edition, and with what is kept of it: a whole page's first statement."""
    return list(_stamped(Split.objects.order_by("position", "name"), "published_edition__", "", form=BOARD))


def editions() -> "QuerySet[Edition]":
    """Published editions with what is kept of them, to be filtered further."""
    return _editions(BOARD)


def edition_at(split: Split, at: datetime) -> Edition | None:
    """The same as `standings.edition_at`, with what is kept of its past."""
    rows = _editions(PAST).filter(publications__split=split, publications__at__lte=at)
    return rows.order_by("-publications__at", "-publications__pk").first()


def _editions(form: Form[T]) -> "QuerySet[Edition]":
    rows = Edition.objects.exclude(published_at=None).select_related(
        "split__published_edition__ground_truth", "ground_truth"
    )
    return _stamped(rows, "", "split__", form=form)


def _stamped(rows: "QuerySet[Any]", to_edition: str, to_split: str, *, form: Form[T]) -> "QuerySet[Any]":
    relation = f"{to_edition}snapshots"
    if to_edition:
        rows = rows.select_related(f"{to_edition}ground_truth")
    return rows.annotate(
        kept=FilteredRelation(relation, condition=Q(**{f"{relation}__form": form.name})),
        kept_form=Value(form.name),
        kept_version=F("kept__version"),
        kept_etag=F("kept__etag"),
        board_number=F(f"{to_split}board_version__number"),
    )


def _stamp(form: Form[T], split: Split, edition: Edition) -> str:
    """The etag of what is kept of the edition, if it holds; else nothing. Asks only if it was not yet."""
    stamped: Any = edition if _is_stamped(edition, form) else None
    if stamped is None and split.published_edition_id == edition.pk and _is_stamped(split, form):
        stamped = split
    if stamped is None:
        stamped = _editions(form).filter(pk=edition.pk).first()
    if stamped is None or stamped.kept_version is None or stamped.kept_version != (stamped.board_number or 0):
        return ""
    return str(stamped.kept_etag)


def _is_stamped(row: Split | Edition, form: Form[T]) -> bool:
    return getattr(row, "kept_form", None) == form.name


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
    """The same as `standings.board`, from what is kept."""
    standings.require_column(sort)
    frame = edition or (edition_at(split, at) if at else split.published_edition)
    if frame is None:
        entries = standings.everybodys(split=split, edition=None, at=at)
    elif at is None:
        entries = shown(split=split, edition=frame).entries
    else:
        entries = past.everybodys(_found(PAST, split, frame), at=at)
    entries = standings.with_own(entries, split=split, edition=frame, viewer=viewer, at=at)
    return standings.arranged(entries, split=split, edition=frame, sort=sort, at=at, filters=filters)


def shown(*, split: Split, edition: Edition) -> Drawn:
    """What everybody sees of an edition that is or was the board, as of now."""
    return _found(BOARD, split, edition)


def shown_on(rows: Sequence[Split]) -> list[tuple[Split, Drawn]]:
    """What everybody sees of each of these splits' boards, where there is one; `rows` are of `splits()`."""
    with_board = [(split, split.published_edition) for split in rows if split.published_edition is not None]
    etags = {edition.pk: _stamp(BOARD, split, edition) for split, edition in with_board}
    found = {pk: BOARD.memory.get(etag) for pk, etag in etags.items()}
    unread = [pk for pk, etag in etags.items() if etag and found[pk] is None]
    if unread:
        read = _read(BOARD, unread)
        found.update(read)
    return [(split, found[edition.pk] or _drawn_by_one(BOARD, edition)) for split, edition in with_board]


def _found(form: Form[T], split: Split, edition: Edition) -> T:
    etag = _stamp(form, split, edition)
    found = form.memory.get(etag)
    if found is None and etag:
        found = _read(form, [edition.pk]).get(edition.pk)
    return found or _drawn_by_one(form, edition)


def _read(form: Form[T], edition_ids: Sequence[int]) -> dict[int, T | None]:
    """What is kept of these editions; None where another version of this program wrote it."""
    rows = Snapshot.objects.filter(edition__in=edition_ids, form=form.name)
    found = {}
    for pk, etag, body in rows.values_list("edition", "etag", "body"):
        drawn = form.read(bytes(body))
        found[pk] = None if drawn is None else form.remember(etag, drawn)
    return found


def _drawn_by_one(form: Form[T], edition: Edition) -> T:
    """Draw it, or wait for the thread of this process that does."""
    with form.drawing:
        stamped = _editions(form).get(pk=edition.pk)
        found = form.memory.get(_stamp(form, stamped.split, stamped))
        return found if found is not None else draw(edition, form)


# --- drawing ---------------------------------------------------------------------------------------------


def draw(edition: Edition, form: Form[T]) -> T:
    """Draw an edition as everybody sees it now, and keep it."""
    kept, drawn = _at_present(edition, form)
    keep(edition=edition, form=form, kept=kept)
    return form.remember(kept.etag, drawn)


def _at_present(edition: Edition, form: Form[T]) -> tuple[Kept, T]:
    with _one_moment():
        rows = Edition.objects.select_related("split__published_edition", "ground_truth")
        row = rows.get(pk=edition.pk)
        version = boards.number(row.split_id)
        drawn = form.make(row)
    return form.kept(drawn, version=version), drawn


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


def keep(*, edition: Edition, form: Form[T], kept: Kept) -> None:
    """Keep a form of an edition, unless a newer one is kept already."""
    values = {"version": kept.version, "body": kept.body, "etag": kept.etag, "made_at": timezone.now()}
    rows = Snapshot.objects.filter(edition=edition, form=form.name)
    if not rows.filter(version__lte=kept.version).update(**values):
        row = Snapshot(edition=edition, form=form.name, **values)
        Snapshot.objects.bulk_create([row], ignore_conflicts=True)


# --- by workers, unasked ---------------------------------------------------------------------------------


def redraw(*, split_id: str, now: datetime) -> bool:
    """Draw a split's board, if nobody has since it changed. Returns whether there was anything to draw.

    What its past is made of is drawn anew if somebody has asked for it before. One that was drawn a moment
    ago is left to its next reader: where changes come by the hundred, drawing each would be all that the
    workers do.
    """
    split = next((split for split in splits() if split.pk == split_id), None)
    edition = split.published_edition if split else None
    if split is None or edition is None:
        return False
    rows = {row.form: row for row in edition.snapshots.defer("body")}
    due = [
        form
        for name, form in FORMS.items()
        if (name in rows or form is BOARD) and _is_due(rows.get(name), split, now=now)
    ]
    for form in due:
        draw(edition, form)
    return bool(due)


def _is_due(row: Snapshot | None, split: Any, *, now: datetime) -> bool:
    if row is None:
        return True
    return row.version != (split.board_number or 0) and row.made_at <= now - REDRAW_AFTER


def check(*, now: datetime) -> int:
    """Draw the boards that changed, and hold some snapshots against the database. Returns how many differed.

    None should: a verb that changes what everybody sees says so. One that was changed by other means, such
    as by hand, is found here within minutes.
    """
    for split in splits():
        redraw(split_id=split.pk, now=now)
    old = Snapshot.objects.filter(form__in=FORMS, made_at__lt=now - CHECK_AFTER).order_by("made_at")
    rows = old.select_related("edition").defer("body")[:MAX_CHECKS]
    return sum(_differed(row, FORMS[row.form]) for row in rows)


def _differed(row: Snapshot, form: Form[T]) -> bool:
    """Draw it anew. Returns whether it said something else, though nobody had said that it changed."""
    kept, _ = _at_present(row.edition, form)
    has_differed = kept.version == row.version and kept.etag != row.etag
    if has_differed:
        edition = row.edition
        log.warning("snapshot_differed", split=edition.split_id, edition=edition.number, form=form.name)
        with transaction.atomic():
            boards.changed(row.edition.split_id)
        kept, _ = _at_present(row.edition, form)
    keep(edition=row.edition, form=form, kept=kept)
    return has_differed
