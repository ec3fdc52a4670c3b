"""The files of a backup next to its tables, and the list of them in its folder."""

import hashlib
import json
import os
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO, Any, Final

from django.conf import settings
from django.contrib.auth.models import AnonymousUser
from django.db import connection
from django.db.migrations.recorder import MigrationRecorder

from evaluator.tables import formats
from leaderboard.boards import listing
from leaderboard.exports import tables
from leaderboard.models import Edition, GroundTruth, Submission
from leaderboard.ops import environment
from leaderboard.storage import files, truth_values
from leaderboard.storage.files import CHUNK_BYTES

LIST: Final = "backup.json"
FILES: Final = "files"
GROUND_TRUTH: Final = "ground-truth"
FORMAT: Final = 3
# Sums and manifests that workers make again; files named tmp… are being written at this moment.
_REMADE_FOLDER: Final = "bags"
_SHOWN: Final = 10
_KEY: Final = "TSTTC_RECEIPT_KEY"


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
    missing: list[str]
    keys: dict[str, Any]
    boards: dict[str, str]
    audit: str

    def write(self, folder: Path) -> None:
        with files.replacing(folder / LIST) as path:
            path.write_text(json.dumps(asdict(self), indent=1) + "\n", encoding="utf-8")

    @classmethod
    def read(cls, folder: Path) -> "Contents":
        """Read the list of a folder. Raises `NoBackup`."""
        path = folder / LIST
        try:
            document = json.loads(path.read_text(encoding="utf-8"))
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
    for name, own in (("file store", settings.FILES_DIR), ("ground truth", settings.GROUND_TRUTH_DIR)):
        kept = Path(own).resolve()
        if folder.is_relative_to(kept) or kept.is_relative_to(folder):
            raise NoBackup(f"{folder} and the {name}, {kept}, lie in each other; expected a folder apart.")
    return folder


def require_receipt_key() -> None:
    """Refuse a process of the site without the key of receipts. Raises `NoBackup`."""
    if environment.PRODUCTION and not os.environ.get(_KEY):
        raise NoBackup(f"{_KEY} is not set; expected it here too, since its public half is written.")


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


def private_files() -> Iterator[Path]:
    """What the ground-truth directory holds: values, manifests, marks and the secret of hidden splits."""
    try:
        paths = sorted(Path(settings.GROUND_TRUTH_DIR).iterdir())
    except FileNotFoundError:
        return
    except OSError as fault:
        raise NoBackup(
            f"The ground truth at {settings.GROUND_TRUTH_DIR} cannot be read ({fault.strerror}); "
            "expected to run where workers run."
        ) from fault
    for path in paths:
        if path.name != _REMADE_FOLDER and path.is_file() and not path.name.startswith("tmp"):
            yield path


def missing_values() -> list[str]:
    """Ground truths of the database whose values are not in the directory, by file name."""
    digests = GroundTruth.objects.order_by("pk").values_list("pk", flat=True)
    paths = (truth_values.values_path(digest) for digest in digests)
    return [f"{GROUND_TRUTH}/{path.name}" for path in paths if not path.exists()]


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


def listed(names: list[str]) -> str:
    rest = [f"… and {len(names) - _SHOWN:,} more"] if len(names) > _SHOWN else []
    return "\n".join(f"  {line}" for line in [*names[:_SHOWN], *rest])
