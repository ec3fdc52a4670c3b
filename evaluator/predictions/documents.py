"""Strict reading of a prediction file, which decides what a file means: every fault in words."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from evaluator.counting import file_size
from evaluator.predictions import headers, slips
from evaluator.predictions.recognition import is_printed_dict
from evaluator.problems import Findings, pointer, quoted, reject

Unit = Literal["ttc", "scale_ratio"]

MAX_DEPTH: Final = 32
MAX_META_BYTES: Final = 64 * 1024
_MARKS_PER_MEMBER: Final = 4  # a key and a text of two quotation marks each
FIELDS: Final = ("unit", "fps", "frame_gap", "meta", "predictions")

# Also matches a text that never ends, or looking for its end would begin anew at every mark inside it.
_STRING: Final = re.compile(rb'"(?:[^"\\]|\\.)*+(?:"|\\?\Z)', re.DOTALL)
_MAX_TOKEN: Final = 40
_BEFORE_TOKEN: Final = re.compile(r"[:,\[{}\]]")
_TOKEN: Final = re.compile(r"[^:,\[{}\]\n]{0,40}")
BYTE_ORDER_MARK: Final = b"\xef\xbb\xbf"
EMPTY_MESSAGE: Final = "The file is empty; expected JSON text with a number for every sequence."


MAX_FILE_BYTES: Final = 20_000_000
"""What a leaderboard takes at most, counted as sent: of a gzip archive, the compressed bytes."""


def too_large(*, n_bytes: int, max_bytes: int) -> str:
    """Word the refusal of a large file, the same on page, API and command line."""
    return (
        f"The file is {file_size(n_bytes)}; expected at most {file_size(max_bytes)}. "
        "gzip makes a prediction file much smaller: send FILE.json.gz."
    )


class Members(list[tuple[str, object]]):
    """The members of a JSON object in file order, duplicates included."""


@dataclass(frozen=True, slots=True)
class Document:
    """A parsed file: the predictions, and the envelope."""

    predictions: Members
    unit: Unit
    rate_name: Literal["fps", "frame_gap"] | None
    rate: object
    meta: Mapping[str, object] | None
    enveloped: bool

    def pointer(self, key: str) -> str:
        return pointer("predictions", key) if self.enveloped else pointer(key)


def parse(data: bytes, *, max_members: int | None = None) -> object:
    """Parse shallow UTF-8 JSON with objects as `Members`; raises `Rejected`, also for over `max_members`."""
    # A byte order mark, `NaN` and ±`Infinity` are accepted; numbers beyond float64 become ±Infinity.
    body = data.removeprefix(BYTE_ORDER_MARK)
    try:
        text = body.decode("utf-8")
    except UnicodeDecodeError as error:
        start = error.start + len(data) - len(body)
        message = f"Byte {start:,} of the file is not UTF-8; expected JSON text encoded in UTF-8."
        raise reject("not-utf8", message, f"byte {start}") from None
    if not body.strip(b" \t\r\n"):
        raise reject("not-json", EMPTY_MESSAGE)
    other = headers.refusal_of_text(headers.first_line(body))
    n_members = body.count(b",") + 1
    if max_members is not None and n_members > max_members:
        if other is not None:
            raise other
        message = f"The file has up to {n_members:,} members and items; expected at most {max_members:,}."
        if body.count(b"[") > n_members // 100:
            message += " The values seem to be lists; expected one number for each sequence."
        raise reject("too-many-members", message)
    n_marks = body.count(b'"')
    if max_members is not None and n_marks > _MARKS_PER_MEMBER * max_members:
        message = (
            f"The file has {n_marks:,} quotation marks; "
            f"expected at most {_MARKS_PER_MEMBER * max_members:,}, four for each member."
        )
        raise reject("too-many-members", message)
    if _depth(body) > MAX_DEPTH:
        raise reject(
            "too-deep",
            f"Objects and lists are nested deeper than {MAX_DEPTH} levels; expected 2, or a few in meta.",
        )
    try:
        return json.loads(text, object_pairs_hook=Members, parse_int=_integer)
    except json.JSONDecodeError as error:
        if other is not None:
            raise other from None
        where = f"line {error.lineno}, column {error.colno}"
        excerpt = quoted(text[error.pos : error.pos + 20]) if error.pos < len(text) else "the end of the file"
        fault = error.msg[0].lower() + error.msg[1:].removesuffix(" at").removesuffix(" starting")
        message = f"The text is not JSON: {fault}, found {excerpt}.{_hint(text, error)}"
        raise reject("not-json", message, where) from None


def _hint(text: str, error: json.JSONDecodeError) -> str:
    """Say what is probably wrong at a fault of a JSON text; starts with a space unless empty."""
    if is_printed_dict(text):
        return " The file looks like a dict as Python prints it; json.dump writes JSON."
    if error.msg == "Extra data":
        return _hint_of_end(text[error.pos])
    if text.find("}", error.pos) < 0:
        return " The file ends early: copy or write it again."
    if text[error.pos] in "}]" and text[: error.pos].rstrip().endswith(","):
        return " Remove the comma before it."
    if error.msg.startswith("Expecting property name"):
        return " Write numbers with a point, not with a comma: 5.31." if text[error.pos].isdigit() else ""
    return f" {slips.of_text(_token_at(text, error.pos))}".rstrip()


def _hint_of_end(character: str) -> str:
    if character == "{":
        return " The file has several objects, as JSON Lines; expected one object."
    if character < " ":
        return " Characters that cannot be seen come after the object: remove them, or write the file again."
    return ""


def _token_at(text: str, position: int) -> str:
    """Return what is between two marks of JSON, as far as it is short."""
    before = _BEFORE_TOKEN.split(text[max(0, position - _MAX_TOKEN) : position])[-1]
    return (before + _TOKEN.match(text, position)[0]).strip()  # type: ignore[index]  # it matches nothing, too


def read_document(value: object) -> Document:
    """Split a parsed file; raises `Rejected` for a wrong top level or envelope."""
    if not isinstance(value, Members):
        message = (
            f"The outermost value is {kind_of(value)}; expected an object of predictions, "
            '{"KEY": NUMBER, …}, or an envelope.'
        )
        raise reject("wrong-top-level", message)
    names = {name for name, _ in value}
    if names.isdisjoint(FIELDS):
        return Document(value, "ttc", None, None, None, enveloped=False)
    findings = Findings()
    fields: dict[str, object] = {}
    for name, content in value:
        if name in fields:
            findings.add(
                "duplicate-keys", f"The field {quoted(name)} appears twice; expected it once.", pointer(name)
            )
        elif name not in FIELDS:
            expected = f"expected only {', '.join(FIELDS)} (put notes into meta)"
            findings.add(
                "unknown-field", f"The envelope has a field {quoted(name)}; {expected}.", pointer(name)
            )
        fields[name] = content
    if "predictions" not in fields:
        findings.add("missing-predictions", "The envelope has no predictions; expected an object of them.")
    unit = _unit(fields, findings)
    rate_name = _rate_name(fields, unit, findings)
    meta = _meta(fields.get("meta"), findings)
    predictions = fields.get("predictions", [])
    if "predictions" in fields and not isinstance(predictions, Members):
        message = f"predictions is {kind_of(predictions)}; expected an object from key to number."
        findings.add("wrong-top-level", message, "/predictions")
    findings.raise_if_any()
    rate = fields[rate_name] if rate_name else None
    members = predictions if isinstance(predictions, Members) else Members()
    return Document(members, unit, rate_name, rate, meta, enveloped=True)


def kind_of(value: object) -> str:
    """Name the kind of a JSON value, with the value if it is short.

    >>> kind_of("5.3"), kind_of(None), kind_of([1])
    ('the string "5.3"', 'null', 'a list')
    """
    match value:
        case None:
            return "null"
        case bool():
            return f"the boolean {str(value).lower()}"
        case int() | float():
            text = repr(value)
            return f"the number {text if len(text) < 30 else format(value, '.17g')}"
        case str():
            return f"the string {quoted(value)}"
        case Members():
            return "an object"
        case _:
            return "a list"


def _unit(fields: Mapping[str, object], findings: Findings) -> Unit:
    unit = fields.get("unit")
    if unit == "ttc" or unit == "scale_ratio":  # noqa: PLR1714 -- narrows the type
        return unit
    begin = f"The unit is {kind_of(unit)}" if "unit" in fields else "The envelope has no unit"
    findings.add("unknown-unit", f'{begin}; expected "ttc", for seconds, or "scale_ratio".', "/unit")
    return "ttc"


def _rate_name(
    fields: Mapping[str, object], unit: Unit, findings: Findings
) -> Literal["fps", "frame_gap"] | None:
    has_fps, has_gap = "fps" in fields, "frame_gap" in fields
    if has_fps and has_gap:
        findings.add(
            "bad-rate", "The envelope has both fps and frame_gap; expected one of them.", "/frame_gap"
        )
    elif unit == "ttc" and (has_fps or has_gap) and fields.get("unit") == "ttc":
        name = "fps" if has_fps else "frame_gap"
        message = (
            f'The envelope has {name}, but values of unit "ttc" are seconds and have no rate; expected none.'
        )
        findings.add("bad-rate", message, pointer(name))
    elif unit == "scale_ratio" and not (has_fps or has_gap):
        message = "Scale ratios need the rate of their frame pairs; expected fps (Hz) or frame_gap (frames)."
        findings.add("bad-rate", message)
    if unit == "ttc":
        return None
    return "fps" if has_fps else "frame_gap" if has_gap else None


def _meta(value: object, findings: Findings) -> dict[str, object] | None:
    if value is None:
        return None
    if not isinstance(value, Members):
        findings.add("bad-meta", f"meta is {kind_of(value)}; expected an object.", "/meta")
        return None
    try:
        meta = _plain_object(value)
        size = len(json.dumps(meta, ensure_ascii=False).encode())
        fault = f"it takes {size:,} bytes" if size > MAX_META_BYTES else None
    except ValueError as error:
        fault = str(error)
    if fault:
        expected = f"an object of finite numbers and whole texts, at most {MAX_META_BYTES:,} bytes"
        findings.add("bad-meta", f"meta cannot be kept: {fault}; expected {expected}.", "/meta")
        return None
    return meta


def _plain(value: object) -> object:
    match value:
        case Members():
            return _plain_object(value)
        case list():
            return [_plain(item) for item in value]
        case str():
            return _text(value)
        case float() if not math.isfinite(value):
            raise ValueError("a number is not finite")
        case _:
            return value


def _plain_object(members: Members) -> dict[str, object]:
    plain = {_text(name): _plain(content) for name, content in members}
    if len(plain) != len(members):
        raise ValueError("a name appears twice in an object")
    return plain


def _text(text: str) -> str:
    # What follows is allowed in JSON, but no database keeps it.
    if "\x00" in text:
        raise ValueError("a text contains NUL")
    if any("\ud800" <= character <= "\udfff" for character in text):
        raise ValueError("a text contains half of a surrogate pair")
    return text


def _integer(text: str) -> int | float:
    # Python refuses to read very long integers; they become float64.
    return int(text) if len(text) < 300 else float(text)


def _depth(body: bytes) -> int:
    # Exact for every JSON prefix, so that no text drives the recursive parser deep.
    if body.count(b"{") + body.count(b"[") <= MAX_DEPTH:
        return 0
    brackets = _brackets(body)
    depth = deepest = 0
    for start in range(0, len(brackets), _CHUNK):
        levels = depth + np.cumsum(_STEP[np.frombuffer(brackets[start : start + _CHUNK], dtype=np.uint8)])
        depth, deepest = int(levels[-1]), max(deepest, int(levels.max()))
        if deepest > MAX_DEPTH:
            break
    return deepest


def _brackets(body: bytes) -> bytearray:
    # Match by match: to remove millions of strings at once would take eighty bytes for each piece left.
    brackets, end = bytearray(), 0
    for string in _STRING.finditer(body):
        start = string.start()
        if start > end:
            brackets += body[end:start].translate(None, delete=_NO_BRACKETS)
        end = string.end()
    brackets += body[end:].translate(None, delete=_NO_BRACKETS)
    return brackets


_CHUNK: Final = 1 << 16
_NO_BRACKETS: Final = bytes(set(range(256)) - set(b"[]{}"))
_STEP: Final = np.zeros(256, dtype=np.int64)
_STEP[list(b"[{")] = 1
_STEP[list(b"]}")] = -1
