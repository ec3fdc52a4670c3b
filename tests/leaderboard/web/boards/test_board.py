"""The board's page."""

import re
from datetime import UTC, datetime
from pathlib import Path

import pytest
from django.test import Client
from django.urls import reverse
from django.utils import timezone
from django.utils.dateparse import parse_datetime

from leaderboard.models import Edition, PublishedResult, Split, User
from tests import builders, pages
from tests.pages import get

pytestmark = pytest.mark.slow

RANK, METHOD, MID = range(3)
ISSUE_COLUMNS = [
    *("Rank", "Method"),
    *("MiD", "0–3 s", "3–6 s", "6–20 s", "−20–0 s"),
    *("RTE", "0–3 s", "3–6 s", "6–20 s", "−20–0 s"),
]


def row_of(root: pages.Element, name: str) -> pages.Element:
    rows = root.one("table", class_="board").one("tbody").all("tr")
    return next(row for row in rows if row.one("div", class_="name").text.startswith(name))


def test_columns_are_the_papers_in_its_order(client: Client, benchmark: None) -> None:
    heads = [
        head.all("a") for head in get(client).one("table", class_="board").one("thead").all("tr")[1].all("th")
    ]
    named = [link.children[0].text if link.children else link.text for link, *_ in heads]
    assert named == ISSUE_COLUMNS
    assert [link.text for link in heads[METHOD]] == ["Method", "Team", "Date"]
    assert [link.one("span", class_="caption").text for (link,) in heads[MID:]] == 2 * [
        *("overall", "crucial", "small", "large", "negative")
    ]


def test_published_numbers_stand_as_printed(client: Client, benchmark: None) -> None:
    first = pages.board_rows(get(client))[0]
    assert first[RANK] == "1"
    assert first[METHOD].startswith("Deep Scale")
    assert "Shi et al. 2023" in first[METHOD]
    assert first[MID:] == ["14.8", "27.6", "15.6", "11.5", "13.7", "12.3", "6.5", "8.8", "13.1", "15.0"]


def test_published_rows_are_marked_and_lead_to_their_citation(client: Client, edition: Edition) -> None:
    root = get(client)
    for row in root.one("table", class_="board").one("tbody").all("tr"):
        tag = row.one("a", class_="tag")
        assert tag.text == "published"
        source = root.one("li", id=tag.attributes["href"].removeprefix("#"))
        assert "Yuheng Shi" in source.text
        assert source.one("a").attributes["href"] == "https://arxiv.org/abs/2309.01539"


def test_board_of_published_rows_alone_says_so_once(client: Client, benchmark: None) -> None:
    root = get(client)
    assert root.one("table", class_="board").all("a", class_="tag") == []
    assert "results quoted from papers" in root.one("p", class_="facts").text
    assert "Yuheng Shi" in root.one("li", id="source-1").text


def test_heads_are_plain_links_that_turn_round(client: Client, benchmark: None) -> None:
    root = get(client, "/board/test/?sort=mid_crucial")
    (decisive,) = [head for head in root.all("th") if "aria-sort" in head.attributes]
    assert decisive.attributes["aria-sort"] == "ascending"
    assert decisive.one("a").attributes["href"] == "?sort=-mid_crucial"
    turned = get(client, "/board/test/?sort=-mid_crucial")
    (decisive,) = [head for head in turned.all("th") if "aria-sort" in head.attributes]
    assert decisive.attributes["aria-sort"] == "descending"
    assert decisive.one("a").attributes["href"] == "?sort=mid_crucial"


def test_open_split_without_submissions_says_how_to_be_the_first(client: Client, edition: Edition) -> None:
    notice = get(client).one("p", class_="notice")
    assert "no submissions to Test yet" in notice.text
    assert notice.one("a").attributes["href"] == "/submit/?split=test"


def test_board_without_any_row_has_no_empty_table(client: Client, benchmark: None) -> None:
    PublishedResult.objects.filter(split="test").delete()
    root = get(client)
    assert root.all("table") == []
    assert "Not open for submissions yet" in root.one("main").text


def test_closed_board_lists_what_is_open_once(client: Client, edition: Edition, tmp_path: Path) -> None:
    builders.import_truth(tmp_path, split="demo", seed=1)
    facts = get(client, "/board/val/").one("p", class_="facts")
    assert facts.one("span", class_="badge").text == "Not open for submissions yet"
    assert "Test and Demo are open" in facts.text
    Split.objects.filter(pk="test").update(closes_at=datetime(2026, 1, 31, tzinfo=UTC))
    assert get(client).one("span", class_="badge").text == "Closed for submissions since 2026-01-31"
    assert get(client).all("p", class_="notice") == []


def test_anonymous_row_changes_the_time_of_the_board_by_its_day(
    client: Client, edition: Edition, owner: User
) -> None:
    assert re.search(r"updated [0-9-]{10} [0-9:]{5} UTC", get(client).one("p", class_="facts").text)
    builders.submit(owner, builders.predictions(edition), visibility="ANONYMOUS")
    builders.score_all()
    assert re.search(r"updated [0-9-]{10}( |$)(?!.*UTC)", get(client).one("p", class_="facts").text)
    updated = parse_datetime(client.get("/api/v1/splits/test/board").json()["updated_at"])
    assert updated is not None
    assert updated.date() == timezone.now().date()
    assert updated >= timezone.now(), "the end of the day, so that it rises"


def test_chart_below_the_board_holds_for_any_filter(client: Client, benchmark: None) -> None:
    section = get(client, "/board/test/?q=nerf").one("section", class_="board-progress")
    assert "All methods on the board" in section.text
    assert "Pixel MSE" in section.text


def test_demo_says_that_its_truth_is_simulated(client: Client, tmp_path: Path, benchmark: None) -> None:
    builders.import_truth(tmp_path, split="demo")
    assert "Simulated data" in get(client, "/board/demo/").one("main").text
    assert "Simulated" not in get(client, "/board/test/").one("main").text


def test_head_line_names_sequences_edition_digest_and_protocol(client: Client, edition: Edition) -> None:
    facts = get(client).one("p", class_="facts")
    assert f"{builders.N_SEQUENCES} sequences" in facts.text
    assert f"edition 1 ground truth {edition.ground_truth.short_digest}" in facts.text
    assert "protocol tsttc-1" in facts.text
    assert "updated" in facts.text
    assert reverse("manifest", args=["test"]) in [a.attributes["href"] for a in facts.all("a")]


def test_split_tabs_mark_the_current_one(client: Client, benchmark: None) -> None:
    tabs = get(client, "/board/val/").one("nav", class_="splits").all("a")
    assert [tab.text for tab in tabs] == ["Test", "Validation", "Demo"]
    assert [tab.text for tab in tabs if "aria-current" in tab.attributes] == ["Validation"]


def test_my_teams_rows_are_marked_and_its_private_ones_stand_on_its_own_board_alone(
    client: Client, edition: Edition, owner: User, teammate: User, stranger: User
) -> None:
    for name, factor, visibility in (("Foo", 1.1, "PUBLIC"), ("Secret", 1.2, "PRIVATE")):
        data = builders.predictions(edition, factor=factor)
        builders.submit(owner, data, method=name, visibility=visibility)
    builders.score_all()
    assert b"Secret" not in client.get("/board/test/").content
    ring = row_of(get(client), "Foo").one("circle", class_="ring").attributes
    seen = {}
    for user in (owner, teammate, stranger):
        client.force_login(user)
        root = get(client)
        seen[user.name] = (
            "mine" in row_of(root, "Foo").classes,
            "private, would be rank" in root.one("table", class_="board").one("tbody").text,
        )
        assert ("6 results and 1 private" in root.one("main").text) == (user != stranger)
        assert row_of(root, "Foo").one("circle", class_="ring").attributes == ring, "on the public scale"
    assert seen == {"Owls": (True, True), "Mate": (True, True), "Strangers": (False, False)}


def test_interval_without_sequences_has_a_dash(client: Client, benchmark: None) -> None:
    result = PublishedResult.objects.get(split="test", slug="sot")
    result.scores = {**result.scores, "mid_crucial": None}
    result.save()
    assert pages.board_rows(get(client))[3][MID + 1] == "–"
