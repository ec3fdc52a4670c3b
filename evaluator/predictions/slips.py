"""What was probably meant by a text where a number is expected, and by the name of a column."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from typing import Final

from evaluator.problems import quoted

WITHOUT_ESTIMATE: Final = (
    "A sequence without an estimate needs a value, too: for example the median of the other values."
)

_NOTHING: Final = frozenset(
    [
        "-",
        "--",
        "?",
        "na",
        "n/a",
        "<na>",
        "nan",
        "-nan",
        "+nan",
        "nat",
        "none",
        "null",
        "nil",
        "undefined",
        "missing",
        "1.#qnan",
        "1.#ind",
        "-1.#ind",
    ]
)
_INFINITE: Final = re.compile(r"[+-]?(?:inf|infinity|∞|1\.#inf)", re.IGNORECASE)
_NUMBER: Final = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_WITH_COMMA: Final = re.compile(r"[+-]?[0-9]+,[0-9]+(?:[eE][+-]?[0-9]+)?")
_WITH_UNIT: Final = re.compile(
    r"[+-]?[0-9.]+(?:[eE][+-]?[0-9]+)? ?(s|sec|secs|seconds?|ms|%|f|l)", re.IGNORECASE
)
_MINUS_SIGN: Final = re.compile("[\u2010-\u2015\u2212\ufe58\ufe63\uff0d]")
_AROUND: Final = "'\"`"
_MAX_CHARS: Final = 40
_THE_NUMBER: Final = "Write the number itself."


def of_text(text: str) -> str:
    """Say what to write instead of a text where a number is expected; empty if that is not clear.

    >>> of_text("5,31"), of_text("5.31 s"), of_text("lorem")
    ('Write a point, not a comma: 5.31.', 'Write the number alone, without "s".', '')
    """
    plain = text.strip().strip(_AROUND).strip()
    if len(plain) > _MAX_CHARS:
        return ""
    if not plain or plain.lower() in _NOTHING or plain.startswith("#"):
        return WITHOUT_ESTIMATE
    if _INFINITE.fullmatch(plain):
        return f"Write it as {'-' if plain.startswith('-') else ''}Infinity."
    return _of_number(plain)


def _of_number(plain: str) -> str:
    sign = _MINUS_SIGN.search(plain)
    if sign and _NUMBER.fullmatch(_MINUS_SIGN.sub("-", plain)):
        return f"Its sign is the character U+{ord(sign[0]):04X}; expected a hyphen, as in -12.9."
    if _NUMBER.fullmatch(plain):
        return f"{_THE_NUMBER.removesuffix('.')}: {json.dumps(float(plain))}."
    if _WITH_COMMA.fullmatch(plain):
        return f"Write a point, not a comma: {plain.replace(',', '.')}."
    unit = _WITH_UNIT.fullmatch(plain)
    return f"Write the number alone, without {quoted(unit[1])}." if unit else ""


def of_value(value: object) -> str:
    """Say what to write instead of the value of a JSON text where a number is expected; else as `of_text`."""
    match value:
        case None:
            return WITHOUT_ESTIMATE
        case str():
            return of_text(value)
        case list():
            # An object is a list of its members.
            has_names = type(value) is not list
            return _THE_NUMBER if has_names else "A sequence has one value: the one at its last frame."
        case _:
            return ""


# --- names of columns

_PREDICTED_WORDS: Final = frozenset(
    [
        "pred",
        "preds",
        "predicted",
        "prediction",
        "predictions",
        "est",
        "estimate",
        "estimated",
        "estimates",
        "hat",
        "output",
        "outputs",
    ]
)
_OF_VALUES: Final = frozenset(
    ("ttc", "tau", "time", "to", "contact", "value", "values", "y", "s", "sec", "seconds")
)
_OF_KEYS: Final = frozenset(
    ["id", "annoid", "annotationid", "anno", "key", "keys", "naturalkey", "sequence", "sequenceid", "name"]
)
_WORDS: Final = re.compile(r"[A-Z]?[a-z]+|[A-Z]+|[0-9]+")


def _words(name: str) -> set[str]:
    return {word.lower() for word in _WORDS.findall(name)}


def predicted_among(names: Sequence[str]) -> list[str]:
    """Return the names that say that a column has predictions, such as ttc_pred.

    >>> predicted_among(["anno_id", "ttc", "ttcPred", "pred_box_width", "y_hat"])
    ['ttcPred', 'y_hat']
    """
    return [
        name
        for name in names
        if _words(name) <= _PREDICTED_WORDS | _OF_VALUES and not _words(name).isdisjoint(_PREDICTED_WORDS)
    ]


def renaming(names: Sequence[str], *, has_keys: bool, has_values: bool) -> str:
    """Say which columns are probably to be renamed to anno_id and to ttc; empty if that is not clear."""
    pairs = []
    if not has_keys:
        keys = [name for name in names if _joined(name) in _OF_KEYS]
        pairs += [(name, "anno_id") for name in keys[:1]]
    if not has_values:
        values = predicted_among(names) or [name for name in names if _is_of_values(name)]
        pairs += [(values[0], "ttc")] if len(values) == 1 else []
    return " and ".join(f"{quoted(name)} to {right}" for name, right in pairs)


def _joined(name: str) -> str:
    return "".join(word.lower() for word in _WORDS.findall(name))


def _is_of_values(name: str) -> bool:
    words = _words(name)
    return bool(words & {"ttc", "tau", "contact", "value", "values"}) and words <= _OF_VALUES
