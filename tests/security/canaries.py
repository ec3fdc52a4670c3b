"""Values of a ground truth that are recognised wherever they turn up, and the search for them.

Each canary is a time to contact with digits that nothing else has. It is looked for as it could be written
down: its digits, its eight bytes in either order, these in hexadecimal, and these in base64 at each of the
three places where they may begin within it.
"""

import base64
import struct
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

import numpy as np

from tests import builders

N_CANARIES = 200
# So many digits of a number are nobody else's: two published decimals have at most four.
N_DIGITS = 9
ALPHABETS = {"": base64.b64encode, " for addresses": base64.urlsafe_b64encode}


def plant(path: Path, *, n: int = 480, seed: int = 7) -> tuple[float, ...]:
    """Write a ground truth with canaries among its values, in every interval; returns them."""
    builders.truth_csv(path, n=n, n_recordings=48)
    rng = np.random.default_rng([20230901, seed])
    lines = path.read_text().splitlines()
    values = []
    for row in range(6, 6 + N_CANARIES):
        fields = lines[row].split(",")
        sign = -1.0 if fields[5].startswith("-") else 1.0
        value = float(sign * rng.uniform(0.4, 19.5))
        fields[5] = repr(value)
        lines[row] = ",".join(fields)
        values.append(value)
    path.write_text("\n".join(lines) + "\n")
    return tuple(values)


def corrected(path: Path, *, to: Path) -> None:
    """The same table with another value where no canary is: every canary is in it again."""
    lines = path.read_text().splitlines()
    for row in range(6 + N_CANARIES, len(lines), 7):
        fields = lines[row].split(",")
        fields[5] = repr(float(fields[5]) * 1.25)
        lines[row] = ",".join(fields)
    to.write_text("\n".join(lines) + "\n")


def forms(values: Iterable[float]) -> Iterator[tuple[str, bytes]]:
    """Every way in which these may be written: its name, and the bytes."""
    for value in values:
        yield "digits", digits(value)
        for order, data in (("little", struct.pack("<d", value)), ("big", struct.pack(">d", value))):
            yield f"{order}-endian bytes", data
            yield f"{order}-endian hex", data.hex().encode()
            yield f"{order}-endian HEX", data.hex().upper().encode()
            for shift in range(3):
                for alphabet, encode in ALPHABETS.items():
                    encoded = _inner(data, shift, encode(bytes(shift) + data))
                    yield f"{order}-endian base64{alphabet}, place {shift}", encoded


def digits(value: float) -> bytes:
    """The first digits of a number, as every way to print a float has them."""
    text = repr(abs(value))
    return text[: N_DIGITS + 1].encode()


def _inner(data: bytes, shift: int, encoded: bytes) -> bytes:
    """The characters of base64 that depend on the data alone, whatever is around it."""
    first = -(-8 * shift // 6)
    last = (8 * (shift + len(data))) // 6
    return encoded[first:last]


# Where a canary was found, how it was written, and what is around it.
Hit = tuple[str, str, bytes]


class Search:
    """Looks for all forms at once: by the first eight bytes of each, then the whole of it."""

    def __init__(self, values: Iterable[float]) -> None:
        self._by_key: dict[int, list[tuple[str, bytes]]] = {}
        for how, pattern in forms(values):
            assert len(pattern) >= 8, how
            self._by_key.setdefault(int.from_bytes(pattern[:8], "little"), []).append((how, pattern))
        self._keys = np.array(sorted(self._by_key), dtype="<u8")

    def in_bytes(self, data: bytes, *, where: str) -> list[Hit]:
        hits: list[Hit] = []
        for offset in range(8):
            n_words = (len(data) - offset) // 8
            if n_words <= 0:
                break
            words = np.frombuffer(data, dtype="<u8", count=n_words, offset=offset)
            indices = np.minimum(np.searchsorted(self._keys, words), len(self._keys) - 1)
            for index in np.flatnonzero(self._keys[indices] == words):
                at = offset + 8 * int(index)
                hits += [
                    (where, how, data[max(0, at - 40) : at + 40])
                    for how, pattern in self._by_key[int(words[index])]
                    if data.startswith(pattern, at)
                ]
        return hits

    def in_all(self, haystacks: Mapping[str, bytes]) -> list[Hit]:
        return [hit for where, data in haystacks.items() for hit in self.in_bytes(data, where=where)]


def files_below(directory: Path, *, but: Path) -> dict[str, bytes]:
    """Every file below a directory, but not those below another one: by its path."""
    return {
        str(path.relative_to(directory)): path.read_bytes()
        for path in sorted(directory.rglob("*"))
        if path.is_file() and but not in path.parents
    }
