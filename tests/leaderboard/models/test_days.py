"""Times of an anonymous method are days in UTC, however they are written."""

from datetime import UTC, datetime, timedelta, timezone

import pytest

from leaderboard.models.days import known_until, truncate_to_day, truncate_to_day_or_none

AFTERNOON = datetime(2026, 11, 21, 15, 4, 5, 6, tzinfo=UTC)
# Already the 22nd where it was written, still the 21st in UTC.
PAST_MIDNIGHT = datetime(2026, 11, 22, 1, tzinfo=timezone(timedelta(hours=2)))


@pytest.mark.parametrize("at", [AFTERNOON, PAST_MIDNIGHT])
def test_a_masked_time_is_its_day_and_counts_until_the_end_of_it(at: datetime) -> None:
    assert truncate_to_day(at, is_masked=True).isoformat() == "2026-11-21T00:00:00+00:00"
    assert known_until(at, is_masked=True).isoformat() == "2026-11-21T23:59:59.999999+00:00"
    assert truncate_to_day(at, is_masked=False) == known_until(at, is_masked=False) == at


def test_no_time_stays_none() -> None:
    assert truncate_to_day_or_none(None, is_masked=True) is None
    assert truncate_to_day_or_none(AFTERNOON, is_masked=False) == AFTERNOON
