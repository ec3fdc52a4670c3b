"""Files that somebody who means harm, or is careless, might send as predictions: each has a name."""

import gzip
import io
import json
import pickle
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
    "minus 1e999": b"-1e999",
    "1e-999": b"1e-999",
    "exponent of a million": b"1e1000000",
    "exponent of a hundred digits": b"1e" + b"9" * 100,
    "integer of 1,000 digits": b"9" * 1_000,
    "integer of 5,000 digits": b"9" * 5_000,
    "integer of 1,000,000 digits": b"9" * 1_000_000,
    "fraction of 100,000 digits": b"0." + b"3" * 100_000,
    "two to the 64": b"18446744073709551616",
    "smallest denormal": b"5e-324",
    "minus zero": b"-0.0",
    "zero": b"0",
    "NaN": b"NaN",
    "Infinity": b"Infinity",
    "minus Infinity": b"-Infinity",
    "nan in small letters": b"nan",
    "leading zero": b"01",
    "leading plus": b"+1",
    "leading point": b".5",
    "trailing point": b"1.",
    "hexadecimal": b"0x10",
    "octal": b"0o17",
    "binary": b"0b1",
    "underscore": b"1_000",
    "decimal comma": b"1,5",
    "two points": b"1.2.3",
    "two exponents": b"1e1e1",
    "complex": b"1+2j",
    "Arabic digits": "٣".encode(),
    "full-width digits": "１".encode(),
    "true": b"true",
    "null": b"null",
    "text": b'"5.31"',
    "empty text": b'""',
    "list": b"[1]",
    "object": b'{"a": 1}',
    "undefined": b"undefined",
    "an expression": b"1/0",
    "a call": b"__import__('os').system('true')",
}
KEYS = {
    "empty": b'""',
    "negative": b'"-1"',
    "leading zero": b'"007"',
    "space before": b'" 7"',
    "fraction": b'"7.0"',
    "exponent": b'"7e0"',
    "Arabic digit": '"٧"'.encode(),
    "NUL escaped": b'"\\u0000"',
    "lone high surrogate": b'"\\ud800"',
    "lone low surrogate": b'"\\udfff"',
    "surrogates the wrong way round": b'"\\udc00\\ud800"',
    "bad escape": b'"\\x41"',
    "short escape": b'"\\u12"',
    "tab inside": b'"a\tb"',
    "newline inside": b'"a\nb"',
    "a path": b'"../../../../etc/passwd"',
    "a natural key of nowhere": b'"9999/1/1/1"',
    "prototype": b'"__proto__"',
    "a formula": b"\"=cmd|'/c calc'!A1\"",
    "a script": b'"<script>alert(1)</script>"',
    "right to left": '"\u202e7"'.encode(),
    "1 MB long": b'"' + b"k" * 1_000_000 + b'"',
    "huge integer": b'"' + b"9" * 10_000 + b'"',
    "not a text": b"7",
    "single quotes": b"'7'",
}
WHOLE: dict[str, bytes] = {
    "a space": b" ",
    "newlines": b"\n" * 1000,
    "NUL": b"\x00",
    "a thousand NULs": b"\x00" * 1000,
    "a number": b"1",
    "a text": b'"predictions"',
    "null": b"null",
    "true": b"true",
    "an empty list": b"[]",
    "an empty object": b"{}",
    "a list of numbers": json.dumps(list(range(1000))).encode(),
    "rows": b"anno_id,ttc\n0,1.5\n1,2.5\n",
    "a page": b"<!doctype html><script>alert(1)</script>",
    "entities that multiply": b'<!DOCTYPE a [<!ENTITY b "'
    + b"b" * 1000
    + b'">]><a>'
    + b"&b;" * 1000
    + b"</a>",
    "a picture": b"\x89PNG\r\n\x1a\n" + bytes(200),
    "Parquet": b"PAR1" + bytes(200) + b"PAR1",
    "a program": b"\x7fELF" + bytes(500),
    "a document": b"%PDF-1.7\n" + bytes(200),
    "a pickle": pickle.dumps({"0": 1.0}),
    "a pickle that runs something": b"cos\nsystem\n(S'true'\ntR.",
    "a gzip bomb": gzip.compress(bytes(20_000_000)),
    "deflated": zlib.compress(b'{"0": 1}'),
    "YAML": b"a: &a [x]\nb: [*a, *a, *a]\n",
    "TOML": b'[predictions]\n"0" = 1.0\n',
    "MessagePack": b"\x81\xa10\xcb" + struct.pack(">d", 1.0),
    "CBOR": b"\xa1\x61\x30\xfb" + struct.pack(">d", 1.0),
    "100,000 open brackets": b"[" * 100_000,
    "1,000,000 open brackets": b"[" * 1_000_000,
    "100,000 open braces": b'{"a":' * 100_000,
    "brackets and braces in turn": b'[{"a":' * 50_000,
    "brackets that close again": b"[" * 50_000 + b"]" * 50_000,
    "an open text": b'{"0": "' + b"a" * 1000,
    "an open escape": b'{"0\\',
    "comments": b'{/* a */ "0": 1 // b\n}',
    "a shell": b"#!/bin/sh\nrm -rf /\n",
    "SQL": b"'; DROP TABLE leaderboard_score; --",
    "a boundary": b"--boundary\r\nContent-Disposition: form-data; name=x\r\n\r\n1\r\n--boundary--",
}
ENVELOPES: dict[str, object] = {
    "unit of nothing": {"unit": "parsecs", "predictions": {"0": 1}},
    "unit that is a list": {"unit": ["ttc"], "predictions": {"0": 1}},
    "unit that is null": {"unit": None, "predictions": {"0": 1}},
    "predictions that are a list": {"unit": "ttc", "predictions": [1, 2]},
    "predictions that are a text": {"unit": "ttc", "predictions": "all"},
    "predictions twice nested": {"unit": "ttc", "predictions": {"predictions": {"0": 1}}},
    "no predictions": {"unit": "ttc"},
    "a rate of zero": {"unit": "scale_ratio", "fps": 0, "predictions": {"0": 0.9}},
    "a negative rate": {"unit": "scale_ratio", "fps": -2, "predictions": {"0": 0.9}},
    "a rate that is a text": {"unit": "scale_ratio", "fps": "2", "predictions": {"0": 0.9}},
    "a gap of a million frames": {"unit": "scale_ratio", "frame_gap": 10**6, "predictions": {"0": 0.9}},
    "a gap for nobody": {"unit": "scale_ratio", "frame_gap": {"x": 1}, "predictions": {"0": 0.9}},
    "a ratio of zero": {"unit": "scale_ratio", "fps": 2, "predictions": {"0": 0}},
    "remarks of a megabyte": {"unit": "ttc", "meta": {"a": "b" * 10**6}, "predictions": {"0": 1}},
    "remarks that are a list": {"unit": "ttc", "meta": [1], "predictions": {"0": 1}},
    "an unknown field": {"unit": "ttc", "admin": True, "predictions": {"0": 1}},
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
    "a byte order mark": lambda good: b"\xef\xbb\xbf" + good,
    "two byte order marks": lambda good: b"\xef\xbb\xbf" * 2 + good,
    "a byte order mark in the middle": lambda good: good[:5] + b"\xef\xbb\xbf" + good[5:],
    "NUL before": lambda good: b"\x00" + good,
    "NUL after": lambda good: good + b"\x00",
    "NUL within": lambda good: good[:40] + b"\x00" + good[40:],
    "form feeds": lambda good: b"\x0c" + good,
    "bytes that are no text": lambda good: good[:30] + b"\xff\xfe\xfa" + good[30:],
    "an overlong slash": lambda good: good[:2] + b"\xc0\xaf" + good[2:],
    "a surrogate in bytes": lambda good: good[:2] + b"\xed\xa0\x80" + good[2:],
    "Latin-1": lambda good: good[:2] + "é".encode("latin-1") + good[2:],
    "the file twice": lambda good: good + good,
    "the file twice, a line each": lambda good: good + b"\n" + good,
    "a comma too many": lambda good: good.rstrip()[:-1] + b",}",
    "a bracket too many": lambda good: good + b"]",
    "every key twice": lambda good: good.rstrip()[:-1] + b"," + good.lstrip()[1:],
    "a key a thousand times": lambda good: good.rstrip()[:-1] + b', "0": 1.5' * 1000 + b"}",
    "a key twice, once escaped": lambda good: good.rstrip()[:-1] + b', "\\u0030": 1.5}',
    "a list of it": lambda good: b"[" + good + b"]",
    "in a thousand lists": lambda good: b"[" * 1000 + good + b"]" * 1000,
    "as a text": lambda good: json.dumps(good.decode()).encode(),
    "an envelope twice": lambda good: b'{"unit":"ttc","unit":"ttc","predictions":' + good + b"}",
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
