"""Pickles that ask for nothing forbidden and cost all the more: they nest, copy, collide and exaggerate.

The sizes are just large enough for a reader without bounds to die, or to take gigabytes or minutes.
"""

import struct
from collections.abc import Callable, Iterator
from typing import Final

PRIME: Final = 2**61 - 1  # Python's hash of a whole number is what is left of it after division by this
MANY: Final = 2_000
VERY_MANY: Final = 50_000
N_MEMBERS: Final = 30_000
DEPTH: Final = 150_000


def name(module: str, attribute: str) -> bytes:
    """Put a name on the stack."""
    return text(module) + text(attribute) + b"\x93"


def text(value: str) -> bytes:
    """Put a text of up to 4 GB on the stack."""
    data = value.encode()
    return b"X" + struct.pack("<I", len(data)) + data


def number(value: int) -> bytes:
    """Put a whole number on the stack."""
    data = value.to_bytes(value.bit_length() // 8 + 1, "little", signed=True)
    return b"\x8a" + bytes([len(data)]) + data


def remembered(value: bytes) -> bytes:
    """Make a value, remember it as number 0, and take it off the stack."""
    return value + b"q\x000"


def whole(body: bytes) -> bytes:
    """A pickle of protocol 4 that leaves an empty list."""
    return b"\x80\x04" + body + b"]."


def called(function: bytes, n_times: int, *, after: bytes = b"") -> bytes:
    """Call a function `n_times` with the value that is remembered as number 0."""
    return remembered(function).replace(b"q\x00", b"q\x01") + (b"h\x01h\x00\x85R" + after) * n_times


NESTED: Final = b")" + b"\x85" * DEPTH
LIST: Final = b"](" + b"N" * N_MEMBERS + b"e"
DICTIONARY: Final = b"}(" + b"".join(number(key) + b"N" for key in range(N_MEMBERS)) + b"u"
DTYPE: Final = name("numpy", "dtype") + text("f8") + b"\x85R"
ARRAY: Final = (
    name("numpy.core.multiarray", "_reconstruct") + name("numpy", "ndarray") + b"K\x00\x85C\x01b\x87R"
)


def colliding(n_keys: int) -> Iterator[bytes]:
    """Whole numbers that all have the hash 0, each with a value."""
    return (number(k * PRIME) + b"N" for k in range(1, n_keys + 1))


HOSTILE: Final[dict[str, Callable[[], bytes]]] = {
    "nested tuple as a key": lambda: whole(b"}" + NESTED + b"Ns"),
    "one list copied and kept": lambda: whole(remembered(LIST) + called(name("builtins", "list"), MANY)),
    "one dictionary copied and dropped": lambda: whole(
        remembered(DICTIONARY) + called(name("builtins", "dict"), 4 * VERY_MANY, after=b"0")
    ),
    "one dictionary as the state of many": lambda: whole(
        remembered(DICTIONARY) + (name("foo", "EasyDict") + b")Rh\x00b0") * VERY_MANY
    ),
    "arrays of one large content": lambda: whole(
        remembered(b"B" + struct.pack("<I", 2**20) + bytes(2**20))
        + (ARRAY + b"(K\x01" + number(2**17) + b"\x85" + DTYPE + b"\x89h\x00tb") * MANY
    ),
    "an array with a shape of large numbers": lambda: whole(
        remembered(b"(" + (b"\x8b" + struct.pack("<i", 200_000) + b"\x7f" * 200_000) * 8 + b"t")
        + (ARRAY + b"(K\x01h\x00" + DTYPE + b"\x89C\x00tb") * MANY
    ),
    "whole numbers of one hash": lambda: whole(b"}(" + b"".join(colliding(15_000)) + b"u"),
    "a place in the memo that is far away": lambda: whole(b"Nr" + struct.pack("<I", 2**31) + b"0"),
    "a text of an exabyte": lambda: whole(b"\x8d" + struct.pack("<Q", 2**60)),
    "a text of negative length": lambda: whole(b"T" + struct.pack("<i", -5)),
    "bytes of a terabyte": lambda: whole(b"\x8e" + struct.pack("<Q", 2**40)),
    "a pair of a pair of pairs as a key": lambda: whole(b"})" + b"2\x86" * 60 + b"Ns"),
}
"""By what they do; made when they are asked for."""

CHEAP: Final = {
    "arrays of one large content",
    "an array with a shape of large numbers",
    "whole numbers of one hash",
}
"""Those that may be read, as the empty lists that they are: they cost about a second, or nothing."""
