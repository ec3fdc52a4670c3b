"""Times of an anonymous method: everybody sees the day, and nothing finer."""

import re
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from django.test import Client

from leaderboard.models import Edition, Evaluation, Method, Publication, Submission, User, Visibility
from tests import builders

pytestmark = pytest.mark.slow

DAY = datetime(2026, 1, 2, tzinfo=UTC)
NOON = datetime(2026, 1, 2, 12, 34, 56, tzinfo=UTC)
ADDRESSES = (
    *("/board/test/", "/board/test/charts/", "/board/test/editions/1/", "/methods/{method}/"),
    *("/board/test/feed.atom", "/board/test.csv", "/board/test.bib", "/board/test/?at=2026-01-03"),
    *("/api/v1/splits/test/board", "/api/v1/splits/test/editions/1/board", "/api/v1/methods/{method}"),
)


@pytest.fixture
def at_noon(edition: Edition, owner: User) -> Method:
    """An anonymous method that came on a day long past, at noon, to a board that was there in the morning."""
    builders.submit(owner, builders.predictions(edition, factor=1.0000001), method="Secret sauce")
    builders.score_all()
    Method.objects.update(visibility=Visibility.ANONYMOUS, shown_at=NOON)
    Submission.objects.update(submitted_at=NOON - timedelta(minutes=1))
    Evaluation.objects.update(finished_at=NOON - timedelta(seconds=30))
    Publication.objects.update(at=DAY + timedelta(hours=8))
    Edition.objects.update(published_at=DAY + timedelta(hours=8))
    builders.board_changed("test")
    return Method.objects.get()


def api_rows(client: Client, at: datetime | None = None) -> dict[str, dict[str, Any]]:
    query = {"at": at.isoformat()} if at else {}
    entries = client.get("/api/v1/splits/test/board", query).json()["entries"]
    return {entry["method"]: entry for entry in entries}


def test_times_of_an_anonymous_method_are_shown_by_the_day(client: Client, at_noon: Method) -> None:
    for withdrawn_at in (None, NOON + timedelta(minutes=1)):
        Submission.objects.update(withdrawn_at=withdrawn_at)
        builders.board_changed("test")
        answers = [client.get(address.format(method=at_noon.pk)) for address in ADDRESSES]
        text = "".join(answer.text + repr(sorted(answer.items())) for answer in answers)
        assert at_noon.pseudonym in text
        assert re.findall(r"2026-01-02.12:3\d", text) == []
    assert api_rows(client)[at_noon.pseudonym]["withdrawn_at"] == "2026-01-02T00:00:00Z"
    Method.objects.update(visibility=Visibility.PUBLIC)
    builders.board_changed("test")
    assert api_rows(client)["Secret sauce"]["withdrawn_at"] == "2026-01-02T12:35:56Z"


def test_boards_of_one_day_do_not_tell_when_on_it_an_anonymous_method_came(
    client: Client, at_noon: Method
) -> None:
    boards = [api_rows(client, DAY + timedelta(hours=hour)) for hour in (8, 12, 13, 23)]
    assert all(board == boards[0] for board in boards)
    assert boards[0][at_noon.pseudonym]["rank"] == 1
    Method.objects.update(visibility=Visibility.PUBLIC)
    builders.board_changed("test")
    shown = [
        "Secret sauce" in api_rows(client, at)
        for at in (NOON - timedelta(seconds=1), NOON, DAY + timedelta(days=1))
    ]
    assert shown == [False, True, True]
