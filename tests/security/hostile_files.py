"""Files that a person who means harm, or is careless, might send as predictions: each has a name."""

import gzip
import io
import json
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterator

Make = Callable[[bytes], bytes]
"""From a good file to a bad one."""

LARGE_BYTES = 30_000_000
FULL_BYTES = 19_500_000  # just within the limit
NUMBERS = {
    "1e999": b"1e999",
    "exponent of a million": b"1e1000000",
    "exponent of a hundred digits": b"1e" + b"9" * 100,
    "integer of 5,000 digits": b"9" * 5_000,
    "integer of 1,000,000 digits": b"9" * 1_000_000,
    "fraction of 100,000 digits": b"0." + b"3" * 100_000,
    "smallest denormal": b"5e-324",
    "Infinity": b"Infinity",
    "Arabic digits": "٣".encode(),
    "full-width digits": "１".encode(),
    "a call": b"__import__('os').system('true')",
}
KEYS = {
    "Arabic digit": '"٧"'.encode(),
    "NUL escaped": b'"\\u0000"',
    "lone high surrogate": b'"\\ud800"',
    "surrogates the wrong way round": b'"\\udc00\\ud800"',
    "newline inside": b'"a\nb"',
    "a path": b'"../../../../etc/passwd"',
    "prototype": b'"__proto__"',
    "a formula": b"\"=cmd|'/c calc'!A1\"",
    "a script": b'"<script>alert(1)</script>"',
    "1 MB long": b'"' + b"k" * 1_000_000 + b'"',
    "huge integer": b'"' + b"9" * 10_000 + b'"',
}
WHOLE: dict[str, bytes] = {
    "a space": b" ",
    "a thousand NULs": b"\x00" * 1000,
    "an empty object": b"{}",
    "rows": b"anno_id,ttc\n0,1.5\n1,2.5\n",
    "a page": b"<!doctype html><script>alert(1)</script>",
    "entities that multiply": b'<!DOCTYPE a [<!ENTITY b "'
    + b"b" * 1000
    + b'">]><a>'
    + b"&b;" * 1000
    + b"</a>",
    "a program": b"\x7fELF" + bytes(500),
    "a pickle that runs something": b"cos\nsystem\n(S'true'\ntR.",
    "a gzip bomb": gzip.compress(bytes(20_000_000)),
    "deflated": zlib.compress(b'{"0": 1}'),
    "MessagePack": b"\x81\xa10\xcb" + struct.pack(">d", 1.0),
    "1,000,000 open brackets": b"[" * 1_000_000,
    "100,000 open braces": b'{"a":' * 100_000,
    "brackets and braces in turn": b'[{"a":' * 50_000,
    "an open escape": b'{"0\\',
    "a boundary": b"--boundary\r\nContent-Disposition: form-data; name=x\r\n\r\n1\r\n--boundary--",
}
ENVELOPES: dict[str, object] = {
    "predictions twice nested": {"unit": "ttc", "predictions": {"predictions": {"0": 1}}},
    "a gap of a million frames": {"unit": "scale_ratio", "frame_gap": 10**6, "predictions": {"0": 0.9}},
    "remarks of a megabyte": {"unit": "ttc", "meta": {"a": "b" * 10**6}, "predictions": {"0": 1}},
}
ENCODINGS = ("utf-16", "utf-16-le", "utf-16-be", "utf-32", "utf-7", "cp037")


def _with_number(literal: bytes) -> Make:
    return lambda good: good.replace(b":", b": " + literal + b', "x":', 1)


def _with_key(literal: bytes) -> Make:
    return lambda good: good.rstrip()[:-1] + b", " + literal + b": 1.5}"


def _encoded(encoding: str) -> Make:
    return lambda good: good.decode().encode(encoding)


def _cut(part: float) -> Make:
    return lambda good: good[: int(len(good) * part)]


def _whole(data: bytes) -> Make:
    return lambda good: data


def _zip(good: bytes) -> bytes:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("../../predictions.json", good)
    return packed.getvalue()


SHAPES: dict[str, Make] = {
    "a byte order mark in the middle": lambda good: good[:5] + b"\xef\xbb\xbf" + good[5:],
    "NUL within": lambda good: good[:40] + b"\x00" + good[40:],
    "form feeds": lambda good: b"\x0c" + good,
    "bytes that are no text": lambda good: good[:30] + b"\xff\xfe\xfa" + good[30:],
    "the file twice, a line each": lambda good: good + b"\n" + good,
    "every key twice": lambda good: good.rstrip()[:-1] + b"," + good.lstrip()[1:],
    "a key a thousand times": lambda good: good.rstrip()[:-1] + b', "0": 1.5' * 1000 + b"}",
    "in a thousand lists": lambda good: b"[" * 1000 + good + b"]" * 1000,
    "as a text": lambda good: json.dumps(good.decode()).encode(),
    "gzipped": gzip.compress,
    "zipped": _zip,
    "100,000 keys too many": lambda good: (
        good.rstrip()[:-1] + b"".join(b', "%d": 1.5' % n for n in range(10**6, 10**6 + 100_000)) + b"}"
    ),
    "19.5 MB of spaces": lambda good: good + b" " * (FULL_BYTES - len(good)),
    "19.5 MB of digits": lambda good: b'{"0": ' + b"1" * (FULL_BYTES - 8) + b"}",
    "19.5 MB of brackets": lambda good: b"[" * FULL_BYTES,
    "19.5 MB of one key": lambda good: b'{"' + b"k" * (FULL_BYTES - 6) + b'":1}',
    "19.5 MB of one text": lambda good: b'{"0":"' + b"\\u0041" * ((FULL_BYTES - 8) // 6) + b'"}',
    "19.5 MB of empty objects": lambda good: b"[" + b"{}," * ((FULL_BYTES - 4) // 3) + b"{}]",
    "30 MB of spaces": lambda good: good + b" " * LARGE_BYTES,
    "30 MB of NULs": lambda good: bytes(LARGE_BYTES),
    "30 MB of digits": lambda good: b'{"0": ' + b"1" * LARGE_BYTES + b"}",
}


def corpus() -> Iterator[tuple[str, Make]]:
    """Every file: its name, and how it is made from a good one."""
    for name, literal in NUMBERS.items():
        yield f"number: {name}", _with_number(literal)
    for name, literal in KEYS.items():
        yield f"key: {name}", _with_key(literal)
    for name, data in WHOLE.items():
        yield f"whole: {name}", _whole(data)
    for name, envelope in ENVELOPES.items():
        yield f"envelope: {name}", _whole(json.dumps(envelope).encode())
    for encoding in ENCODINGS:
        yield f"encoding: {encoding}", _encoded(encoding)
    for percent in (1, 10, 30, 50, 70, 90, 99):
        yield f"cut off at {percent} %", _cut(percent / 100)
    for name, make in SHAPES.items():
        yield f"shape: {name}", make
