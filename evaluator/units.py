"""The unit of inference: a recording, a day, or the ground truth's column `unit`.

The unit is the day if the names of all recordings begin with a date and there are at least `MIN_DAYS` days,
else the recording. A column `unit` replaces this rule.
"""

# Recordings of one day have the same weather, road and driver: they are alike.

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from typing import Final, Literal

from evaluator.counting import counted

RECORDING: Final = "recording"
DAY: Final = "day"
GIVEN: Final = "given"
KINDS: Final = (RECORDING, DAY, GIVEN)
UnitKind = Literal["recording", "day", "given"]
MIN_DAYS: Final = 30
"""With fewer days the recording is the unit: a day each would leave too few units for the ranges to hold."""

_NOUNS: Final = {GIVEN: "unit"}
# 2023-04-06…, 2023_04_06… or 20230406…, and no digit behind it: a longer number is no date.
_DATE: Final = re.compile(r"((?:19|20)\d\d)([-_]?)(\d\d)\2(\d\d)(?!\d)", re.ASCII)


def noun_of(kind: str) -> str:
    return _NOUNS.get(kind, kind)


def in_words(kind: str, n: int | None = None) -> str:
    """Name `n` units of a kind, or the noun alone.

    >>> in_words("day", 42), in_words("recording", 1), in_words("given", 12), in_words("day")
    ('42 days', '1 recording', '12 units', 'days')
    """
    noun = noun_of(kind)
    return f"{noun}s" if n is None else counted(n, noun)


def day_of(recording: str) -> date | None:
    """Parse the date at the start of a recording's name, else None.

    >>> day_of("2023-04-06-13-00-46-797143"), day_of("20230314-081502"), day_of("2023_04_06_a")
    (datetime.date(2023, 4, 6), datetime.date(2023, 3, 14), datetime.date(2023, 4, 6))
    >>> day_of("2023-02-30-08"), day_of("1680757246797143"), day_of("sim-20240506-080000")
    (None, None, None)
    """
    match = _DATE.match(recording)
    if match is None:
        return None
    try:
        return date(int(match[1]), int(match[3]), int(match[4]))
    except ValueError:
        return None


@dataclass(frozen=True, slots=True)
class Units:
    """The units of recordings: their `names`, and the unit's `index` of every recording."""

    kind: UnitKind
    names: tuple[str, ...]
    index: tuple[int, ...]

    def __len__(self) -> int:
        return len(self.names)

    def __str__(self) -> str:
        return in_words(self.kind, len(self))


def units_of(recordings: Sequence[str], *, given: Mapping[str, str], kind: str | None = None) -> Units:
    """Return the units of recordings, by the rule or of `kind`; raises `ValueError` if they lack it."""
    days = None if kind in {RECORDING, GIVEN} or (given and kind is None) else _days(recordings)
    if kind is None:
        kind = GIVEN if given else DAY if days and len(set(days)) >= MIN_DAYS else RECORDING
    if kind == RECORDING:
        return Units(RECORDING, tuple(recordings), tuple(range(len(recordings))))
    if kind == GIVEN and given:
        return _grouped(GIVEN, [given[name] for name in recordings])
    if kind == DAY and days:
        return _grouped(DAY, days)
    raise ValueError(
        "The ground truth has no column unit; expected one to take its units."
        if kind == GIVEN
        else "Not every recording's name begins with a date; expected names as 2023-04-06-13-00-46 to take "
        "days as units."
        if kind == DAY
        else f"Unknown unit {kind!r}; expected one of {', '.join(KINDS)}."
    )


def _days(recordings: Sequence[str]) -> list[str] | None:
    days = [day.isoformat() for name in recordings if (day := day_of(name))]
    return days if len(days) == len(recordings) else None


def _grouped(kind: UnitKind, labels: Sequence[str]) -> Units:
    names = tuple(sorted(set(labels)))
    position = {name: i for i, name in enumerate(names)}
    return Units(kind, names, tuple(position[label] for label in labels))
