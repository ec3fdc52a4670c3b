"""Make a backup: the tables of one moment, then every file that they name and that the folder lacks."""

import shutil
from collections.abc import Callable, Mapping
from datetime import datetime
from pathlib import Path
from typing import IO

from django.db import connection

from leaderboard import audit
from leaderboard.backups import contents, database
from leaderboard.backups.contents import Contents, NoBackup
from leaderboard.storage import files
from leaderboard.submissions import receipts


def make(*, into: str, now: datetime) -> Contents:
    """Write a backup of the whole site into a folder that is empty or has an earlier one.

    Lost files are in `missing`. Raises `NoBackup`, and `OSError`; an earlier backup then stays as it was.
    """
    contents.require_receipt_key()
    folder = contents.folder_of(into)
    former = _former(folder)
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    rows = folder / f"database-{now:%Y%m%dT%H%M%S%f}"
    rows.mkdir(mode=0o700)
    try:
        with database.one_moment():
            saved = database.save(rows)
            needed, remade = contents.named_files()
            missing = contents.missing_values()
            migrations, boards = contents.applied_migrations(), contents.board_digests()
            tip = audit.verify().tip
        kept = {name: keep(folder, name, former) for name in [*needed, *remade]}
        private = {
            path.name: _copy(folder / contents.GROUND_TRUTH / path.name, path.open)
            for path in contents.private_files()
        }
        made = Contents(
            format=contents.FORMAT,
            made_at=now.isoformat(),
            vendor=connection.vendor,
            migrations=migrations,
            database=f"{rows.name}/{saved.name}",
            database_sha256=contents.digest_at(saved),
            files={name: digest for name, digest in kept.items() if digest},
            ground_truth=private,
            missing=[*missing, *(name for name in needed if not kept[name])],
            keys=receipts.public_keys(),
            boards=boards,
            audit=tip,
        )
        made.write(folder)
    except BaseException:
        shutil.rmtree(rows)
        raise
    for old in folder.glob("database-*"):
        if old != rows:
            shutil.rmtree(old)
    return made


def _former(folder: Path) -> Mapping[str, str]:
    """Read the digests of an earlier backup. Raises `NoBackup` for another folder."""
    if (folder / contents.LIST).exists():
        return Contents.read(folder).files
    ours = {contents.FILES, contents.GROUND_TRUTH}
    try:
        names = sorted(path.name for path in folder.iterdir())
    except FileNotFoundError:
        return {}
    except NotADirectoryError:
        raise NoBackup(f"{folder} is a file; expected a folder.") from None
    # What a backup that was interrupted left is gone on with.
    others = [name for name in names if name not in ours and not name.startswith("database-")]
    if others:
        raise NoBackup(
            f"{folder} holds {others[0]!r}; expected an empty folder, or one of an earlier backup."
        )
    return {}


def keep(folder: Path, name: str, former: Mapping[str, str]) -> str:
    """Copy a file of the store unless it is there. Returns its SHA-256, or "" where it is gone."""
    target = folder / contents.FILES / name
    if name in former and contents.digest_at(target) == former[name]:
        return former[name]
    try:
        return _copy(target, lambda mode: files.store().open(name, mode))
    except FileNotFoundError:
        return ""


def _copy(target: Path, opened: Callable[[str], IO[bytes]]) -> str:
    with opened("rb") as source, files.replacing(target) as unfinished, unfinished.open("wb") as out:
        shutil.copyfileobj(source, out, files.CHUNK_BYTES)
    return contents.digest_at(target)
