"""Names that people choose: taken ones, and look-alikes (UTS 39)."""

import re
import unicodedata
from collections.abc import Callable, Iterable, Mapping
from datetime import datetime, timedelta
from functools import cache
from itertools import pairwise
from typing import Any

from django.conf import settings

from leaderboard.errors.refusals import Refused, clean_text

MAX_NAME = 80
MAX_LOOK = 320
RESERVED = "Anonymous"

# Letters that differ by case or by name alone, and pairs that read as one letter.
_ONE_LOOK = str.maketrans({"i": "l", "1": "l", "|": "l", "0": "o", "m": "rn", "w": "vv"})
# Characters without ink that are no spaces or controls by their category.
_WITHOUT_INK = frozenset(
    [
        *(0x034F, 0x115F, 0x1160, 0x17B4, 0x17B5, 0x2800, 0x3164, 0xFFA0),
        *range(0x180B, 0x1810),
        *range(0xFE00, 0xFE10),
        *range(0xE0100, 0xE01F0),
    ]
)
_MAX_MARKS = 2
# What stands around and between words beside punctuation; "<" and ">" look like brackets.
_SEPARATORS = frozenset("<>~´¨")
# Marks of a trade or a source, which NFKD would write as letters.
_SIGNS = str.maketrans(dict.fromkeys("™℠", " "))
# Lines that read as a dash; the sign of a long vowel is a letter after kana alone.
_LINES = re.compile("[─━]|(?<![\u3041-\u30ff])ー")
# What a final letter of Greek and a letter of German look like, which lists of twins name otherwise.
_OTHER_LOOKS = str.maketrans({"ς": "s", "β": "ss"})
# Letters that are read as digits between digits and separators.
_LIKE_DIGITS = frozenset("oil|")


def skeleton(name: str) -> str:
    """Return a key of at most `MAX_LOOK` characters, none of them a space; names with equal keys look alike.

    Spaces and punctuation count between two digits alone, where any of them is a full stop. Badges, such as
    a star or a tick, do not count.

    >>> skeleton("Foo  Lab") == skeleton("ｆｏｏ-lab") == skeleton("(Fоο Lаb)")
    True
    >>> skeleton("Foo 1.2") == skeleton("Foo 1-2"), skeleton("Foo 1.2") == skeleton("Foo 12")
    (True, False)
    """
    plain = unicodedata.normalize("NFKD", _LINES.sub("-", name).translate(_SIGNS)).translate(_OTHER_LOOKS)
    folded = "".join(_folded(character) for character in plain).casefold()
    return _without_separators(folded).translate(_ONE_LOOK)[:MAX_LOOK]


def _without_separators(text: str) -> str:
    spaced = "".join(" " if _separates(character) else character for character in text)
    parts = spaced.split()
    kept = parts[:1]
    for before, part in pairwise(parts):
        is_number = _ends_like_digit(before, before[-1]) and _ends_like_digit(part, part[0])
        kept += [".", part] if is_number else [part]
    return "".join(kept)


def _ends_like_digit(part: str, end: str) -> bool:
    return end.isdigit() or all(each.isdigit() or each in _LIKE_DIGITS for each in part)


def _separates(character: str) -> bool:
    category = unicodedata.category(character)
    return character != "|" and (character in _SEPARATORS or category[0] in "PZ" or category in {"Sk", "So"})


def clean_name(field: str, text: str) -> str:
    """Clean a name. Raises `Refused` for an empty one or invisible characters."""
    text = clean_text(field, _with_plain_spaces(text), limit=MAX_NAME)
    n_marks = 0
    for character in text:
        category = unicodedata.category(character)
        n_marks = n_marks + 1 if category in {"Mn", "Me"} else 0
        if category in {"Cc", "Cf", "Zl", "Zp"} or ord(character) in _WITHOUT_INK or n_marks > _MAX_MARKS:
            raise Refused(
                "bad-character",
                f"The name in '{field}' has the character U+{ord(character):04X}, "
                f"{unicodedata.name(character, 'without a name')}; expected characters that one can see.",
                field=field,
            )
    if not any(unicodedata.category(character)[0] in "LN" for character in text):
        raise Refused(
            "bad-name", f"The name in '{field}' is {text!r}; expected a letter or a digit in it.", field=field
        )
    if skeleton(RESERVED) in skeleton(text):
        raise Refused(
            "reserved-name",
            f"The name in '{field}' looks as if it had the word {RESERVED!r}, which is reserved for methods "
            "without a name; expected another name.",
            field=field,
        )
    return text


def require_rename_possible(*, renamed_at: datetime | None, now: datetime) -> None:
    """Raise `Refused` for what was renamed lately."""
    if renamed_at is None or now >= renamed_at + settings.RENAME_AFTER:
        return
    again_at = renamed_at + settings.RENAME_AFTER
    again_at += timedelta(minutes=1)  # the minute that has begun by then
    raise Refused(
        "renamed-lately",
        f"The name was changed at {renamed_at:%Y-%m-%d %H:%M} UTC; expected the next change after "
        f"{again_at:%Y-%m-%d %H:%M} UTC.",
        field="name",
    )


def confusable_with(name: str, others: Iterable[str]) -> str | None:
    """Return the first of the other names that looks like this one."""
    wanted = skeleton(name)
    return next((other for other in others if skeleton(other) == wanted), None)


def numbered(wanted: str, *, is_taken: Callable[[str], object]) -> str:
    """Add the first number under which the name is free."""
    name, number = wanted, 1
    while is_taken(name):
        number += 1
        ending = f" {number}"
        name = f"{wanted[: MAX_NAME - len(ending)]}{ending}"
    return name


def _with_plain_spaces(text: str) -> str:
    spaced = "".join(" " if unicodedata.category(character) == "Zs" else character for character in text)
    return " ".join(part for part in spaced.split(" ") if part)


def _folded(character: str) -> str:
    # Marks above and below letters are too small to tell names apart.
    category = unicodedata.category(character)
    if character.isascii():
        return character
    if category in {"Mn", "Me", "Cf"}:
        return ""
    if category == "Pd":
        return "-"
    # Where only the other case has a twin in ASCII, both have its look: a name in Cyrillic is one name.
    for form in (character, character.swapcase(), character.casefold()):
        look = _prototypes().get(form, form)
        if look.isascii():
            return look
    # Small capitals, and letters in circles and squares.
    for kind in ("LATIN LETTER SMALL CAPITAL ", "LATIN CAPITAL LETTER "):
        letter = unicodedata.name(character, "").partition(kind)[2]
        if len(letter) == 1:
            return letter
    return _prototypes().get(character.casefold(), character.casefold())


@cache
def _prototypes() -> Mapping[str, str]:
    from confusable_homoglyphs.confusables import (  # noqa: PLC0415 - a list of 0.9 MB, which few processes need
        confusables_data,
    )

    data: Mapping[str, list[dict[str, Any]]] = confusables_data
    # The library lists pairs both ways round: what has many partners is the target.
    prototypes = {}
    for character, partners in data.items():
        if len(character) != 1 or character.isascii() or len(partners) != 1:
            continue
        target = partners[0]["c"]
        is_pair = len(data.get(target, [])) == 1 and len(target) == 1
        if not is_pair or target.isascii() or ord(target) < ord(character):
            prototypes[character] = _without_marks(target)
    return prototypes


def _without_marks(text: str) -> str:
    decomposed = unicodedata.normalize("NFKD", text)
    return "".join(c for c in decomposed if unicodedata.category(c) not in {"Mn", "Me", "Cf"}) or decomposed
