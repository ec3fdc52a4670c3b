"""A board's past: editions at addresses that stay, the board as it stood at a time, what changed."""

from datetime import timedelta
from pathlib import Path

import pytest
from django.test import Client
from django.utils import timezone

from leaderboard.models import Edition, Publication, Submission
from tests import builders, pages
from tests.editions import corrected, open_edition, publish

OLD, NEW = "/board/test/editions/1/", "/board/test/editions/2/"


@pytest.fixture
def replaced(entries: list[Submission], tmp_path: Path) -> Edition:
    """The second edition, which is the board; the first was."""
    second = open_edition(corrected(tmp_path, factor=1.3))
    builders.score_all()
    publish(second)
    return second


def get(client: Client, address: str) -> pages.Element:
    response = client.get(address)
    assert response.status_code == 200
    return pages.page(response)


def test_present_edition_is_the_board(client: Client, entries: list[Submission]) -> None:
    assert pages.board_rows(get(client, OLD)) == pages.board_rows(get(client, "/board/test/"))
    assert "not the board any more" not in get(client, OLD).one("main").text


def test_former_edition_keeps_its_board_and_names_its_successor(
    client: Client, entries: list[Submission], tmp_path: Path
) -> None:
    before = pages.board_rows(get(client, "/board/test/"))
    second = open_edition(corrected(tmp_path, factor=1.3))
    builders.score_all()
    publish(second)
    root = get(client, OLD)
    assert pages.board_rows(root) == before
    notice = root.one("p", class_="notice")
    assert "not the board any more" in notice.text
    assert notice.one("a").text == "edition 2"
    assert pages.board_rows(get(client, NEW)) == pages.board_rows(get(client, "/board/test/")) != before


def test_edition_in_preparation_is_nothing_to_anybody(
    client: Client, entries: list[Submission], tmp_path: Path
) -> None:
    open_edition(corrected(tmp_path, factor=1.3))
    assert client.get(NEW).status_code == 404
    assert client.get("/board/test/editions/7/").status_code == 404
    assert client.get("/board/val/editions/1/").status_code == 404


def test_board_as_it_stood_at_a_time(client: Client, entries: list[Submission]) -> None:
    yesterday = timezone.now() - timedelta(days=1)
    root = get(client, f"/board/test/?at={yesterday:%Y-%m-%d}")
    assert len(pages.board_rows(root)) == 5
    assert "as it stood on" in root.one("main").text
    assert len(pages.board_rows(get(client, f"/board/test/?at={timezone.now():%Y-%m-%d}"))) == 9


def test_sorting_keeps_the_time(client: Client, entries: list[Submission]) -> None:
    heads = get(client, "/board/test/?at=2030-01-02&sort=mid").one("thead").all("tr")[1].all("a")
    assert {"?at=2030-01-02&sort=" in head.attributes["href"] for head in heads} == {True}
    assert len(heads) == 14


@pytest.mark.parametrize("at", ["yesterday", "2026-13-40", "", "0"])
def test_no_time_is_a_clear_400(client: Client, benchmark: None, at: str) -> None:
    response = client.get("/board/test/", {"at": at})
    assert response.status_code == 400
    assert "is no date or time" in pages.page(response).one("main").text


def test_history_names_what_changed_and_why(client: Client, replaced: Edition) -> None:
    items = [li.text for li in get(client, "/board/test/").one("details", class_="history").all("li")]
    assert len(items) == 2
    assert "edition 2 published in place of edition 1. Labels corrected." in items[0]


def test_reasons_are_text_never_markup(client: Client, replaced: Edition) -> None:
    Publication.objects.update(reason="<script>alert(1)</script>")
    assert get(client, "/board/test/").one("main").all("script") == []


def test_withdrawn_entry_leaves_a_marked_row_without_values(
    client: Client, entries: list[Submission]
) -> None:
    Submission.objects.filter(pk=entries[0].pk).update(withdrawn_at=timezone.now())
    name = entries[0].method.name
    (row,) = [row for row in pages.board_rows(get(client, "/board/test/")) if row[1].startswith(name)]
    assert "withdrawn" in row[1]
    assert row[0] == "–"
    assert set(row[4:]) == {"–"}


def test_entry_that_the_next_edition_cannot_score_is_marked(
    client: Client, entries: list[Submission], tmp_path: Path
) -> None:
    # Without a recording, every file has keys too many, and none can be scored.
    second = open_edition(corrected(tmp_path, drop="0002"))
    builders.score_all()
    publish(second, leave_out=True)
    marked = [row for row in pages.board_rows(get(client, OLD)) if "not in the next edition" in row[1]]
    assert len(marked) == len(entries)


def test_only_the_present_board_is_the_canonical_one(client: Client, replaced: Edition) -> None:
    assert get(client, "/").one("link", rel="canonical").attributes["href"].endswith("/board/test/")
    assert get(client, OLD).all("link", rel="canonical") == []
    assert get(client, "/?at=2030-01-01").all("link", rel="canonical") == []
