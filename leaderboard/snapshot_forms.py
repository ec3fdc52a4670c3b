"""In what form an edition is kept: what is said of it, how that is written and read, what is remembered."""

import hashlib
import threading
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Generic, TypeVar

import msgspec

from evaluator.protocol import SCORE_NAMES
from leaderboard.models import Edition

T = TypeVar("T")
# Sets and mappings in one order, so that what says the same has the same digest in every process.
_ENCODER = msgspec.json.Encoder(order="deterministic")


@dataclass(frozen=True)
class Kept:
    """A snapshot as it is kept: what it says, and the digest of that."""

    version: int
    etag: str
    body: bytes


class _Envelope(msgspec.Struct):
    shape: str
    drawn: msgspec.Raw


class Memory(Generic[T]):
    """What this process has read, by the digest of its content: never wrong, at worst forgotten."""

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._lock = threading.Lock()
        self._items: OrderedDict[str, T] = OrderedDict()

    def get(self, etag: str) -> T | None:
        """What has this digest, if it is known."""
        with self._lock:
            if etag in self._items:
                self._items.move_to_end(etag)
            return self._items.get(etag)

    def clear(self) -> None:
        """Forget everything."""
        with self._lock:
            self._items.clear()

    def put(self, etag: str, drawn: T) -> None:
        """Remember it; what was not asked for longest is forgotten."""
        with self._lock:
            self._items[etag] = drawn
            while len(self._items) > self._limit:
                self._items.popitem(last=False)


class Form(Generic[T]):
    """One form in which editions are kept.

    `made` is a dataclass and `parts` are those within it; `make` reads what is said of an edition from the
    database; of so many editions as `n_remembered` this process remembers what it has read.
    """

    def __init__(
        self,
        name: str,
        made: type[T],
        *,
        parts: Sequence[type],
        make: Callable[[Edition], T],
        n_remembered: int,
    ) -> None:
        self.name = name
        self.make = make
        self.memory = Memory[T](n_remembered)
        # Of its own, so that nobody who asks for one form waits for another to be drawn.
        self.drawing = threading.Lock()
        self._made = made
        self._parts = (made, *parts)

    def kept(self, drawn: T, *, version: int) -> Kept:
        """What was drawn, as it is kept."""
        body = _ENCODER.encode({"shape": self._shape, "drawn": drawn})
        return Kept(version=version, etag=_digest(body), body=body)

    def read(self, body: bytes) -> T | None:
        """What the bytes say; None if another version of this program wrote them."""
        try:
            envelope = msgspec.json.decode(body, type=_Envelope)
            if envelope.shape != self._shape:
                return None
            return msgspec.json.decode(envelope.drawn, type=self._made)
        except msgspec.DecodeError:
            return None

    def remember(self, etag: str, drawn: T) -> T:
        """Remember what has this digest, and return it."""
        self.memory.put(etag, drawn)
        return drawn

    @cached_property
    def _shape(self) -> str:
        """Names what is said: of a program that knows other things, no snapshot is read."""
        known = [f"{kind.__name__}.{part.name}: {part.type}" for kind in self._parts for part in fields(kind)]
        return _digest("\n".join([*known, *SCORE_NAMES]).encode())


def _digest(body: bytes) -> str:
    return hashlib.sha256(body).hexdigest()[:32]
