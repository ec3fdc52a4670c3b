"""Make a backup: the tables of one moment, then every file that they name.

One bad file stops nothing: the tables and the other files are saved, and the fault is in the list.
"""

import fcntl
import os
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path
from typing import Final

import structlog
from django.db import Error as DatabaseProblem
from django.db import connection

from leaderboard import audit
from leaderboard.backups import contents, copies, database, losses
from leaderboard.backups.contents import Contents, NoBackup
from leaderboard.db import clock
from leaderboard.ops import backup_runs
from leaderboard.submissions import receipts

log = structlog.get_logger(__name__)

_ROWS: Final = re.compile(r"database-\d{8}T\d{12}")


def make(*, into: str, now: datetime) -> Contents:
    """Write a backup of the whole site into a folder, which may have an earlier one and files of others.

    The run is recorded in the database. Files that are lost, damaged or unreadable are in `faults`, those
    that a maintainer has acknowledged as lost in `known_lost`.
    Raises `NoBackup`, `OSError` and the database's error; an earlier backup then stays as it was.
    """
    run = backup_runs.begin(now)
    try:
        made = _make(into=into, now=now)
    except BaseException as fault:
        # What went wrong matters more than the record of it.
        with suppress(DatabaseProblem):
            reason = str(fault) or type(fault).__name__
            backup_runs.finish(run, now=clock.database_now(), is_ok=False, fault=reason)
        raise
    backup_runs.finish(
        run,
        now=clock.database_now(),
        is_ok=not made.faults,
        n_files=len(made.files) + len(made.ground_truth),
        n_damaged=len(made.faults),
        n_lost=len(made.known_lost),
        fault=contents.listed_faults(made.faults),
    )
    losses.forget_all_but({*made.known_lost, *made.faults})
    return made


def _make(*, into: str, now: datetime) -> Contents:
    folder = contents.folder_of(into)
    former = _former(folder)
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    with _alone_in(folder):
        rows = folder / f"database-{now:%Y%m%dT%H%M%S%f}"
        rows.mkdir(mode=0o700)
        try:
            made = _saved(folder, rows, former, now=now)
            made.write(folder)
        except BaseException:
            shutil.rmtree(rows)
            raise
        for old in folder.glob("database-*"):
            if old != rows and _ROWS.fullmatch(old.name):
                shutil.rmtree(old)
    return made


def _saved(folder: Path, rows: Path, former: Contents | None, *, now: datetime) -> Contents:
    with database.one_moment():
        saved = database.save(rows)
        needed, remade = contents.named_files()
        needed_private = contents.needed_private_files()
        migrations, boards = contents.applied_migrations(), contents.board_digests()
        tip = audit.verify().tip
    faults: dict[str, str] = {}
    try:
        private = sorted(needed_private.union(contents.private_files()))
    except OSError as fault:
        faults[contents.GROUND_TRUTH] = f"cannot be read: {fault.strerror}; expected to run where workers run"
        private = sorted(needed_private)
    kept_private, kept = {}, {}
    listed = former.ground_truth if former else {}
    for path in private:
        copy = copies.keep_private(folder, path, former=listed.get(path.name, ""), now=now)
        kept_private[path.name] = copy.digest
        if copy.fault:
            faults[f"{contents.GROUND_TRUTH}/{path.name}"] = copy.fault
    listed = former.files if former else {}
    reader = copies.StoreReader()
    for name in [*needed, *remade]:
        copy = copies.keep_stored(folder, name, former=listed.get(name, ""), reader=reader)
        kept[name] = copy.digest
        # What workers make again is no loss.
        if copy.fault and name not in remade:
            faults[name] = copy.fault
    kept_files = {name: digest for name, digest in kept.items() if digest}
    kept_truth = {name: digest for name, digest in kept_private.items() if digest}
    copied = {*kept_files, *(f"{contents.GROUND_TRUTH}/{name}" for name in kept_truth)}
    # A file of which a good copy is here is not lost.
    known_lost = losses.acknowledged() - copied
    return Contents(
        format=contents.FORMAT,
        made_at=now.isoformat(),
        vendor=connection.vendor,
        migrations=migrations,
        database=f"{rows.name}/{saved.name}",
        database_sha256=contents.digest_at(saved),
        files=kept_files,
        ground_truth=kept_truth,
        faults={name: fault for name, fault in faults.items() if name not in known_lost},
        keys=receipts.known_public_keys(),
        boards=boards,
        audit=tip,
        known_lost={name: fault for name, fault in faults.items() if name in known_lost},
    )


def _former(folder: Path) -> Contents | None:
    """Read the list of an earlier backup; None if there is none. Raises `NoBackup` for another thing."""
    if folder.exists() and not folder.is_dir():
        raise NoBackup(f"{folder} is a file; expected a folder.")
    contents.require_no_other_kind(folder)
    return Contents.read(folder) if (folder / contents.LIST).exists() else None


@contextmanager
def _alone_in(folder: Path) -> Iterator[None]:
    """Keep other backups out of the folder: one would remove the tables that the other has just saved."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise NoBackup(
                f"Another backup is being written into {folder}; expected one at a time."
            ) from None
        except OSError as fault:
            # Some network file systems have no locks; a backup without one is better than none.
            log.warning("backup_without_lock", reason=fault.strerror)
        yield
    finally:
        os.close(handle)
