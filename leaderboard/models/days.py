"""Days in UTC: everybody sees the times of an anonymous method with this precision.

A second would link it to a named method that the team sent along.
"""

from datetime import UTC, datetime, time


def truncate_to_day(at: datetime, *, is_masked: bool) -> datetime:
    """Truncate the time of an anonymous method to its day."""
    return datetime.combine(at.astimezone(UTC).date(), time.min, tzinfo=UTC) if is_masked else at


def truncate_to_day_or_none(at: datetime | None, *, is_masked: bool) -> datetime | None:
    return None if at is None else truncate_to_day(at, is_masked=is_masked)


def known_until(at: datetime, *, is_masked: bool) -> datetime:
    """Return the time up to which a board as of `at` includes a method's events.

    For an anonymous method it is the end of the day, so that a series of boards cannot narrow its time down.
    """
    return datetime.combine(at.astimezone(UTC).date(), time.max, tzinfo=UTC) if is_masked else at
