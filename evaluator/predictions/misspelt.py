"""Keys that are almost those of the manifest: which ones they probably mean, and what is wrong with them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from decimal import Decimal, InvalidOperation
from typing import Final

from evaluator.problems import quoted
from evaluator.truth.ground_truth import Manifest

MAX_EXAMINED: Final = 1_000
"""At most so many unknown keys are compared with the manifest."""

SPREADSHEET: Final = (
    "The times ts are rounded, as spreadsheets write long numbers, so their last digits are lost. Write the "
    "table again, and do not save it with a spreadsheet."
)
_SEPARATOR: Final = re.compile(r"[\\/,;:|]+")
_AROUND: Final = " \t\r\n\"'()[]"
_AT_ENDS: Final = _AROUND + "/\\"
_SUFFIX: Final = re.compile(r"\.(?:png|jpe?g|json|pkl|npy|txt)\Z", re.IGNORECASE)
_OTHER_SEPARATORS: Final = ("_", "-", ".", " ")
_ROUNDED: Final = re.compile(r"[0-9](?:\.[0-9]{1,16})?[eE]\+[0-9]{1,3}")
_DIGITS: Final = re.compile(r"[0-9]+")
_PREFIX: Final = re.compile(r"[A-Za-z]+[_ -]?(?=[0-9]+\Z)")
_MAX_CHARS: Final = 200
_UNITS: Final = {"seconds": 10**9, "milliseconds": 10**6, "microseconds": 10**3}
_MAX_DIGITS: Final = 40


def advice(unknown: Sequence[str], manifest: Manifest) -> str:
    """Say how the manifest spells unknown keys, if that is clear of most of them; else empty."""
    examined = unknown[:MAX_EXAMINED]
    meant = _natural_keys_meant(examined, manifest) or _anno_ids_meant(examined, manifest)
    if 2 * len(meant) <= len(examined):
        n_rounded = sum(any(map(_ROUNDED.fullmatch, _parts(name))) for name in examined if is_natural(name))
        return SPREADSHEET if 2 * n_rounded > len(examined) else ""
    given, expected = next(iter(meant.items()))
    faults = dict.fromkeys(fault for pair in meant.items() for fault in _faults(*pair))
    reasons = f": {'; '.join(faults)}" if faults else ""
    return f"Probably {quoted(given)} means {quoted(expected)}{reasons}."


def shift(names: Iterable[str], manifest: Manifest) -> int:
    """Return by how much all anno_ids of a file differ from those of the manifest; 0 if they do not."""
    numbers = sorted(int(name) for name in names if _DIGITS.fullmatch(name) and len(name) < _MAX_DIGITS)
    own = sorted(manifest.anno_id.tolist())
    if len(numbers) != len(own) or not own:
        return 0
    difference = numbers[0] - int(own[0])
    is_shifted = all(number - right == difference for number, right in zip(numbers, own, strict=True))
    return difference if is_shifted else 0


def is_natural(name: str) -> bool:
    """Say whether a key has the parts of a natural key, whatever separates them."""
    return len(name) <= _MAX_CHARS and len(_parts(name)) > 2


def _natural_keys_meant(names: Sequence[str], manifest: Manifest) -> dict[str, str]:
    candidates = {name: list(_plain_keys(name)) for name in names if is_natural(name)}
    if not candidates:
        return {}
    by_plain: dict[tuple[str, ...], str] = {}
    ambiguous = set[tuple[str, ...]]()
    for key in manifest.natural_keys:
        plain = _plain(_parts(key))
        if by_plain.setdefault(plain, key) != key:
            ambiguous.add(plain)
    return {
        name: by_plain[plain]
        for name, plains in candidates.items()
        for plain in reversed(plains)
        if plain in by_plain and plain not in ambiguous
    }


def _anno_ids_meant(names: Iterable[str], manifest: Manifest) -> dict[str, str]:
    row_of = manifest.row_of_id
    numbers = {name: _number(name.strip(_AROUND)) for name in names}
    return {name: number for name, number in numbers.items() if number in row_of}


def _parts(name: str) -> list[str]:
    plain = _SUFFIX.sub("", name.strip(_AT_ENDS))
    parts = _SEPARATOR.split(plain)
    if len(parts) == 1:
        # The name of a recording can contain each of these, the other three parts cannot.
        splits = (plain.rsplit(separator, 3) for separator in _OTHER_SEPARATORS)
        parts = next((each for each in splits if len(each) == 4), parts)
    return [part.strip(_AROUND) for part in parts]


def _plain(parts: Sequence[str]) -> tuple[str, ...]:
    """Spell parts without what programs add or lose: zeros in front, words before numbers, capitals."""
    return tuple((_number(part) or part).lower() for part in parts)


def _number(part: str) -> str:
    prefix = _PREFIX.match(part) if len(part) <= _MAX_CHARS else None
    return _whole(part[prefix.end() :] if prefix else part)


def _plain_keys(name: str) -> Iterator[tuple[str, ...]]:
    parts = _parts(name)
    yield _plain(parts)
    if len(parts) == 4:
        for factor in _UNITS.values():
            ts = _whole(parts[2], factor=factor)
            if ts:
                yield _plain([*parts[:2], ts, parts[3]])


def _whole(text: str, *, factor: int = 1) -> str:
    """Spell a whole number plainly, `1.5e+09` as 1500000000; empty for other texts."""
    if len(text) > _MAX_DIGITS or not text.isascii():
        return ""
    if text.isdigit():
        return str(int(text) * factor)
    try:
        number = Decimal(text)
    except InvalidOperation:
        return ""
    if not number.is_finite() or number.adjusted() > _MAX_DIGITS:
        return ""
    number *= factor
    return str(int(number)) if number == number.to_integral_value() else ""


def _faults(given: str, expected: str) -> Iterator[str]:
    """Name the differences between a key and the one that it probably means."""
    if "/" in expected:
        yield from _faults_between_parts(given, expected)
    for number, (part, right) in enumerate(zip(_parts(given), expected.split("/"), strict=False)):
        if part == right:
            continue
        if number == 2 and _DIGITS.fullmatch(right) and _whole(part) != right:
            unit = next((unit for unit, factor in _UNITS.items() if _whole(part, factor=factor) == right), "")
            yield f"ts is in nanoseconds{f', not in {unit}' if unit else ''}"
        elif _DIGITS.fullmatch(part) and part.lstrip("0") == right.lstrip("0"):
            yield f"leading zeros are {'missing' if len(part) < len(right) else 'too many'}"
        elif _PREFIX.match(part):
            yield "a part has letters before its number"
        elif part.lower() == right.lower():
            yield "capitals differ"
        elif _whole(part) == right:
            yield "a whole number is written as a float"


def _faults_between_parts(given: str, expected: str) -> Iterator[str]:
    if "\\" in given:
        yield "parts are separated by / , not by \\"
    elif given.strip("/").count("/") != expected.count("/"):
        yield "parts are separated by /"
    elif given != given.strip("/"):
        yield "no / stands before or behind a key"
    if _SUFFIX.search(given):
        yield "a key has no suffix of a file"
