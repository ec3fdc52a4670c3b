"""Restore a backup into an empty site, and compare its digests with those of the backup."""

import os
import shutil
from dataclasses import dataclass
from pathlib import Path

from django.conf import settings
from django.core.files.base import File

from leaderboard import audit
from leaderboard.backups import contents, database
from leaderboard.backups.contents import Contents, NoBackup
from leaderboard.ops import environment
from leaderboard.storage import files
from leaderboard.submissions import receipts


@dataclass(frozen=True)
class Restored:
    """What was restored."""

    contents: Contents
    n_boards: int  # boards that were compared: none where this version is later than the backup's
    keys_away: list[dict[str, str]]  # keys of the backup with which this installation cannot check receipts


def restore(*, source: str) -> Restored:
    """Put a backup into a fresh database, file store and ground-truth directory, and verify each of them.

    The database comes last, so an interrupted restoration can be repeated. Raises `NoBackup`.
    """
    folder = contents.folder_of(source)
    kept = Contents.read(folder)
    _require_whole(folder, kept)
    database.require_known(kept)
    database.require_fresh(kept)
    private = Path(settings.GROUND_TRUTH_DIR)
    _require_no_others(private, kept)
    private.mkdir(parents=True, exist_ok=True, mode=0o700)
    for name in kept.ground_truth:
        with files.replacing(private / name) as path:
            shutil.copyfile(folder / contents.GROUND_TRUTH / name, path)
    for name in kept.files:
        with (folder / contents.FILES / name).open("rb") as file:
            files.store().save(name, File(file))
    database.load(folder / kept.database)
    return Restored(kept, _verified_boards(kept), _keys_away(kept))


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
    for path in contents.private_files():
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
    # A process without the key has one of its own, which signs nothing.
    has_key = not environment.PRODUCTION or bool(os.environ.get("TSTTC_RECEIPT_KEY"))
    here = {key["kid"] for key in receipts.public_keys()["keys"]} if has_key else set()
    return [key for key in kept.keys["keys"] if key["kid"] not in here]
