"""Spans of time in words, as in the rules of quotas."""

import re
from datetime import timedelta
from typing import Final

from leaderboard.errors.refusals import Refused
from leaderboard.models.quotas import MAX_SPAN


def span(time: timedelta) -> str:
    """Word a span of time.

    >>> span(timedelta(days=30)), span(timedelta(days=1)), span(timedelta(minutes=90))
    ('30 days', '24 hours', '90 minutes')
    """
    seconds = round(time.total_seconds())
    if seconds < 0:
        return f"-{span(-time)}"
    units = ((86_400, "day", 2), (3_600, "hour", 1), (60, "minute", 1))
    fits = (unit for unit in units if seconds % unit[0] == 0 and seconds >= unit[2] * unit[0])
    unit_s, name, _ = next(fits, (1, "second", 0))
    n = seconds // unit_s
    return f"1 {name}" if n == 1 else f"{n:,} {name}s"


_UNITS: Final = {
    "day": timedelta(days=1),
    "hour": timedelta(hours=1),
    "minute": timedelta(minutes=1),
    "second": timedelta(seconds=1),
}
_SPAN: Final = re.compile(rf"\s*([\d,]{{1,12}})\s*({'|'.join(_UNITS)})s?\s*", re.ASCII | re.IGNORECASE)


def parse_span(text: str, *, field: str = "") -> timedelta:
    """Parse a span as `span` writes it, also 0 days. Raises `Refused`."""
    match = _SPAN.fullmatch(text)
    number = match[1].replace(",", "") if match else ""
    if match is None or not number:
        raise Refused(
            "bad-value",
            f"{text.strip()[:40]!r} is not a span of time; expected one like 30 days or 90 minutes.",
            field=field,
        )
    n, unit = int(number), _UNITS[match[2].lower()]
    if n > MAX_SPAN // unit:
        raise Refused(
            "bad-value",
            f"That is longer than ten years; expected at most {span(MAX_SPAN)}.",
            field=field,
        )
    return n * unit
