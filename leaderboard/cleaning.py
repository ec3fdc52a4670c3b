"""Files that no submission names: left of uploads that were refused, or whose rows were never written.

A submission's bytes are stored before its rows, so that nothing is acknowledged and then lost; the price is a
file too many now and then. Only what has not been written for a day is looked at.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Final

from django.db import transaction

from leaderboard import audit, files
from leaderboard.models import Submission

MIN_AGE: Final = timedelta(days=1)
FOLDERS: Final = ("predictions", "aligned")
_NAMED: Final = re.compile(r"([0-9a-f]{64})\.(?:json|f8)")
_BATCH: Final = 500


@dataclass(frozen=True)
class Orphan:
    """A stored file whose digest no submission has."""

    name: str
    digest: str
    size_bytes: int
    modified_at: datetime


def orphans(*, now: datetime) -> Iterator[Orphan]:
    """Prediction files, and values made from them, that no submission has named for a day.

    Raises `OSError` if the store does not answer.
    """
    for folder in FOLDERS:
        for name, digest in _without_rows(folder):
            modified_at = files.store().get_modified_time(name)
            if modified_at < now - MIN_AGE:
                yield Orphan(name, digest, files.store().size(name), modified_at)


def remove(orphan: Orphan, *, now: datetime) -> bool:
    """Remove an orphan, unless it has become a submission's meanwhile. Returns whether it was removed."""
    with transaction.atomic():
        if Submission.objects.filter(digest=orphan.digest).exists():
            return False
        # Written first, so that nothing is ever removed without a trace; undone if nothing was.
        audit.record(
            verb="removed",
            noun="File",
            noun_id=orphan.digest,
            details={"name": orphan.name, "size_bytes": orphan.size_bytes},
        )
        is_removed: bool = files.store().delete_if_older(orphan.name, now - MIN_AGE)  # type: ignore[attr-defined]  # both stores have it
        transaction.set_rollback(not is_removed)
    return is_removed


def leftovers() -> list[Path]:
    """What killed processes left of files that they were writing; a store elsewhere has none."""
    store = files.store()
    return list(store.leftovers()) if isinstance(store, files.DurableFileSystemStorage) else []


def _without_rows(folder: str) -> Iterator[tuple[str, str]]:
    """Name and digest of files in the folder's folders that no submission names, whether withdrawn or not."""
    for part in _folders(folder):
        named = {
            f"{part}/{name}": f"sha256:{match[1]}"
            for name in sorted(files.store().listdir(part)[1])
            if (match := _NAMED.fullmatch(name))
        }
        names = list(named)
        for start in range(0, len(names), _BATCH):
            batch = names[start : start + _BATCH]
            digests = [named[name] for name in batch]
            known = set(Submission.objects.filter(digest__in=digests).values_list("digest", flat=True))
            yield from ((name, named[name]) for name in batch if named[name] not in known)


def _folders(folder: str) -> list[str]:
    try:
        return [f"{folder}/{part}" for part in sorted(files.store().listdir(folder)[0])]
    except FileNotFoundError:
        # Nothing of the kind was ever kept.
        return []
