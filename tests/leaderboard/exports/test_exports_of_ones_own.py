"""Exports end up in papers: they hold what everybody sees, and one's own rows for who asks, marked."""

import csv
import io
import re

import pytest
from django.test import Client

from leaderboard.models import Edition, Method, User, Visibility
from leaderboard.people import teams
from tests import board_rows, builders, pages
from tests.leaderboard.exports.test_exports import text_of

SUFFIXES = ("csv", "tex", "md", "bib")
PAPER = "https://example.org/papers/own"


@pytest.fixture
def own(edition: Edition, owner: User) -> list[Method]:
    """Of the owner's team a private, an anonymous and a public method; of another's an anonymous one."""
    private, masked, public, others = board_rows.fill(edition, n=4, user=owner)
    team = teams.team_of(user=owner)
    for method, name, visibility in (
        (private, "Secretissimo", Visibility.PRIVATE),
        (masked, "Maskenball", Visibility.ANONYMOUS),
        (public, "Offenbach", Visibility.PUBLIC),
    ):
        Method.objects.filter(pk=method.pk).update(
            team=team, name=name, visibility=visibility, paper_url=PAPER
        )
    Method.objects.filter(pk=others.pk).update(visibility=Visibility.ANONYMOUS, name="Theirs")
    builders.board_changed("test")
    return [private, masked, public, others]


@pytest.mark.slow
@pytest.mark.parametrize("query", ["", "?intervals=1", "?q=e&sort=-mid", "?mine=0"])
@pytest.mark.parametrize("form", SUFFIXES)
def test_an_export_of_a_board_has_what_everybody_sees(
    own: list[Method], owner: User, teammate: User, stranger: User, client: Client, form: str, query: str
) -> None:
    for path in ("/board/test", "/board/test/editions/1"):
        everybodys = Client().get(f"{path}.{form}{query}").content
        for user in (owner, teammate, stranger):
            client.force_login(user)
            answer = client.get(f"{path}.{form}{query}")
            assert answer.content == everybodys
            assert answer["Cache-Control"] == "private, no-store"
    for secret in (b"Secretissimo", b"Maskenball", b"private)", b"anonymous)"):
        assert secret not in everybodys
    assert query or (own[1].pseudonym.encode() in everybodys) == (form != "bib")


@pytest.mark.parametrize("form", ["tex", "md", "bib"])
def test_one_s_own_rows_come_marked_for_who_asks(
    own: list[Method], owner: User, client: Client, form: str
) -> None:
    client.force_login(owner)
    text = text_of(client, form, "?mine=1").replace("\\", "")
    marked = {
        "tex": r"{} \({}\) &",
        "md": r"{} \({}\) \|",
        "bib": r"title = {{{{{}}}}}[^@]*leaderboard \({}\)",
    }
    for name, mark in (("Secretissimo", "private"), ("Maskenball", "anonymous")):
        assert re.search(marked[form].format(name, mark), text), text
        assert len(re.findall(name, text)) == 1
    assert re.search(r"Offenbach (&|\|)", text) or form == "bib"
    assert own[1].pseudonym not in text
    assert "Theirs" not in text
    assert (own[3].pseudonym in text) == (form != "bib")
    assert ("Not public: only one team" in text) == (form != "bib")


def test_the_spreadsheet_says_who_sees_each_row(own: list[Method], owner: User, client: Client) -> None:
    def seen(query: str) -> dict[str, str]:
        rows = csv.DictReader(io.StringIO(text_of(client, "csv", query)))
        return {row["method"]: row["visibility"] for row in rows if row["kind"] == "submission"}

    client.force_login(owner)
    others = {"Offenbach": "PUBLIC", own[3].pseudonym: "ANONYMOUS"}
    assert seen("") == {own[1].pseudonym: "ANONYMOUS", **others}
    assert seen("?mine=1") == {"Secretissimo": "PRIVATE", "Maskenball": "ANONYMOUS", **others}


@pytest.mark.parametrize("form", SUFFIXES)
def test_nobody_s_own_rows_are_a_clear_refusal(own: list[Method], form: str, client: Client) -> None:
    answer = client.get(f"/board/test.{form}?mine=1")
    assert answer.status_code == 400
    assert "you are not signed in" in pages.page(answer).one("main").text
    assert client.get(f"/board/test.{form}?mine=1", headers={"Authorization": "Bearer x"}).status_code == 400
    assert client.get(f"/board/test.{form}?mine=perhaps").status_code == 400


def links(client: Client, address: str = "/board/test/") -> dict[str, list[str]]:
    """The addresses of a page's exports: for everyone, and with one's own rows."""
    menu = pages.page(client.get(address)).one("details", class_="exports")
    divs = {name: menu.all("div", class_=name) for name in ("public", "with-own")}
    return {name: [a.attributes["href"] for a in parts[0].all("a")] for name, parts in divs.items() if parts}


@pytest.mark.slow
def test_the_page_offers_every_form_with_and_without_intervals(own: list[Method], client: Client) -> None:
    (offered,) = links(client, "/board/test/?sort=rte").values()
    forms = [f"/board/test.{form}?sort=rte" for form in ("csv", "json", "tex", "md", "bib")]
    sure = [f"{address}&intervals=1" for address in forms[:-1]]
    assert offered == [*forms, *sure]
    for address in offered:
        assert client.get(address, follow=True).status_code == 200
    assert r"\scriptsize" in client.get(sure[2]).text


@pytest.mark.slow
def test_the_page_offers_one_s_own_rows_to_who_has_some(
    own: list[Method], owner: User, stranger: User, client: Client
) -> None:
    client.force_login(stranger)
    assert links(client).keys() == {"public"}
    client.force_login(owner)
    offered = links(client)
    assert offered.keys() == {"public", "with-own"}
    everybodys, with_own = offered.values()
    # The API's document is that of whoever asks, with their own rows, unless it is asked for without.
    assert [address for address in everybodys if "mine" in address or ".json" in address] == [
        "/board/test.json?mine=0",
        "/board/test.json?intervals=1&mine=0",
    ]
    everybodys_document = Client().get("/api/v1/splits/test/board").json()
    assert client.get("/board/test.json?mine=0", follow=True).json() == everybodys_document
    assert (
        client.get("/api/v1/splits/test/editions/1/board?mine=no").json()["entries"]
        == everybodys_document["entries"]
    )
    assert client.get("/board/test.json?mine=perhaps", follow=True).status_code == 400
    assert with_own[:5] == [f"/board/test.{form}?mine=1" for form in ("csv", "json", "tex", "md", "bib")]
    document = client.get(with_own[1], follow=True).json()
    shown_as = {row["method"]: (row["visibility"], row["pseudonym"]) for row in document["entries"]}
    assert shown_as["Secretissimo"] == ("PRIVATE", None)
    assert shown_as["Maskenball"] == ("ANONYMOUS", own[1].pseudonym)
    assert shown_as[own[3].pseudonym] == ("ANONYMOUS", None)
    # Where no such row fits the filter there is nothing to add.
    assert links(client, "/board/test/?q=Offenbach").keys() == {"public"}
