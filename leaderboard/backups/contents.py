"""The files of a backup next to its tables, and the list of them in its folder."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import IO, Any, Final

from django.conf import settings
from django.contrib.auth.models import AnonymousUser
from django.db import connection
from django.db.migrations.recorder import MigrationRecorder

from evaluator import archives
from evaluator.tables import formats
from leaderboard.boards import listing
from leaderboard.exports import tables
from leaderboard.models import Edition, GroundTruth, Submission
from leaderboard.storage import files, hidden_marks, seeds, truth_values
from leaderboard.storage.files import CHUNK_BYTES

LIST: Final = "backup.json"
FILES: Final = "files"
GROUND_TRUTH: Final = "ground-truth"
FORMAT: Final = 4
# Its lost files are a list of names, and it knows no damaged ones.
_FORMER_FORMAT: Final = 3
# Sums and manifests that workers make again; files named tmp… are being written at this moment.
_REMADE_FOLDER: Final = "bags"
_SHOWN: Final = 10
_STORE: Final = "the file store of a site"
_OTHER_KINDS: Final = {
    "predictions": _STORE,
    "manifests": _STORE,
    "aligned": _STORE,
    files.INCOMING: _STORE,
    "seed.key": "the ground truth of a site",
    "leaderboard.sqlite3": "the data directory of a site",
    "manage.py": "a copy of the project",
    archives.LIST: "an archive",
}


class NoBackup(Exception):
    """The backup or the restoration cannot be made; the text says why, and what to do."""


@dataclass(frozen=True)
class Contents:
    """What a backup says of itself in `backup.json`; digests by path."""

    format: int
    made_at: str
    vendor: str
    migrations: list[list[str]]
    database: str  # the file with all rows: an archive of PostgreSQL, or an SQLite database
    database_sha256: str
    files: dict[str, str]
    ground_truth: dict[str, str]
    faults: dict[str, str]  # what is wrong with files of the site, by path
    keys: dict[str, Any]
    boards: dict[str, str]
    audit: str
    known_lost: dict[str, str] = field(
        default_factory=dict
    )  # as `faults`, but a maintainer has acknowledged it

    def write(self, folder: Path) -> None:
        with files.replacing(folder / LIST) as path:
            path.write_text(json.dumps(asdict(self), indent=1) + "\n", encoding="utf-8")

    @classmethod
    def read(cls, folder: Path) -> "Contents":
        """Read the list of a folder. Raises `NoBackup`."""
        path = folder / LIST
        try:
            document = json.loads(path.read_text(encoding="utf-8"))
            if document["format"] == _FORMER_FORMAT:
                document["format"] = FORMAT
                document["faults"] = dict.fromkeys(document.pop("missing"), "is missing on the site")
            if document["format"] != FORMAT:
                raise NoBackup(f"{path} has the format {document['format']!r}; expected {FORMAT}.")
            contents = cls(**document)
            contents.require_names_inside(path)
            return contents
        except OSError as fault:
            raise NoBackup(
                f"{path} cannot be read ({fault.strerror}); expected the folder of a backup."
            ) from fault
        except (ValueError, KeyError, TypeError) as fault:
            raise NoBackup(f"{path} is damaged; expected the list that `manage.py backup` wrote.") from fault

    def require_names_inside(self, path: Path) -> None:
        """Refuse a name that leads out of its directory, so that a changed list cannot write elsewhere."""
        for name in (self.database, *self.files, *self.ground_truth):
            if name in {"", "."} or "\0" in name or name.startswith("/") or ".." in Path(name).parts:
                raise NoBackup(
                    f"{path} names {name!r}; expected a name inside of the backup. Nothing was changed."
                )


def folder_of(text: str) -> Path:
    """The folder that a command names. Raises `NoBackup` for one of the site's own."""
    folder = Path(text).resolve()
    bags = [("sums per recording", settings.BAGS_DIR)] if settings.BAGS_DIR else []
    own_folders = [("file store", settings.FILES_DIR), ("ground truth", settings.GROUND_TRUTH_DIR), *bags]
    # A link below the folder would lead there as well.
    parts = {folder, *((folder / part).resolve() for part in (FILES, GROUND_TRUTH))}
    for name, own in own_folders:
        kept = Path(own).resolve()
        for part in sorted(parts):
            if part.is_relative_to(kept) or kept.is_relative_to(part):
                raise NoBackup(f"{part} and the {name}, {kept}, lie in each other; expected a folder apart.")
    return folder


def require_no_other_kind(folder: Path) -> None:
    """Refuse a folder that is plainly something else. Other files next to a backup are no fault."""
    for name, kind in _OTHER_KINDS.items():
        if (folder / name).exists():
            raise NoBackup(f"{folder} holds {name!r}: it is {kind}; expected a folder of backups.")


def digest_of(file: IO[bytes]) -> str:
    """Return the SHA-256 of what is left to read."""
    digest = hashlib.sha256()
    while chunk := file.read(CHUNK_BYTES):
        digest.update(chunk)
    return digest.hexdigest()


def digest_at(path: Path) -> str:
    """The SHA-256 of a file's bytes; "" where there is none."""
    try:
        with path.open("rb") as file:
            return digest_of(file)
    except FileNotFoundError:
        return ""


def named_files() -> tuple[list[str], list[str]]:
    """Files of the store that rows name: those that must be there, and those that can be made again."""
    sent = list(Submission.objects.order_by().values_list("digest", "manifest_digest").distinct())
    manifests = {digest for _, digest in sent} | set(
        GroundTruth.objects.order_by().values_list("manifest_digest", flat=True)
    )
    needed = {files.predictions_name(digest) for digest, _ in sent} | {*map(files.manifest_name, manifests)}
    aligned = {files.aligned_name(manifest_digest=manifest, digest=digest) for digest, manifest in sent}
    return sorted(needed), sorted(aligned)


def private_files() -> list[Path]:
    """What the ground-truth directory holds: values, manifests, marks and the secret of hidden splits.

    Raises `OSError` if it cannot be read.
    """
    try:
        paths = sorted(Path(settings.GROUND_TRUTH_DIR).iterdir())
    except FileNotFoundError:
        return []
    kept = (path for path in paths if path.name != _REMADE_FOLDER and not path.name.startswith("tmp"))
    return [path for path in kept if path.is_file()]


def needed_private_files() -> set[Path]:
    """What the database needs of the ground-truth directory, whether or not it is there."""
    needed: set[Path] = set()
    for digest, is_hidden in GroundTruth.objects.order_by().values_list("pk", "split__is_hidden"):
        needed |= {truth_values.values_path(digest), truth_values.manifest_path(digest)}
        if is_hidden:
            needed |= {hidden_marks.path(digest), seeds.path()}
    return needed


def board_digests() -> dict[str, str]:
    """The SHA-256 of every published edition's board, as its CSV with intervals, by split and number."""
    digests = {}
    editions = Edition.objects.exclude(published_at=None).select_related("split", "ground_truth")
    for edition in editions.order_by("split", "number"):
        shown = listing.board(split=edition.split, edition=edition, viewer=AnonymousUser())
        text = formats.as_csv(tables.export(shown, address="", has_intervals=True))
        digests[f"{edition.split_id}/{edition.number}"] = hashlib.sha256(text.encode()).hexdigest()
    return digests


def applied_migrations() -> list[list[str]]:
    return sorted([app, name] for app, name in MigrationRecorder(connection).applied_migrations())


def listed(lines: list[str]) -> str:
    rest = [f"… and {len(lines) - _SHOWN:,} more"] if len(lines) > _SHOWN else []
    return "\n".join(f"  {line}" for line in [*lines[:_SHOWN], *rest])


def listed_faults(faults: Mapping[str, str]) -> str:
    return listed([f"{name} {fault}" for name, fault in sorted(faults.items())])
