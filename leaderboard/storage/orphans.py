"""Files that no submission names: of refused uploads, or of processes that died before they wrote the rows.

A submission's bytes are stored before its rows, so that nothing acknowledged is lost. Orphans are removed
after a day, if the store is this site's and no restore was recent (`storage.ownership`). Equal bytes are one
file, so a writer of a row locks the file and checks it, and a remover locks it alone and checks the rows.
"""

import hashlib
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Final

import structlog
from django.db import connection, transaction

from leaderboard import audit
from leaderboard.db import clock
from leaderboard.models import Submission
from leaderboard.storage import files, ownership

log = structlog.get_logger(__name__)

MIN_AGE: Final = timedelta(days=1)
FOLDERS: Final = ("predictions", "aligned")
_NAMED: Final = re.compile(r"([0-9a-f]{64})\.(?:json|f8)")
# Names the files among PostgreSQL's advisory locks: "file" in ASCII.
_LOCKS: Final = 0x66696C65


@dataclass(frozen=True)
class Orphan:
    """A stored file whose digest no submission has."""

    name: str
    digest: str
    size_bytes: int


def orphans(*, now: datetime) -> Iterator[Orphan]:
    """Yield predictions and values that no submission has named for a day, and that this site may remove.

    Raises `OSError`.
    """
    if not ownership.may_remove_files(now=now):
        return
    for folder in FOLDERS:
        for name, digest in _without_rows(folder):
            try:
                modified_at = files.store().get_modified_time(name)
                size_bytes = files.store().size(name)
            except FileNotFoundError:
                continue  # it was removed meanwhile
            if modified_at < now - MIN_AGE:
                yield Orphan(name, digest, size_bytes)


def remove(orphan: Orphan, *, now: datetime) -> bool:
    """Remove an orphan, unless it has become a submission's. Returns whether it was removed."""
    with transaction.atomic():
        if not _locked_alone(orphan.digest) or Submission.objects.filter(digest=orphan.digest).exists():
            return False
        # Written first, so that nothing is ever removed without a trace; undone if nothing was.
        audit.record(
            verb="removed",
            noun="File",
            noun_id=orphan.digest,
            details={"name": orphan.name, "size_bytes": orphan.size_bytes},
        )
        try:
            is_removed: bool = files.store().delete_if_older(orphan.name, now - MIN_AGE)  # type: ignore[attr-defined]  # both stores have it
        except FileNotFoundError:
            is_removed = False  # somebody else was first
        transaction.set_rollback(not is_removed)
    return is_removed


@contextmanager
def unless_refused(*refusals: type[Exception], digest: str) -> Iterator[None]:
    """Remove the stored file on one of these exceptions, unless a submission names it or is about to.

    Enter it before the transaction that writes the row.
    """
    try:
        yield
    except refusals:
        try:
            is_removed = ownership.may_remove_files(now=clock.database_now()) and _remove_unnamed(digest)
            log.info("refused_file", digest=digest, is_removed=is_removed)
        except OSError as fault:
            # The answer is the refusal all the same; the file is removed in a day.
            log.warning("refused_file_stays", digest=digest, reason=str(fault)[:200])
        raise


def _remove_unnamed(digest: str) -> bool:
    with transaction.atomic():
        if not _locked_alone(digest) or Submission.objects.filter(digest=digest).exists():
            return False
        files.store().delete(files.predictions_name(digest))
    return True


def lock(digest: str) -> None:
    """Prevent removal of a file of this digest until the transaction ends; the transaction's first lock."""
    # First, so that a removal never waits for a holder of other locks.
    _lock("pg_advisory_xact_lock_shared", digest)


def _locked_alone(digest: str) -> bool:
    """Lock the file alone until the transaction ends. False if another process holds it."""
    return _lock("pg_try_advisory_xact_lock", digest)


def _lock(function: str, digest: str) -> bool:
    # SQLite has one writer at a time, who holds everything alone.
    if connection.vendor != "postgresql":
        return True
    number = int.from_bytes(hashlib.sha256(digest.encode()).digest()[:4], signed=True)
    with connection.cursor() as cursor:
        cursor.execute(f"SELECT {function}(%s, %s)", [_LOCKS, number])
        return cursor.fetchone() != (False,)


def leftovers() -> list[Path]:
    """Return unfinished files of killed processes."""
    store = files.store()
    return list(store.leftovers()) if isinstance(store, files.DurableFileSystemStorage) else []


def _without_rows(folder: str) -> Iterator[tuple[str, str]]:
    """Yield name and digest of files that no submission names, withdrawn ones included."""
    known = set(Submission.objects.values_list("digest", flat=True))
    for part in files.folders_below(folder):
        named = {
            f"{part}/{name}": f"sha256:{match[1]}"
            for name in sorted(files.store().listdir(part)[1])
            if (match := _NAMED.fullmatch(name))
        }
        yield from ((name, digest) for name, digest in named.items() if digest not in known)
