"""Prediction files with one fault each, and the code, words and pointer of the first problem of each."""

import json
import math
from typing import Any

from evaluator.predictions.slips import WITHOUT_ESTIMATE
from tests.evaluator.worlds import envelope, flat, make_truth

MANIFEST = make_truth([4.0, -10.0, 1.0, 18.0]).manifest
GOOD = {"0": 5.31, "1": -12.9, "2": 0.4, "3": 100.0}
NATURAL = dict(zip(MANIFEST.natural_keys, GOOD.values(), strict=True))
RATIOS = {"0": 0.9, "1": 1.1, "2": 0.8, "3": 0.95}


def text_with(**changes: str) -> bytes:
    """The good file with other literals for some keys."""
    literals = {key: str(value) for key, value in GOOD.items()} | {
        k.removeprefix("_"): v for k, v in changes.items()
    }
    return ("{" + ", ".join(f'"{key}": {literal}' for key, literal in literals.items()) + "}").encode()


NO_ZERO = "The value is 0; expected a time to contact other than 0, negative when moving away."
TOO_DEEP = "Objects and lists are nested deeper than 32 levels; expected 2, or a few in meta."
EXPECTED_SECONDS = "expected a number of seconds."
EXPECTED_KEYS = (
    "expected the manifest's anno_ids, as plain decimal numbers, or its natural keys, "
    "bag_stamp/cam_id/ts/track_id."
)

CASES: dict[str, tuple[Any, ...]] = {
    "not JSON": (
        b'{"0": 5.31,\n "1": -12.9,, "2": 1}',
        "not-json",
        'The text is not JSON: expecting property name enclosed in double quotes, found ", \\"2\\": 1}".',
        "line 2, column 13",
    ),
    "cut off": (
        b'{"0": 5.31, "1": -12.9',
        "not-json",
        "The text is not JSON: expecting ',' delimiter, found the end of the file. "
        "The file ends early: copy or write it again.",
        "line 1, column 23",
    ),
    "empty": (
        b"",
        "not-json",
        "The file is empty; expected JSON text with a number for every sequence.",
    ),
    "white space alone": (
        b" \n ",
        "not-json",
        "The file is empty; expected JSON text with a number for every sequence.",
    ),
    "a PNG image": (
        b"\x89PNG\r\n\x1a\n",
        "not-utf8",
        "The file is a PNG image; expected JSON text or a CSV table, in UTF-8. "
        "Send the file with the predictions.",
    ),
    "a Parquet table": (
        b"PAR1",
        "not-json",
        "The file is a Parquet table; expected JSON text or a CSV table, in UTF-8. "
        "tsttc submit sends one, and tsttc convert makes JSON of it.",
    ),
    "a ZIP archive": (
        b"PK\x03\x04",
        "not-json",
        "The file is a ZIP archive; expected JSON text or a CSV table, in UTF-8. "
        "Unpack it and send the JSON or CSV file in it, or compress that file with gzip.",
    ),
    "more after the end": (
        flat(GOOD) + b"}",
        "not-json",
        'The text is not JSON: extra data, found "}".',
        "line 1, column 46",
    ),
    "a number as no JSON writes it": (
        text_with(_0="05"),
        "not-json",
        """The text is not JSON: expecting ',' delimiter, found "5, \\"1\\": -12.9, \\"2\\": ". """
        "Write the number itself: 5.0.",
        "line 1, column 8",
    ),
    "NUL": (
        b'{"0\x00": 1}',
        "not-json",
        'The text is not JSON: invalid control character, found "\\u0000\\": 1}".',
        "line 1, column 4",
    ),
    "Latin-1": (
        b'{"b\xe4g": 1}',
        "not-utf8",
        "Byte 3 of the file is not UTF-8; expected JSON text encoded in UTF-8.",
        "byte 3",
    ),
    "UTF-16": (
        json.dumps(GOOD).encode("utf-16"),
        "not-utf8",
        "The file is text in UTF-16; expected JSON text or a CSV table, in UTF-8. "
        "Save it as UTF-8; in PowerShell, Out-File -Encoding utf8 does this.",
    ),
    "an encoded surrogate": (
        b'{"\xed\xa0\x80": 1}',
        "not-utf8",
        "Byte 2 of the file is not UTF-8; expected JSON text encoded in UTF-8.",
        "byte 2",
    ),
    "nesting": (b'{"0": ' + b"[" * 100_000 + b"]" * 100_000 + b"}", "too-deep", TOO_DEEP),
    "nesting that never ends": (b'{"a":' * 200_000, "too-deep", TOO_DEEP),
    "members without end": (
        b"{" + b'"0":1,' * 100_008 + b'"0":1}',
        "too-many-members",
        "The file has up to 100,009 members and items; expected at most 100,008.",
    ),
    "a list": (
        b"[5.31, -12.9]",
        "wrong-top-level",
        'The outermost value is a list; expected an object of predictions, {"KEY": NUMBER, …}, or an '
        "envelope.",
    ),
    "null": (
        b"null",
        "wrong-top-level",
        'The outermost value is null; expected an object of predictions, {"KEY": NUMBER, …}, or an envelope.',
    ),
    "predictions in a list": (
        envelope([5.31], unit="ttc"),
        "wrong-top-level",
        "predictions is a list; expected an object from key to number.",
        "/predictions",
    ),
    "no unit": (
        envelope(GOOD),
        "unknown-unit",
        'The envelope has no unit; expected "ttc", for seconds, or "scale_ratio".',
        "/unit",
    ),
    "unknown unit": (
        envelope(GOOD, unit="seconds"),
        "unknown-unit",
        'The unit is the string "seconds"; expected "ttc", for seconds, or "scale_ratio".',
        "/unit",
    ),
    "unit of another type": (
        envelope(GOOD, unit=None),
        "unknown-unit",
        'The unit is null; expected "ttc", for seconds, or "scale_ratio".',
        "/unit",
    ),
    "no predictions": (
        b'{"unit": "ttc"}',
        "missing-predictions",
        "The envelope has no predictions; expected an object of them.",
    ),
    "unknown field": (
        envelope(GOOD, unit="ttc", author="me"),
        "unknown-field",
        'The envelope has a field "author"; expected only unit, fps, frame_gap, meta, predictions '
        "(put notes into meta).",
        "/author",
    ),
    "doubled field": (
        b'{"unit": "ttc", "predictions": {}, "predictions": ' + flat(GOOD) + b"}",
        "duplicate-keys",
        'The field "predictions" appears twice; expected it once.',
        "/predictions",
    ),
    "no rate": (
        envelope(RATIOS, unit="scale_ratio"),
        "bad-rate",
        "Scale ratios need the rate of their frame pairs; expected fps (Hz) or frame_gap (frames).",
    ),
    "two rates": (
        envelope(RATIOS, unit="scale_ratio", fps=2, frame_gap=5),
        "bad-rate",
        "The envelope has both fps and frame_gap; expected one of them.",
        "/frame_gap",
    ),
    "a rate for seconds": (
        envelope(GOOD, unit="ttc", fps=2),
        "bad-rate",
        'The envelope has fps, but values of unit "ttc" are seconds and have no rate; expected none.',
        "/fps",
    ),
    "rate zero": (
        envelope(RATIOS, unit="scale_ratio", fps=0),
        "bad-rate",
        "fps is the number 0; expected a rate in Hz, a finite number greater than 0.",
        "/fps",
    ),
    "rate as text": (
        envelope(RATIOS, unit="scale_ratio", fps="2"),
        "bad-rate",
        'fps is the string "2"; expected a rate in Hz, a finite number greater than 0.',
        "/fps",
    ),
    "frame gap six": (
        envelope(RATIOS, unit="scale_ratio", frame_gap=6),
        "bad-rate",
        "frame_gap is the number 6; expected a whole number of frames from 1 to 5.",
        "/frame_gap",
    ),
    "frame gap between frames": (
        envelope(RATIOS, unit="scale_ratio", frame_gap=2.5),
        "bad-rate",
        "frame_gap is the number 2.5; expected a whole number of frames from 1 to 5.",
        "/frame_gap",
    ),
    "one rate of many": (
        envelope(RATIOS, unit="scale_ratio", fps={"0": 2, "1": 2, "2": -1, "3": 2}),
        "bad-rate",
        "fps is the number -1; expected a rate in Hz, a finite number greater than 0.",
        "/fps/2",
    ),
    "a missing rate of many": (
        envelope(RATIOS, unit="scale_ratio", fps={"0": 2, "1": 2, "3": 2}),
        "missing-keys",
        "1 sequence has no value: 2; expected one for each of the manifest's 4 sequences, by anno_id.",
        "/fps/2",
    ),
    "meta is no object": (
        envelope(GOOD, unit="ttc", meta="Foo++"),
        "bad-meta",
        'meta is the string "Foo++"; expected an object.',
        "/meta",
    ),
    "missing keys": (
        flat({"0": 5.31, "3": 1.0}),
        "missing-keys",
        "2 sequences have no value: 1, 2; expected one for each of the manifest's 4 sequences, by anno_id.",
        "/1",
    ),
    "missing natural keys": (
        flat(dict(list(NATURAL.items())[:3])),
        "missing-keys",
        "1 sequence has no value: 0000/1/800000000/3; "
        "expected one for each of the manifest's 4 sequences, by natural key.",
        "/0000~11~1800000000~13",
    ),
    "unknown key": (
        flat({**GOOD, "4": 1.0}),
        "unknown-keys",
        f'1 key is not in the manifest: "4"; {EXPECTED_KEYS}',
        "/4",
    ),
    "hostile unknown keys": (
        b'{"0": 1, "1": 1, "2": 1, "3": 1, "\\u0000\\ud800": 1, "' + b"x" * 1000 + b'": 1, "": 1}',
        "unknown-keys",
        f'3 keys are not in the manifest: "\\u0000\\ud800", "{"x" * 60}…", ""; {EXPECTED_KEYS}',
        "/\\u0000\\ud800",
    ),
    "doubled key": (
        b'{"0": 5.31, "1": -12.9, "2": 0.4, "3": 100.0, "2": 0.4}',
        "duplicate-keys",
        '1 key appears more than once: "2"; expected every key once.',
        "/2",
    ),
    "doubled key under another spelling": (
        b'{"0": 5.31, "1": -12.9, "2": 0.4, "3": 100.0, "\\u0032": 0.4}',
        "duplicate-keys",
        '1 key appears more than once: "2"; expected every key once.',
        "/2",
    ),
    "both kinds of key": (
        flat({"0": 1.0, "1": 1.0, **dict(list(NATURAL.items())[3:]), "2": 1.0}),
        "mixed-keys",
        'The file mixes 3 anno_ids with 1 natural keys; the odd ones: "0000/1/800000000/3"; '
        "expected one kind of key.",
        "/0000~11~1800000000~13",
    ),
    "a string": (
        text_with(_1='"5.3"'),
        "not-a-number",
        f'The value is the string "5.3"; {EXPECTED_SECONDS} Write the number itself: 5.3.',
        "/1",
    ),
    "a null": (
        text_with(_1="null"),
        "not-a-number",
        f"The value is null; {EXPECTED_SECONDS} {WITHOUT_ESTIMATE}",
        "/1",
    ),
    "a boolean": (
        text_with(_1="true"),
        "not-a-number",
        f"The value is the boolean true; {EXPECTED_SECONDS}",
        "/1",
    ),
    "a value in a list": (
        text_with(_1="[5.3]"),
        "not-a-number",
        f"The value is a list; {EXPECTED_SECONDS} A sequence has one value: the one at its last frame.",
        "/1",
    ),
    "a value in an object": (
        text_with(_1='{"ttc": 5.3}'),
        "not-a-number",
        f"The value is an object; {EXPECTED_SECONDS} Write the number itself.",
        "/1",
    ),
    "NaN": (text_with(_1="NaN"), "nan", f"The value is NaN; {EXPECTED_SECONDS} {WITHOUT_ESTIMATE}", "/1"),
    "NaN among ratios": (
        envelope(RATIOS | {"1": math.nan}, unit="scale_ratio", fps=2),
        "nan",
        f"The value is NaN; expected a scale ratio greater than 0. {WITHOUT_ESTIMATE}",
        "/predictions/1",
    ),
    "a zero": (text_with(_1="0"), "zero", NO_ZERO, "/1"),
    "a negative zero": (text_with(_1="-0.0"), "zero", NO_ZERO, "/1"),
    "a number too small for float64": (text_with(_1="1e-400"), "zero", NO_ZERO, "/1"),
    "a ratio of zero": (
        envelope(RATIOS | {"2": 0}, unit="scale_ratio", frame_gap=5),
        "not-positive",
        "The value is the number 0; expected a scale ratio greater than 0.",
        "/predictions/2",
    ),
    "a negative ratio": (
        envelope(RATIOS | {"2": -0.9}, unit="scale_ratio", frame_gap=5),
        "not-positive",
        "The value is the number -0.9; expected a scale ratio greater than 0.",
        "/predictions/2",
    ),
    "a ratio that is no time": (
        envelope(RATIOS | {"2": 1e-320}, unit="scale_ratio", fps=2),
        "zero",
        "The scale ratio 1e-320 is a time to contact of 0; expected one that is not 0.",
        "/predictions/2",
    ),
}


def _with_meta(meta: bytes) -> bytes:
    return b'{"unit": "ttc", "meta": ' + meta + b', "predictions": ' + flat(GOOD) + b"}"


FURTHER: dict[str, bytes] = {
    "good": flat(GOOD),
    "by natural keys": flat(NATURAL),
    "ratios": envelope(RATIOS, unit="scale_ratio", frame_gap=5),
    "marked": b"\xef\xbb\xbf" + flat(GOOD),
    "marked twice": b"\xef\xbb\xbf\xef\xbb\xbf{}",
    "infinite in meta": _with_meta(b'{"a": [1e999]}'),
    "doubled in meta": _with_meta(b'{"a": 1, "a": 2}'),
    "long meta": _with_meta('{"a": "ü€\U0001f600'.encode() + b"y" * 65_600 + b'"}'),
    "wrong escape": b'{"0\\x": 1}',
    "half an escape": b'{"0\\u12": 1}',
    "endless text": b'{"abc',
    "endless escape": b'{"abc\\',
    "comma in a list": b"[1,]",
    "comma in an object": b'{"0": 1,}',
    "minus alone": b'{"0": -}',
    "point at the end": b'{"0": 1.}',
    "a column after other letters": '{"ä€\U0001f600": 1, "x": }'.encode(),
    "cut character": b'{"0": 1, "\xe2\x82',
    "overlong character": b'{"\xc0\x80": 1}',
    "33 levels": b'{"0":' + b"[" * 33 + b"]" * 33 + b"}",
    "many unknown": flat({f"x{row}": math.nan for row in range(30)}),
    "an unfilled template": flat(dict.fromkeys(GOOD)),
    "many different": flat({**{f"x{row}": f"v{row}" for row in range(25)}, "y": "v1", "z": "v23", "0": None}),
    "long numbers": b'{"0": 1' + b"0" * 400 + b', "1": "' + b"z" * 80 + b'", "2": 1, "3": 0.0}',
    "a gap of many digits": envelope(RATIOS, unit="scale_ratio", frame_gap=123456789012345678901234567890123),
    "an endless rate": b'{"unit": "scale_ratio", "fps": 1e999, "predictions": {}}',
    "a unit as number": b'{"unit": 1.50, "predictions": {}}',
}
"""More files, good and bad; the fast and the strict reading agree on each."""
