"""Restore a backup into an empty site, and compare its digests with those of the backup."""

import shutil
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from django.conf import settings
from django.contrib.sessions.models import Session
from django.core.files.base import File

from leaderboard import audit
from leaderboard.backups import contents, database
from leaderboard.backups.contents import Contents, NoBackup
from leaderboard.models import BackupRun
from leaderboard.storage import files, ownership
from leaderboard.submissions import receipts


@dataclass(frozen=True)
class Restored:
    """What was restored."""

    contents: Contents
    store_is_of: str  # whose the file store is, if not this site's; it is not cleaned then
    kept_until: datetime  # until then no file is removed, since a newer database may name it
    n_boards: int  # boards that were compared: none where this version is later than the backup's
    keys_away: list[dict[str, str]]  # keys of the backup with which this installation cannot check receipts


def restore(*, source: str, now: datetime) -> Restored:
    """Put a backup into a fresh database, file store and ground-truth directory, and verify each of them.

    The database comes last, so an interrupted restoration can be repeated. It becomes another site than
    the one that was backed up (`storage.ownership`), and its sessions end. Raises `NoBackup`.
    """
    folder = contents.folder_of(source)
    kept = Contents.read(folder)
    _require_whole(folder, kept)
    database.require_known(kept)
    database.require_fresh(kept)
    private = Path(settings.GROUND_TRUTH_DIR)
    _require_no_others(private, kept)
    is_new_store = _is_new_store(kept)
    private.mkdir(parents=True, exist_ok=True, mode=0o700)
    for name in kept.ground_truth:
        with files.replacing(private / name) as path:
            shutil.copyfile(folder / contents.GROUND_TRUTH / name, path)
    for name in kept.files:
        with (folder / contents.FILES / name).open("rb") as file:
            files.store().save(name, File(file))
    database.load(folder / kept.database)
    # Before anything is compared: whatever differs, no file may be removed soon.
    site = ownership.note_restore(now=now)
    # Who has signed out since, or has another password now, is not let in by what the browser kept.
    Session.objects.all().delete()
    # The run that made the backup had not ended yet; else it would count as one that was killed.
    BackupRun.objects.filter(finished_at=None).delete()
    store_is_of = ownership.take_if_new(site, is_new=is_new_store)
    return Restored(kept, store_is_of, ownership.kept_until(now), _verified_boards(kept), _keys_away(kept))


def _is_new_store(kept: Contents) -> bool:
    """Tell whether the store has no prediction file but those of the backup."""
    return all(name in kept.files for name in files.stored_predictions())


def _require_whole(folder: Path, kept: Contents) -> None:
    wanted = {
        kept.database: kept.database_sha256,
        **{f"{contents.FILES}/{name}": digest for name, digest in kept.files.items()},
        **{f"{contents.GROUND_TRUTH}/{name}": digest for name, digest in kept.ground_truth.items()},
    }
    damaged = [name for name, digest in wanted.items() if contents.digest_at(folder / name) != digest]
    if damaged:
        raise NoBackup(
            f"The backup is damaged; nothing was changed. {len(damaged):,} of {len(wanted):,} files are "
            f"missing or have other bytes:\n{contents.listed(damaged)}"
        )


def _require_no_others(private: Path, kept: Contents) -> None:
    # A secret of another site would be replaced.
    try:
        paths = contents.private_files()
    except OSError as fault:
        raise NoBackup(f"{private} cannot be read ({fault.strerror}). Nothing was changed.") from fault
    for path in paths:
        if contents.digest_at(path) != kept.ground_truth.get(path.name):
            raise NoBackup(
                f"{private} holds {path.name}, which the backup does not have like that; expected an empty "
                "directory. Nothing was changed."
            )


def _verified_boards(kept: Contents) -> int:
    """Compare files, audit log and boards with the backup. Returns how many boards; raises `NoBackup`."""
    faults = []
    for name, digest in kept.files.items():
        with files.store().open(name, "rb") as file:
            if contents.digest_of(file) != digest:
                faults.append(f"{contents.FILES}/{name} has other bytes")
    trail = audit.verify(expected_hash=kept.audit if int(kept.audit, 16) else "")
    faults += [f"the audit log: {each.what}" for each in trail.breaks]
    is_same_version = kept.migrations == contents.applied_migrations()
    if is_same_version:
        boards = contents.board_digests()
        changed = [name for name in {*kept.boards, *boards} if kept.boards.get(name) != boards.get(name)]
        faults += [f"the board {name} is not what it was" for name in sorted(changed)]
    if faults:
        raise NoBackup(f"What was restored is not what was saved:\n{contents.listed(faults)}")
    return len(kept.boards) if is_same_version else 0


def _keys_away(kept: Contents) -> list[dict[str, str]]:
    here = {key["kid"] for key in receipts.known_public_keys()["keys"]}
    return [key for key in kept.keys["keys"] if key["kid"] not in here]
