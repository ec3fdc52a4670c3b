"""What a snapshot holds, its serialization, and the cache of those that a process has read."""

import gzip
import hashlib
import io
import threading
import zlib
from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from datetime import datetime
from functools import cache
from itertools import chain, islice
from typing import Generic, TypeVar
from uuid import UUID

import msgspec

from leaderboard.boards.rows import Entry, Interval
from leaderboard.methods.details import DETAILS

T = TypeVar("T")
# Sets and mappings in one order, so that what says the same has the same digest in every process. What is
# kept has scores in the order of their protocol, which readers see.
_SORTED = msgspec.json.Encoder(order="deterministic")


@dataclass(frozen=True, slots=True)
class Attempt:
    """One standing submission of a method, with its overall scores."""

    method_id: UUID
    submission_id: UUID
    at: datetime
    scores: Mapping[str, float | None]


@dataclass(frozen=True)
class CurrentBoard:
    """What everybody sees of an edition: the rows, ranked, and everything that was tried, newest first."""

    entries: tuple[Entry, ...]
    attempts: tuple[Attempt, ...] = ()


@dataclass(frozen=True)
class StoredSnapshot:
    """A snapshot as it is kept: what it says, and the digest of that."""

    version: int
    etag: str
    body: bytes


class _Header(msgspec.Struct):
    shape: str
    n_entries: int
    n_attempts: int


_PARTS = (CurrentBoard, Attempt, Entry, Interval)
_ENTRY = msgspec.json.Decoder(Entry)
_ATTEMPT = msgspec.json.Decoder(Attempt)


def encode(drawn: CurrentBoard, *, version: int) -> StoredSnapshot:
    """What was drawn, as it is kept: compressed lines, of which neither writer nor reader has all at once."""
    header = _Header(_shape(), len(drawn.entries), len(drawn.attempts))
    digest, body = hashlib.sha256(), io.BytesIO()
    with gzip.GzipFile(fileobj=body, mode="wb", compresslevel=6, mtime=0) as lines:
        for each in chain([header], drawn.entries, drawn.attempts):
            digest.update(_SORTED.encode(each) + b"\n")
            lines.write(msgspec.json.encode(each) + b"\n")
    return StoredSnapshot(version=version, etag=digest.hexdigest()[:32], body=body.getvalue())


def decode(body: bytes) -> CurrentBoard | None:
    """What the bytes say; None if another version of this program wrote them."""
    try:
        with gzip.GzipFile(fileobj=io.BytesIO(body)) as lines:
            header = msgspec.json.decode(lines.readline(), type=_Header)
            if header.shape != _shape():
                return None
            return CurrentBoard(
                entries=tuple(map(_ENTRY.decode, islice(lines, header.n_entries))),
                attempts=tuple(map(_ATTEMPT.decode, islice(lines, header.n_attempts))),
            )
    except (msgspec.DecodeError, zlib.error, EOFError, OSError):
        return None


@cache
def _shape() -> str:
    """Names what is said: of a program that knows other things, no snapshot is read."""
    known = [f"{kind.__name__}.{part.name}: {part.type}" for kind in _PARTS for part in fields(kind)]
    return _digest("\n".join([*known, *(detail.name for detail in DETAILS)]).encode())


def _digest(body: bytes) -> str:
    return hashlib.sha256(body).hexdigest()[:32]


class BoundedCache(Generic[T]):
    """What this process remembers by key, up to a total cost; what was not asked for longest is forgotten."""

    def __init__(self, limit: int, *, cost: Callable[[str, T], int] = lambda _key, _value: 1) -> None:
        self._limit, self._cost = limit, cost
        self._lock = threading.Lock()
        self._values: OrderedDict[str, T] = OrderedDict()
        self._total = 0

    def __len__(self) -> int:
        """How many values it holds."""
        return len(self._values)

    def get(self, key: str) -> T | None:
        """The value of this key, if it is known."""
        with self._lock:
            if key in self._values:
                self._values.move_to_end(key)
            return self._values.get(key)

    def put(self, key: str, value: T) -> T:
        """Remember a value, and return it."""
        with self._lock:
            self._forget(key)
            self._values[key] = value
            self._total += self._cost(key, value)
            while self._total > self._limit:
                self._forget(next(iter(self._values)))
        return value

    def forget(self, key: str) -> None:
        """Forget one value."""
        with self._lock:
            self._forget(key)

    def clear(self) -> None:
        """Forget everything."""
        with self._lock:
            self._values.clear()
            self._total = 0

    def _forget(self, key: str) -> None:
        if key in self._values:
            self._total -= self._cost(key, self._values.pop(key))
