"""Copies of the site's files in a backup: a good one stays, and a damaged one is never taken for good."""

import errno
import hashlib
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import IO, Final

import evaluator
from evaluator import Rejected
from leaderboard.backups import contents
from leaderboard.storage import files, seeds
from leaderboard.storage.files import StoreUnavailable

_GIVE_UP_AFTER: Final = 3
_DIGEST_BYTES: Final = 32


class _Unreadable(Exception):
    """The site's file cannot be read; the text says why."""


class _Damaged(Exception):
    """The site's file has other bytes than its name says; the text says which."""


@dataclass(frozen=True)
class Copy:
    """A file in the backup: the SHA-256 of its copy, "" without one; what is wrong with the site's file."""

    digest: str
    fault: str = ""


class StoreReader:
    """Reads files of the store. A service that has not answered some times in a row is asked no more."""

    def __init__(self) -> None:
        self._n_failures = 0
        # Of a disk, one file may fail and the next one not, and nobody waits.
        self.is_local = isinstance(files.store(), files.DurableFileSystemStorage)

    def open(self, name: str) -> IO[bytes]:
        """Open a file. Raises `OSError`."""
        self._ask()
        try:
            file: IO[bytes] = files.store().open(name, "rb")
        except StoreUnavailable:
            self._n_failures += 1
            raise
        self._n_failures = 0
        return file

    def size(self, name: str) -> int:
        """Return the size of a file in bytes. Raises `OSError`."""
        self._ask()
        try:
            size_bytes: int = files.store().size(name)
        except StoreUnavailable:
            self._n_failures += 1
            raise
        self._n_failures = 0
        return size_bytes

    def _ask(self) -> None:
        if not self.is_local and self._n_failures >= _GIVE_UP_AFTER:
            raise StoreUnavailable(errno.EIO, "the file store does not answer")


def keep_stored(folder: Path, name: str, *, former: str, reader: StoreReader) -> Copy:
    """Copy a file of the store into the backup, unless a good copy is there; `former` is the listed digest.

    On a disk the file is read each time, so that damage is found while the backup has a good copy. A service
    such as S3 checks its files itself: there, a copied file is only asked for its size.
    """
    target = folder / contents.FILES / name
    there = _good_copy(name, target, former)
    if there and not reader.is_local:
        size_bytes = target.stat().st_size
        try:
            stored_bytes = reader.size(name)
        except OSError as fault:
            return Copy(there, _kept(_reason(fault)))
        if stored_bytes != size_bytes:
            return Copy(there, _kept(f"has {stored_bytes:,} bytes; expected {size_bytes:,}"))
        return Copy(there)
    return _keep(name, target, there=there, opened=lambda: reader.open(name))


def keep_private(folder: Path, path: Path, *, former: str, now: datetime) -> Copy:
    """Copy a file of the ground truth into the backup, as `keep_stored`; an earlier content stays there."""
    target = folder / contents.GROUND_TRUTH / path.name
    there = _good_copy(path.name, target, former)
    aside = target.with_name(f"{target.name}.until-{now:%Y%m%dT%H%M%S}")
    return _keep(path.name, target, there=there, opened=lambda: path.open("rb"), aside=aside)


def _good_copy(name: str, target: Path, former: str) -> str:
    """Return the digest of the copy in the backup; "" if there is none, or if it is damaged."""
    try:
        digest, fault = examined(name, target)
    except OSError:
        return ""
    # Bytes that no name describes are compared with the list.
    is_good = not fault and (describes_bytes(name) or digest == former)
    return digest if is_good else ""


def _keep(
    name: str, target: Path, *, there: str, opened: Callable[[], IO[bytes]], aside: Path | None = None
) -> Copy:
    try:
        if there and _digest_of(opened) == there:
            return Copy(there)
        with files.replacing(target) as unfinished:
            with unfinished.open("wb") as out:
                for chunk in _chunks(opened):
                    out.write(chunk)
            digest, fault = examined(name, unfinished)
            if fault:
                raise _Damaged(fault)
            if there and aside:
                shutil.copyfile(target, aside)
                aside.chmod(0o600)
    except (_Unreadable, _Damaged) as problem:
        return Copy(there, _kept(str(problem)) if there else str(problem))
    except OSError as problem:
        return Copy(there, f"cannot be written into the backup: {problem.strerror or problem}")
    return Copy(digest)


def _digest_of(opened: Callable[[], IO[bytes]]) -> str:
    digest = hashlib.sha256()
    for chunk in _chunks(opened):
        digest.update(chunk)
    return digest.hexdigest()


def _chunks(opened: Callable[[], IO[bytes]]) -> Iterator[bytes]:
    """Yield the bytes of a file of the site. Raises `_Unreadable`, unlike for a full backup."""
    try:
        file = opened()
    except OSError as fault:
        raise _Unreadable(_reason(fault)) from fault
    with file:
        while True:
            try:
                chunk = file.read(files.CHUNK_BYTES)
            except OSError as fault:
                raise _Unreadable(_reason(fault)) from fault
            if not chunk:
                return
            yield chunk


def _reason(fault: OSError) -> str:
    if isinstance(fault, FileNotFoundError):
        return "is missing on the site"
    # The store's own error hides the file system's.
    cause = fault.__cause__ if isinstance(fault.__cause__, OSError) else fault
    return f"cannot be read on the site: {cause.strerror or cause}"


def _kept(reason: str) -> str:
    return f"{reason}; the backup keeps its good copy"


# --- what a name says of the bytes --------------------------------------------------------------------------


def describes_bytes(name: str) -> bool:
    """Tell whether the bytes of this file can be compared with its name or with themselves."""
    return name.startswith(("predictions/", "manifests/", "aligned/")) or name.endswith(".npz")


def examined(name: str, path: Path) -> tuple[str, str]:
    """Return the SHA-256 of a file, and what is wrong with its bytes; "" for nothing. Raises `OSError`."""
    with path.open("rb") as file:
        digest = contents.digest_of(file)
    stem = Path(name).name.partition(".")[0]
    if name.startswith("predictions/"):
        content_digest = digest
    elif name.startswith("aligned/"):
        # These bytes begin with their own digest.
        data = path.read_bytes()
        is_whole = hashlib.sha256(data[_DIGEST_BYTES:]).digest() == data[:_DIGEST_BYTES]
        return digest, "" if is_whole else "is damaged: its bytes have another digest than it says"
    elif name == seeds.path().name:
        return digest, _fault_of_seed(path)
    elif name.startswith("manifests/") or name.endswith(".npz"):
        try:
            content_digest = _content_digest(name, path)
        except Rejected as fault:
            return digest, f"is damaged: {fault}"
        if name.endswith(".manifest.npz"):
            return digest, ""  # it has the name of its ground truth, and has shown its own digest to be right
    else:
        return digest, ""
    return (
        digest,
        "" if content_digest == stem else f"is damaged: its content has the digest {content_digest[:12]}…",
    )


def _content_digest(name: str, path: Path) -> str:
    if name.startswith("manifests/"):
        content_digest = evaluator.read_manifest(path).digest
    elif name.endswith(".manifest.npz"):
        content_digest = evaluator.Manifest.load(path).digest
    else:
        content_digest = evaluator.GroundTruth.load(path).digest
    return content_digest.removeprefix("sha256:")


def _fault_of_seed(path: Path) -> str:
    try:
        n_bytes = len(bytes.fromhex(path.read_text(encoding="ascii")))
    except ValueError:
        n_bytes = 0
    expected = seeds.N_BYTES
    return "" if n_bytes == expected else f"is damaged: found {n_bytes} bytes, expected {expected}"
