"""The file store, through Django's storages: every file is named by its digest and never changes."""

import errno
import hashlib
import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import IO

import numpy as np
from django.core.files.base import ContentFile, File
from django.core.files.storage import FileSystemStorage, Storage, storages
from numpy.typing import NDArray

from evaluator import Manifest, Predictions
from leaderboard.models import SentFile

CHUNK_BYTES = 1 << 20
_DIGEST_BYTES = 32
# Web and workers may be two accounts, which share the group of the directory.
_FILE_MODE = 0o640
INCOMING = ".incoming"
LEFTOVER_S = 3600.0
FRESH = timedelta(hours=12)
"""Younger files are nobody's to clean up; see `storage.orphans`, which waits for twice as long."""


FULL = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})


class StoreUnavailable(OSError):
    """The store does not answer, or refuses us. Another try later may help."""


@contextmanager
def answering(*, may_lack: bool = True) -> Iterator[None]:
    """Raise `StoreUnavailable` for every error but a full disk and, with `may_lack`, an absent file.

    A disk that is read-only, broken, away or of another owner has many errors, and the answer is one.
    """
    try:
        yield
    except StoreUnavailable:
        raise
    except OSError as fault:
        if fault.errno in FULL or (may_lack and isinstance(fault, FileNotFoundError)):
            raise
        # Without the path: whoever asks need not know where the store is.
        reason = f"the file store does not work ({fault.strerror or type(fault).__name__})"
        raise StoreUnavailable(fault.errno or errno.EIO, reason) from fault


class Rebuildable(ContentFile):
    """Content that can be made again, so it need not be durable."""


class DurableFileSystemStorage(FileSystemStorage):
    """A local directory whose files are whole or absent, and durable before `save` returns.

    A file is written below `.incoming`, flushed, and renamed. A `Rebuildable` may be damaged by a power cut.
    """

    def get_available_name(self, name: str, max_length: int | None = None) -> str:
        # Equal names hold equal bytes.
        return name

    @answering()
    def exists(self, name: str) -> bool:
        # The file must still be there after a power cut.
        is_there = super().exists(name)
        if is_there:
            # Whoever renamed it may have been killed before the directory was on the disk.
            self._settle(Path(self.path(name)))
        return is_there

    @answering(may_lack=False)
    def _save(self, name: str, content: "File[bytes]") -> str:
        target = Path(self.path(name))
        incoming = Path(self.location) / INCOMING
        incoming.mkdir(parents=True, exist_ok=True)
        target.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=incoming)
        try:
            with os.fdopen(handle, "wb") as out:
                for chunk in content.chunks(CHUNK_BYTES):
                    out.write(chunk)
                out.flush()
                os.fchmod(out.fileno(), _FILE_MODE)
                if not isinstance(content, Rebuildable):
                    os.fsync(out.fileno())
            Path(temporary).replace(target)
        except BaseException:
            Path(temporary).unlink(missing_ok=True)
            raise
        if not isinstance(content, Rebuildable):
            self._settle(target)
        return name

    @answering()
    def _open(self, name: str, mode: str = "rb") -> "File[bytes]":
        opened = super()._open(name, mode)  # type: ignore[misc]  # Django documents it; its stubs lack it
        try:
            # A broken disk says so at the first read, when an answer may have begun already.
            os.pread(opened.fileno(), 1, 0)
        except BaseException:
            opened.close()
            raise
        return opened

    @answering()
    def delete(self, name: str) -> None:
        super().delete(name)

    @answering()
    def listdir(self, path: str) -> tuple[list[str], list[str]]:
        return super().listdir(path)

    @answering()
    def size(self, name: str) -> int:
        return super().size(name)

    @answering()
    def get_modified_time(self, name: str) -> datetime:
        return super().get_modified_time(name)

    def _settle(self, target: Path) -> None:
        """Flush the directories above a file: a rename is durable no sooner."""
        root = Path(self.location)
        for directory in target.parents:
            descriptor = os.open(directory, os.O_RDONLY)
            try:
                os.fsync(descriptor)
            finally:
                os.close(descriptor)
            if directory == root:
                return

    @answering()
    def delete_if_older(self, name: str, than: datetime) -> bool:
        """Remove a file unless it was written after `than`. Returns whether it was removed."""
        target = Path(self.path(name))
        aside = Path(self.location) / INCOMING / f"removed-{target.name}"
        aside.parent.mkdir(exist_ok=True)
        try:
            target.rename(aside)
        except FileNotFoundError:
            return False
        # Nobody writes to it under this name, so its age is certain now.
        if aside.stat().st_mtime < than.timestamp():
            aside.unlink()
            return True
        aside.replace(target)
        return False

    def leftovers(self) -> Iterator[Path]:
        """Yield unfinished files that are older than `LEFTOVER_S`, which no process still writes."""
        for entry in (Path(self.location) / INCOMING).glob("*"):
            # Another process may be tidying up too.
            with suppress(FileNotFoundError):
                if time.time() - entry.stat().st_mtime > LEFTOVER_S:
                    yield entry


@dataclass(frozen=True)
class StoredFile:
    """Digest and size of a file."""

    digest: str
    size_bytes: int


@contextmanager
def replacing(target: Path) -> Iterator[Path]:
    """Yield a private file to write, which replaces `target` once it is durable."""
    target.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    handle, temporary = tempfile.mkstemp(dir=target.parent, suffix=target.suffix)
    os.close(handle)
    try:
        yield Path(temporary)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
    # Else a power cut could leave a damaged file that is never replaced, because it is there.
    with Path(temporary).open("rb") as written:
        os.fsync(written.fileno())
    Path(temporary).replace(target)


def store() -> Storage:
    return storages["files"]


def open_named(name: str) -> "File[bytes]":
    """Open a file that a row names. Raises `OSError`, `StoreUnavailable` also if the store lacks it."""
    try:
        return store().open(name, "rb")
    except FileNotFoundError as fault:
        raise StoreUnavailable(errno.ENOENT, "the file store lacks a file that it should have") from fault


def predictions_name(digest: str) -> str:
    hexadecimal = digest.removeprefix("sha256:")
    return f"predictions/{hexadecimal[:2]}/{hexadecimal}.json"


def stored_predictions() -> Iterator[str]:
    """Yield the names of all prediction files in the store. Raises `OSError`."""
    for folder in folders_below("predictions"):
        yield from (f"{folder}/{name}" for name in store().listdir(folder)[1])


def folders_below(folder: str) -> list[str]:
    """Return the folders in a folder of the store, sorted; none where it is missing. Raises `OSError`."""
    try:
        return [f"{folder}/{part}" for part in sorted(store().listdir(folder)[0])]
    except FileNotFoundError:
        # Nothing of the kind was ever kept.
        return []


def manifest_name(digest: str) -> str:
    return f"manifests/{digest.removeprefix('sha256:')}.csv"


def measure(upload: "File[bytes]") -> StoredFile:
    """Hash and measure an upload."""
    digest = hashlib.sha256()
    size_bytes = 0
    for chunk in upload.chunks(CHUNK_BYTES):
        digest.update(chunk)
        size_bytes += len(chunk)
    return StoredFile(digest=f"sha256:{digest.hexdigest()}", size_bytes=size_bytes)


def save_predictions(
    upload: "File[bytes]", *, now: datetime, measured: StoredFile | None = None
) -> StoredFile:
    """Save an upload durably; the same bytes once. Raises `OSError` (`ENOSPC` and `EDQUOT`: full).

    Old bytes are written again, since cleaning looks for old files that no row names.
    """
    kept = measured or measure(upload)
    name = predictions_name(kept.digest)
    if not _is_fresh(name, now=now):
        upload.seek(0)
        store().save(name, upload)
    return kept


def require_unchanged(upload: "File[bytes]", *, digest: str) -> None:
    """Save an upload again if it was removed meanwhile; the caller has called `orphans.lock`."""
    name = predictions_name(digest)
    if not store().exists(name):
        upload.seek(0)
        store().save(name, upload)


def _is_fresh(name: str, *, now: datetime) -> bool:
    try:
        return store().exists(name) and store().get_modified_time(name) >= now - FRESH
    except FileNotFoundError:
        # It was cleaned up between the two questions.
        return False


def aligned_name(*, manifest_digest: str, digest: str) -> str:
    manifest = manifest_digest.removeprefix("sha256:")
    return f"aligned/{manifest[:16]}/{digest.removeprefix('sha256:')}.f8"


def save_aligned(predictions: Predictions) -> None:
    """Save values in seconds, little-endian float64 by anno_id of its manifest, after their SHA-256."""
    manifest = predictions.manifest
    name = aligned_name(manifest_digest=manifest.digest, digest=predictions.digest)
    values = predictions.ttc_s[manifest.rows_by_id].astype("<f8", copy=False).tobytes()
    if store().exists(name):
        if _checked(_read(name)) == values:
            return
        store().delete(name)
    store().save(name, Rebuildable(hashlib.sha256(values).digest() + values))


def load_aligned(file: SentFile, *, n_sequences: int) -> NDArray[np.float64] | None:
    """Load the values of a file in seconds, (n,), by anno_id of its own manifest; None if damaged."""
    values = _checked(_read(aligned_name(manifest_digest=file.manifest_digest, digest=file.digest)))
    return np.frombuffer(values, dtype="<f8") if len(values) == 8 * n_sequences else None


def _read(name: str) -> bytes:
    # A store that does not answer counts as empty: the values can be made again.
    try:
        with store().open(name, "rb") as kept:
            data: bytes = kept.read()
    except OSError:
        return b""
    return data


def _checked(data: bytes) -> bytes:
    # Values that were changed or cut off are never scored.
    digest, values = data[:_DIGEST_BYTES], data[_DIGEST_BYTES:]
    return values if hashlib.sha256(values).digest() == digest else b""


def save_manifest(manifest: Manifest) -> None:
    """Save a public manifest as CSV, once."""
    if not store().exists(manifest_name(manifest.digest)):
        store().save(manifest_name(manifest.digest), ContentFile(manifest.to_csv()))


@contextmanager
def opened_predictions(digest: str) -> Iterator[IO[bytes]]:
    """Open a prediction file with a file descriptor. Raises `OSError`, also for other bytes than were sent.

    A file that the store has damaged would else be read as one that its team has made wrong.
    """
    with open_named(predictions_name(digest)) as kept:
        with answering():
            stored = hashlib.file_digest(kept, "sha256").hexdigest()
        if f"sha256:{stored}" != digest:
            raise StoreUnavailable(
                errno.EIO, "the file store has other bytes than were sent under this digest"
            )
        kept.seek(0)
        yield kept
