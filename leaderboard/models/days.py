"""Days in UTC: the precision at which everybody sees the times of an anonymous method.

A second would tell whose it is: of a team that sends an anonymous method and a named one in one go, say.
"""

from datetime import UTC, datetime, time


def truncate_to_day(at: datetime, *, is_masked: bool) -> datetime:
    """The time as everybody sees it: of an anonymous method the beginning of its day.

    >>> truncate_to_day(datetime(2026, 11, 21, 15, 4, 5, tzinfo=UTC), is_masked=True).isoformat()
    '2026-11-21T00:00:00+00:00'
    """
    return datetime.combine(at.astimezone(UTC).date(), time.min, tzinfo=UTC) if is_masked else at


def truncate_to_day_or_none(at: datetime | None, *, is_masked: bool) -> datetime | None:
    """The same of what may not have happened."""
    return None if at is None else truncate_to_day(at, is_masked=is_masked)


def known_until(at: datetime, *, is_masked: bool) -> datetime:
    """Time up to which a board as of `at` knows events of a method; for an anonymous one the end of that day.

    So its time cannot be narrowed down by a series of boards.

    >>> known_until(datetime(2026, 11, 21, 15, 4, 5, tzinfo=UTC), is_masked=True).isoformat()
    '2026-11-21T23:59:59.999999+00:00'
    """
    return datetime.combine(at.astimezone(UTC).date(), time.max, tzinfo=UTC) if is_masked else at
