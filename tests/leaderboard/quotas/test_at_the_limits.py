"""What quotas, times of splits and spans say exactly at their limits, and a little beside them."""

from datetime import UTC, datetime, timedelta

import pytest

from leaderboard.errors.refusals import Refused
from leaderboard.models import Edition, QuotaOverride, Split, User
from leaderboard.models.benchmark import Listing
from leaderboard.quotas import admissions, mailboxes, usage
from leaderboard.quotas.spans import parse_span, span

NOW = datetime(2026, 11, 20, 12, 0, tzinfo=UTC)
DAY, HOUR = timedelta(days=1), timedelta(hours=1)
SECOND = timedelta(seconds=1)


def quota(*, spent: int = 0, rejected: int = 0, **rules: object) -> usage.Quota:
    """After so many submissions, the last of them 30 s before an hour ago and the others an hour apart."""
    last = NOW - HOUR - timedelta(seconds=30)

    def times(n: int) -> list[datetime]:
        return [last - number * HOUR for number in reversed(range(n))]

    given = QuotaOverride(**{f"quota_{name}": value for name, value in rules.items()})
    split = Split(name="test", title="Test")
    return usage.quota_at(split=split, rules=given, spent=times(spent), rejected=times(rejected), now=NOW)


@pytest.mark.parametrize(
    ("now", "sentence", "used", "left"),
    [
        (quota(), "No limit.", 0, None),
        (quota(limit=None, min_gap=HOUR, spent=2), "No limit, at least 1 hour apart.", 2, None),
        (quota(limit=3, spent=1), "2 of 3 submissions left (limit per 24 hours).", 1, 2),
        (quota(limit=1), "1 of 1 submission left (limit per 24 hours).", 0, 1),
        (
            quota(limit=2, spent=2, window=7 * DAY),
            "Your team has used 2 submissions to Test, its quota for 7 days; "
            "the next slot opens at 2026-11-27 10:00 UTC.",
            2,
            0,
        ),
        (
            quota(limit=2, spent=3, window=7 * DAY),
            "Your team has used 2 submissions to Test, its quota for 7 days; "
            "the next slot opens at 2026-11-27 10:00 UTC.",
            3,
            0,
        ),
        (
            quota(limit=9, spent=2, min_gap=2 * HOUR),
            "Submissions of a team to Test must be at least 2 hours apart; "
            "the next slot opens at 2026-11-20 13:00 UTC.",
            2,
            7,
        ),
        (
            quota(rejected_limit=2, rejected=2),
            "Your team has reached its limit for Test: within 24 hours, 2 files that were rejected, "
            "were cancelled, or stopped the process that read them; "
            "the next slot opens at 2026-11-21 10:00 UTC.",
            0,
            None,
        ),
        (quota(limit=0), "Your team may not submit to Test.", 0, 0),
        (quota(rejected_limit=0), "Your team may not submit to Test.", 0, None),
    ],
)
def test_a_quota_says_what_is_left_or_what_used_it_up(
    now: usage.Quota, sentence: str, used: int, left: int | None
) -> None:
    assert (now.sentence, now.used, now.left) == (sentence, used, left)
    assert now.is_open is ("left" in sentence or "No limit" in sentence)
    assert (now.next_slot_at is not None) is ("next slot" in sentence)


@pytest.mark.parametrize("window", [HOUR, DAY, 7 * DAY])
def test_a_file_leaves_the_window_and_a_rejected_one_the_day_exactly_at_the_edge(window: timedelta) -> None:
    moment = timedelta(microseconds=1)

    def times(span: timedelta) -> list[datetime]:
        return [NOW - span - moment, NOW - span, NOW - span + moment, NOW - span + SECOND]

    rules = QuotaOverride(quota_limit=9, quota_window=window, quota_rejected_limit=9)
    now = usage.quota_at(
        split=Split(name="test", title="Test"),
        rules=rules,
        spent=times(window),
        rejected=times(DAY),
        now=NOW,
    )
    assert (now.used, now.left, now.n_rejected) == (2, 7, 2)


def test_who_waits_is_told_whole_seconds_and_one_at_least() -> None:
    waiting = quota(limit=9, spent=1, min_gap=2 * HOUR)
    opens_at = waiting.next_slot_at
    assert opens_at == NOW + HOUR - timedelta(seconds=30)
    half = SECOND / 2
    told = [waiting.retry_after_s(now=opens_at - before) for before in (3 * half, SECOND, half, 0 * half)]
    assert told == [2, 1, 1, 1]
    assert (waiting.window_s, waiting.min_gap_s) == (86_400, 7_200)


TIMES = {"opens_at": NOW, "closes_at": NOW + DAY}
OPEN_UNTIL = "Open for submissions until 2026-11-21 12:00 UTC"
CLOSE_AT = "Submissions to Test close at 2026-11-21 12:00 UTC."


@pytest.mark.parametrize(
    ("fields", "at", "label", "sentence", "next_slot_at"),
    [
        ({}, NOW, "", "", None),
        (
            TIMES,
            NOW - SECOND,
            "Opens for submissions 2026-11-20 12:00 UTC",
            "Submissions to Test open at 2026-11-20 12:00 UTC.",
            NOW,
        ),
        (TIMES, NOW, OPEN_UNTIL, CLOSE_AT, None),
        (TIMES, NOW + DAY - SECOND, OPEN_UNTIL, CLOSE_AT, None),
        (
            TIMES,
            NOW + DAY,
            "Closed for submissions since 2026-11-21",
            "Submissions to Test closed at 2026-11-21 12:00 UTC.",
            None,
        ),
        (
            TIMES | {"listing": Listing.ARCHIVED},
            NOW,
            "Archived: closed for submissions",
            "Submissions to Test are closed: the split is archived.",
            None,
        ),
    ],
)
def test_a_split_says_until_the_second_whether_it_is_open(
    edition: Edition,
    owner: User,
    fields: dict[str, object],
    at: datetime,
    label: str,
    sentence: str,
    next_slot_at: datetime | None,
) -> None:
    Split.objects.filter(pk="test").update(**fields)
    split = Split.objects.get(pk="test")
    assert (admissions.label_of(split, now=at), admissions.sentence_of(split, now=at)) == (label, sentence)
    is_open = sentence in {"", CLOSE_AT}
    left = admissions.left(team=None, user=owner, split=split, now=at)
    assert (admissions.is_open(split, now=at), left.is_open) == (is_open, is_open)
    assert left.next_slot_at == next_slot_at
    assert is_open or left.sentence == sentence


def test_a_split_without_truth_promises_no_time(edition: Edition, owner: User) -> None:
    Split.objects.filter(pk="val").update(opens_at=NOW + DAY)
    split = Split.objects.get(pk="val")
    left = admissions.left(team=None, user=owner, split=split, now=NOW)
    assert (left.is_open, left.next_slot_at) == (False, None)
    assert left.sentence.endswith("open once the maintainers provide the ground truth.")
    assert admissions.label_of(split, now=NOW) == "Not open for submissions yet"


@pytest.mark.parametrize(
    ("text", "time"),
    [
        ("0 seconds", timedelta(0)),
        ("1 second", SECOND),
        ("59 seconds", 59 * SECOND),
        ("1 minute", 60 * SECOND),
        ("61 seconds", 61 * SECOND),
        ("1 hour", HOUR),
        ("25 hours", 25 * HOUR),
        ("24 hours", DAY),
        ("2 days", 2 * DAY),
        ("3,650 days", 3650 * DAY),
    ],
)
def test_a_span_is_read_as_it_is_written(text: str, time: timedelta) -> None:
    assert parse_span(f" {text.upper()} ") == time
    assert span(time) == text


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("3651 days", "That is longer than ten years; expected at most 3,650 days."),
        (", days", "', days' is not a span of time; expected one like 30 days or 90 minutes."),
        ("a" * 41, f"'{'a' * 40}' is not a span of time; expected one like 30 days or 90 minutes."),
    ],
)
def test_what_is_no_span_is_named_with_its_field(text: str, fault: str) -> None:
    with pytest.raises(Refused) as caught:
        parse_span(text, field="window")
    assert (str(caught.value), caught.value.field) == (fault, "window")
    assert span(-90 * SECOND) == "-90 seconds"


def test_domains_with_two_open_accounts_are_listed_and_single_ones_are_not(db: None) -> None:
    for email in ("a@b.example", "b@b.example", "a@a.example", "b@a.example", "x@c.example"):
        User.objects.create_user(email)
    for email in ("c@d.example", "d@d.example", "e@d.example"):
        User.objects.create_user(email)
    User.objects.create_user("closed@c.example", is_active=False)
    rows = [(row.name, row.n_accounts, row.n_files) for row in mailboxes.busiest_domains(now=NOW)]
    assert rows == [("d.example", 3, 0), ("a.example", 2, 0), ("b.example", 2, 0)]
    assert [row.name for row in mailboxes.busiest_domains(now=NOW, n_most=1)] == ["d.example"]
