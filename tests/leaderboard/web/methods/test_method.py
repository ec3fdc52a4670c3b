"""A method's page."""

from pathlib import Path

import pytest
from django.test import Client

from leaderboard.models import Edition, Method, User, Visibility
from tests import builders, pages

pytestmark = pytest.mark.slow


@pytest.fixture
def method(edition: Edition, owner: User) -> Method:
    builders.submit(
        owner,
        builders.predictions(edition, factor=1.2),
        description="First line.\n\nSecond <b>line</b>.",
        paper_url="https://example.org/paper",
    )
    builders.submit(owner, builders.predictions(edition, factor=1.05))
    builders.score_all()
    return Method.objects.get()


def get(client: Client, method: Method) -> pages.Element:
    return pages.get(client, f"/methods/{method.pk}/")


def test_it_says_what_it_is_and_where_to_read_more(client: Client, method: Method) -> None:
    main = get(client, method).one("main")
    assert main.one("h1").text == "Foo"
    assert "Owls" in main.text
    assert [p.text for p in main.one("div", class_="description").all("p")] == [
        "First line.",
        "Second <b>line</b>.",
    ]
    assert main.one("a", href="https://example.org/paper").attributes["rel"] == "nofollow ugc"


def test_its_values_are_those_of_the_board(client: Client, method: Method) -> None:
    (row,) = [
        row for row in pages.board_rows(pages.page(client.get("/board/test/"))) if row[1].startswith("Foo")
    ]
    main = get(client, method).one("main")
    by_range = [
        [cell.text.removesuffix(" best").removesuffix(" second") for cell in each.all("td", class_="score")]
        for each in main.one("div", class_="result").one("tbody").all("tr")
    ]
    mids, rtes = zip(*by_range, strict=True)
    assert [*mids, *rtes] == row[2:]
    card = main.one("dl", class_="score-card").text
    assert row[2] in card
    assert f"Rank{row[0]} of 6" in card


def test_each_split_stands_in_its_own_section(
    client: Client, method: Method, owner: User, tmp_path: Path
) -> None:
    demo = builders.import_truth(tmp_path, split="demo", seed=1)
    builders.submit(owner, builders.predictions(demo), split="demo")
    builders.score_all()
    sections = get(client, method).all("section")
    assert [section.one("h2").one("a").text for section in sections] == ["Test", "Demo"]
    assert "Simulated data" in sections[1].text
    assert "Simulated" not in sections[0].text


def test_method_without_a_score_leads_to_the_board_that_its_file_was_sent_to(
    signed_in: Client, edition: Edition, owner: User, tmp_path: Path
) -> None:
    builders.import_truth(tmp_path, split="val", seed=1)
    sent = builders.send(owner, b"{}", split="val", method="Nothing scored").submission
    root = pages.page(signed_in.get(f"/methods/{sent.method_id}/"))
    trail = root.one("p", class_="trail").one("a")
    assert (trail.text, trail.attributes["href"]) == ("Validation", "/board/val/")
    assert root.one("nav", class_="site-nav").all("a")[0].attributes["href"] == "/board/val/"


def test_private_method_is_marked_for_its_team(
    client: Client, method: Method, owner: User, teammate: User
) -> None:
    Method.objects.update(visibility=Visibility.PRIVATE)
    for member in (owner, teammate):
        client.force_login(member)
        assert "only your team sees this page" in get(client, method).one("main").text
