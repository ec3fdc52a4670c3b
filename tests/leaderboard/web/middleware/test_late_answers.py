"""While a worker draws what came to a board, anybody gets the former one, which says so; else nobody does."""

from collections.abc import Iterator
from datetime import timedelta

import pytest
from django.db.models import F
from django.db.models.functions import Now
from django.test import Client
from django.utils import timezone
from pytest_django import Settings

from leaderboard import versions
from leaderboard.boards import snapshots
from leaderboard.models import BoardVersion, Edition, Submission, User
from leaderboard.submissions import submissions
from leaderboard.web.middleware.page_cache import BEHIND, late_pages, memory
from tests import builders

API = "/api/v1/splits/test/board"
PAGE = "/board/test/"
LINE = "not on this page yet"
GZIP = {"accept-encoding": "gzip"}


@pytest.fixture(autouse=True)
def lag(settings: Settings) -> Iterator[None]:
    """As in production."""
    settings.BOARD_LAG = timedelta(seconds=60)
    memory.clear()
    late_pages.clear()
    yield
    memory.clear()
    late_pages.clear()


@pytest.fixture
def readers(edition: Edition) -> Client:
    """Anybody, after having read what there is."""
    client = Client()
    for address in (API, PAGE):
        assert BEHIND not in client.get(address).headers
    return client


def score(owner: User, edition: Edition, *, method: str = "Foo", factor: float = 1.1) -> Submission:
    """One more row for everybody to see."""
    submission = builders.submit(owner, builders.predictions(edition, factor=factor), method=method)
    builders.score_all()
    return submission


def names(client: Client) -> set[str]:
    return {entry["method"] for entry in client.get(API).json()["entries"]}


def test_the_former_board_is_served_with_its_own_tag_until_the_new_one_is_drawn(
    readers: Client, edition: Edition, owner: User
) -> None:
    before = readers.get(API)
    page_before = readers.get(PAGE)
    score(owner, edition)
    late, page = readers.get(API), readers.get(PAGE)
    assert late[BEHIND] == page[BEHIND] == "true"
    assert (late.content, late["ETag"]) == (before.content, before["ETag"])
    assert LINE in page.text
    assert LINE not in page_before.text
    assert page["ETag"] != page_before["ETag"]
    assert readers.get(API, headers={"if-none-match": before["ETag"]}).status_code == 304
    snapshots.draw(edition)
    now, page = readers.get(API), readers.get(PAGE)
    assert BEHIND not in now.headers
    assert BEHIND not in page.headers
    assert "Foo" in names(readers)
    assert "Foo" in page.text
    assert LINE not in page.text
    assert now["ETag"] != before["ETag"]


def test_who_signed_in_finds_their_row_at_once(readers: Client, edition: Edition, owner: User) -> None:
    score(owner, edition)
    own = Client()
    own.force_login(owner)
    answer = own.get(API)
    assert BEHIND not in answer.headers
    assert "Foo" in {entry["method"] for entry in answer.json()["entries"]}
    # It was drawn for them: from then on everybody gets it.
    assert "Foo" in names(readers)


def test_what_was_taken_from_view_is_gone_at_once(readers: Client, edition: Edition, owner: User) -> None:
    first = score(owner, edition)
    snapshots.draw(edition)
    assert "Foo" in names(readers)
    score(owner, edition, method="Bar", factor=1.2)
    assert BEHIND in readers.get(API).headers
    submissions.withdraw(submission=first, actor=owner, now=timezone.now())
    assert BEHIND not in readers.get(API).headers
    [row] = [entry for entry in readers.get(API).json()["entries"] if entry["method"] == "Foo"]
    assert row["withdrawn_at"] is not None


def test_no_answer_is_late_for_longer_than_the_lag(readers: Client, edition: Edition, owner: User) -> None:
    score(owner, edition)
    score(owner, edition, method="Bar", factor=1.2)
    since = BoardVersion.objects.get(split="test").behind_since
    assert since is not None
    assert BEHIND in readers.get(API).headers
    BoardVersion.objects.update(behind_since=Now() - timedelta(seconds=61))
    assert BEHIND not in readers.get(API).headers
    assert {"Foo", "Bar"} <= names(readers)


def test_further_additions_do_not_begin_the_lag_anew(readers: Client, edition: Edition, owner: User) -> None:
    score(owner, edition)
    BoardVersion.objects.update(behind_since=F("behind_since") - timedelta(seconds=30))
    since = BoardVersion.objects.get(split="test").behind_since
    score(owner, edition, method="Bar", factor=1.2)
    assert BoardVersion.objects.get(split="test").behind_since == since


def test_no_reader_gets_an_older_board_than_one_that_was_drawn(
    readers: Client, edition: Edition, owner: User
) -> None:
    score(owner, edition)
    snapshots.draw(edition)  # another process may have shown it
    score(owner, edition, method="Bar", factor=1.2)
    answer = readers.get(API)
    assert BEHIND not in answer.headers
    assert {"Foo", "Bar"} <= {entry["method"] for entry in answer.json()["entries"]}


def test_a_late_page_is_compressed_as_any_other(readers: Client, edition: Edition, owner: User) -> None:
    score(owner, edition)
    answer = readers.get(PAGE, headers=GZIP)
    assert answer["Content-Encoding"] == "gzip"
    assert answer[BEHIND] == "true"
    assert readers.get(PAGE, headers=GZIP | {"if-none-match": answer["ETag"]}).status_code == 304


def test_in_the_embedded_profile_nobody_is_late(
    readers: Client, edition: Edition, owner: User, settings: Settings
) -> None:
    settings.BOARD_LAG = timedelta(0)
    score(owner, edition)
    assert BEHIND not in readers.get(API).headers
    assert versions.number("test") > 0
