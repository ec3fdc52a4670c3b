"""The board on other sites: badges in READMEs, feeds in readers, and previews of links."""

import re
from datetime import timedelta
from xml.etree import ElementTree as ET

import pytest
from django.db import transaction
from django.test import Client
from django.utils import timezone
from django.utils.dateparse import parse_datetime

from leaderboard import board_versions
from leaderboard.models import Edition, Method, Score, Submission, User, Visibility
from leaderboard.submissions import intake
from tests import board_rows, builders, pages

ATOM = "{http://www.w3.org/2005/Atom}"
SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture
def methods(edition: Edition, owner: User) -> list[Method]:
    """Five rows of five teams."""
    return board_rows.fill(edition, n=5, user=owner)


def by_hand(method: Method, **values: object) -> None:
    """Change a method past the verbs, and say so as a verb would."""
    with transaction.atomic():
        Method.objects.filter(pk=method.pk).update(**values)
        board_versions.bump_all()


def badge(client: Client, method: Method, query: str = "") -> str:
    """The text of a badge; its drawing is well formed, and has the same text for screen readers."""
    response = client.get(f"/methods/{method.pk}/badge.svg{query}")
    assert response.status_code == 200
    assert response["Content-Type"] == "image/svg+xml"
    root = ET.fromstring(response.content)
    label, text = (element.text for element in root.iter(f"{SVG}text"))
    assert root.findtext(f"{SVG}title") == root.get("aria-label") == f"{label}: {text}"
    assert "style=" not in response.text  # which our own policy would not let through
    return f"{label}: {text}"


def feed(client: Client, address: str = "/board/test/feed.atom") -> ET.Element:
    response = client.get(address)
    assert (response.status_code, response["Content-Type"]) == (200, "application/atom+xml; charset=utf-8")
    return ET.fromstring(response.content)


def titles(root: ET.Element) -> list[str]:
    return [str(entry.findtext(f"{ATOM}title")) for entry in root.iter(f"{ATOM}entry")]


# --- badges ------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_badge_says_the_rank_and_the_value_of_the_page(methods: list[Method], client: Client) -> None:
    rows = pages.board_rows(pages.page(client.get("/board/test/")))
    for method in methods:
        [(rank_text, _, mid_text, *_)] = [row for row in rows if row[1].startswith(method.name)]
        [rank, *_], [mid, *_] = re.findall(r"\d+", rank_text), re.findall(r"[\d.]+", mid_text)
        assert badge(client, method) == f"TSTTC test: rank {rank}, MiD {mid}"


@pytest.mark.slow
def test_badge_says_what_there_is_instead_of_a_rank(
    methods: list[Method], edition: Edition, owner: User, client: Client
) -> None:
    assert badge(client, methods[0], "?split=val") == "TSTTC val: no entry"
    submission = builders.submit(owner, builders.predictions(edition), method="Gone")
    builders.score_all()
    by_hand(submission.method, visibility=Visibility.PUBLIC, shown_at=submission.submitted_at)
    intake.withdraw(submission=submission, actor=owner, now=timezone.now() + timedelta(seconds=1))
    assert badge(client, submission.method) == "TSTTC test: withdrawn"


def test_badge_follows_the_board_and_is_kept_as_long_as_it_stands(
    methods: list[Method], client: Client
) -> None:
    address = f"/methods/{methods[0].pk}/badge.svg"
    first = client.get(address)
    assert first["Cache-Control"] == "public, no-cache"
    assert first["Cross-Origin-Resource-Policy"] == "cross-origin"
    known = client.get(address, headers={"If-None-Match": first["ETag"]})
    assert known.status_code == 304
    assert known["Cross-Origin-Resource-Policy"] == "cross-origin"
    with transaction.atomic():
        Score.objects.filter(evaluation__submission__method=methods[0]).update(value=0.5)
        board_versions.bump("test")
    assert client.get(address, headers={"If-None-Match": first["ETag"]}).status_code == 200
    assert badge(client, methods[0]) == "TSTTC test: rank 1, MiD 0.5"


def test_no_badge_tells_that_a_private_method_is_there(
    methods: list[Method], owner: User, client: Client
) -> None:
    by_hand(methods[0], visibility=Visibility.PRIVATE)
    for user in (None, owner):
        if user:
            client.force_login(user)
        assert client.get(f"/methods/{methods[0].pk}/badge.svg").status_code == 404
    assert client.get(f"/methods/{methods[1].pk}/badge.svg?split=nowhere").status_code == 404


# --- feeds -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("address", ["/feed.atom", "/board/test/feed.atom", "/board/val/feed.atom"])
def test_feed_has_all_that_rfc_4287_asks_for(methods: list[Method], client: Client, address: str) -> None:
    root = feed(client, address)
    assert root.tag == f"{ATOM}feed"
    entries = root.findall(f"{ATOM}entry")
    assert len(entries) == (0 if "val" in address else len(methods))
    for element in (root, *entries):
        for name in ("id", "title", "updated"):
            assert len(element.findall(f"{ATOM}{name}")) == 1, name
        assert str(element.findtext(f"{ATOM}id")).startswith("urn:uuid:")
        assert parse_datetime(str(element.findtext(f"{ATOM}updated"))) is not None
    links = {link.get("rel"): link.get("href") for link in root.findall(f"{ATOM}link")}
    assert str(links["self"]).endswith(address)
    for entry in entries:
        assert entry.findtext(f"{ATOM}author/{ATOM}name")
        assert entry.find(f"{ATOM}link[@rel='alternate']") is not None
    ids = [entry.findtext(f"{ATOM}id") for entry in entries]
    assert len(set(ids)) == len(ids)


def test_what_was_shown_long_after_it_was_sent_is_news_from_then_on(
    methods: list[Method], client: Client
) -> None:
    shown_at = timezone.now() + timedelta(days=1)
    by_hand(methods[0], shown_at=shown_at)
    root = feed(client)
    assert titles(root)[0].startswith(methods[0].name)
    assert parse_datetime(str(root.findtext(f"{ATOM}updated"))) == shown_at.replace(microsecond=0)
    updated = parse_datetime(client.get("/api/v1/splits/test/board").json()["updated_at"])
    assert updated == shown_at


def test_feed_tells_what_everybody_sees_and_no_more(
    methods: list[Method], owner: User, client: Client
) -> None:
    by_hand(methods[0], visibility=Visibility.PRIVATE, name="Secretissimo")
    by_hand(methods[1], visibility=Visibility.ANONYMOUS, name="Maskenball")
    client.force_login(owner)
    text = client.get("/board/test/feed.atom").text
    assert "ecretissimo" not in text
    assert "askenball" not in text
    assert methods[1].pseudonym in text
    assert str(methods[0].pk) not in text


@pytest.mark.slow
def test_withdrawn_entries_leave_the_feed(edition: Edition, owner: User, client: Client) -> None:
    submission = builders.submit(owner, builders.predictions(edition), method="Gone")
    builders.score_all()
    by_hand(submission.method, visibility=Visibility.PUBLIC, shown_at=submission.submitted_at)
    assert [title.startswith("Gone") for title in titles(feed(client))] == [True]
    intake.withdraw(submission=Submission.objects.get(), actor=owner, now=timezone.now())
    assert titles(feed(client)) == []


# --- what a link to us shows -------------------------------------------------------------------------------


@pytest.mark.slow
def test_links_to_boards_and_methods_show_what_they_are(methods: list[Method], client: Client) -> None:
    first, second = methods[:2]
    for address, title in (
        ("/board/test/", "Test"),
        ("/board/test/charts/", "Charts of Test"),
        ("/board/test/editions/", "Editions of Test"),
        (f"/methods/{first.pk}/", first.name),
        (f"/compare/?m={first.pk}&m={second.pk}", "Comparison on Test"),
    ):
        head = pages.page(client.get(address)).one("head")
        properties = {
            m.attributes["property"]: m.attributes["content"]
            for m in head.all("meta")
            if "property" in m.attributes
        }
        assert properties["og:title"] == title
        assert properties["og:url"].endswith(address)
        assert properties["og:type"] == "website"
        assert properties["og:description"]
    feeds = [
        a.attributes["href"]
        for a in pages.page(client.get("/board/test/")).all("link", type="application/atom+xml")
    ]
    assert [address.endswith("/board/test/feed.atom") for address in feeds] == [True]
