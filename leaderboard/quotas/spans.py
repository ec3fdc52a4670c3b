"""Spans of time as people write them: 30 days, 24 hours, 90 minutes."""

import re
from datetime import timedelta
from typing import Final

from leaderboard.errors.refusals import Refused
from leaderboard.models.quotas import MAX_SPAN
from leaderboard.quotas import quotas

_UNITS: Final = {
    "day": timedelta(days=1),
    "hour": timedelta(hours=1),
    "minute": timedelta(minutes=1),
    "second": timedelta(seconds=1),
}
_SPAN: Final = re.compile(rf"\s*([\d,]{{1,12}})\s*({'|'.join(_UNITS)})s?\s*", re.ASCII | re.IGNORECASE)


def parse(text: str, *, field: str = "") -> timedelta:
    """The span of a text such as `quotas.span` writes, also of none (0 days). Raises `Refused`."""
    found = _SPAN.fullmatch(text)
    number = found[1].replace(",", "") if found else ""
    if found is None or not number:
        raise Refused(
            "bad-value",
            f"{text.strip()[:40]!r} is no span of time; expected one like 30 days, 24 hours or 90 minutes.",
            field=field,
        )
    n, unit = int(number), _UNITS[found[2].lower()]
    if n > MAX_SPAN // unit:
        raise Refused(
            "bad-value",
            f"That is longer than ten years; expected at most {quotas.span(MAX_SPAN)}.",
            field=field,
        )
    return n * unit
