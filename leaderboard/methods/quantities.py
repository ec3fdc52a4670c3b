"""Counts and measures as people write them: 25M, 31e6, 25,000,000, 50 ms."""

import math
import re
from collections.abc import Mapping
from decimal import Decimal
from typing import Final

_GROUPED: Final = re.compile(r"[0-9]{1,3}(?:([, _\u00a0\u202f])[0-9]{3})(?:\1[0-9]{3})*(?![0-9])", re.ASCII)
_COUNT: Final = re.compile(
    r"([0-9]{1,16}(?:\.[0-9]{1,15})?)(?:e\+?([0-9]{1,2}))? ?(k|m|b|g|thousand|million|billion)?", re.ASCII
)
_TIMES: Final = {
    "k": 10**3,
    "m": 10**6,
    "b": 10**9,
    "g": 10**9,
    "thousand": 10**3,
    "million": 10**6,
    "billion": 10**9,
}
_MEASURE: Final = re.compile(r"([0-9.]+(?:e[+-]?[0-9]{1,3})?) ?([a-zµμ]*)")


def count_of(text: str) -> Decimal:
    """The number that a text means, which may have a part behind the point. Raises `ValueError`.

    >>> [int(count_of(text)) for text in ("25M", "31e6", "25,000,000", "0.4 million", "7")]
    [25000000, 31000000, 25000000, 400000, 7]
    """
    found = _COUNT.fullmatch(_plain(text))
    if found is None:
        raise ValueError(text)
    power, times = int(found[2] or 0), _TIMES.get(found[3], 1)
    return Decimal(found[1]) * 10**power * times


def measure_of(text: str, units: Mapping[str, float]) -> float:
    """The finite number that a text means, times the factor of its unit if it names one. Raises `ValueError`.

    >>> milliseconds = {"ms": 1, "s": 1000}
    >>> [measure_of(text, milliseconds) for text in ("50", "50 ms", "0.05s", "1,250.5")]
    [50.0, 50.0, 50.0, 1250.5]
    """
    found = _MEASURE.fullmatch(_plain(text))
    if found is None or (found[2] and found[2] not in units):
        raise ValueError(text)
    number = float(found[1]) * units.get(found[2], 1)
    if not math.isfinite(number):
        raise ValueError(text)
    return number


def _plain(text: str) -> str:
    """In small letters, without what sets thousands apart. Raises `ValueError` for a text of many words."""
    text = text.strip()
    if len(text) > 60:
        raise ValueError(text)
    return _GROUPED.sub(lambda found: re.sub(r"[^0-9]", "", found[0]), text.lower(), count=1)
