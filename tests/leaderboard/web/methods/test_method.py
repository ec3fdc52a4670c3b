"""A method's page."""

import html
import re
from pathlib import Path

import pytest
from django.test import Client

from leaderboard.models import Edition, Method, Score, User, Visibility
from tests import builders, pages
from tests.leaderboard.web.boards.test_board import row_of

pytestmark = pytest.mark.slow


@pytest.fixture
def method(edition: Edition, owner: User) -> Method:
    builders.submit(
        owner,
        builders.predictions(edition, factor=1.2),
        description="First line.\n\nSecond <b>line</b>, `tsttc check`.\n\n```\ntsttc score\n```",
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
        "Second <b>line</b>, tsttc check.",
    ]
    assert [code.text for code in main.one("div", class_="description").all("code")] == [
        "tsttc check",
        "tsttc score",
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
    assert f"Rank {row[0]} of 6" in card


def test_each_split_stands_in_its_own_section(
    client: Client, method: Method, owner: User, tmp_path: Path
) -> None:
    demo = builders.import_truth(tmp_path, split="demo", seed=1)
    builders.submit(owner, builders.predictions(demo), split="demo")
    builders.score_all()
    sections = get(client, method).all("section")
    assert [section.one("h2").text.split()[0] for section in sections] == ["Test", "Demo"]
    assert "Simulated data" in sections[1].text
    assert "Simulated" not in sections[0].text


def test_method_without_a_score_leads_to_its_submissions(
    signed_in: Client, edition: Edition, owner: User, tmp_path: Path
) -> None:
    builders.import_truth(tmp_path, split="val", seed=1)
    sent = builders.send(owner, b"{}", split="val", method="Nothing scored").submission
    root = pages.page(signed_in.get(f"/methods/{sent.method_id}/"))
    trail = root.one("p", class_="trail").one("a")
    assert (trail.text, trail.attributes["href"]) == ("My submissions", "/submissions/")
    assert root.one("nav", class_="site-nav").all("a")[0].attributes["href"] == "/board/val/"


def test_private_method_is_marked_for_its_team(
    client: Client, method: Method, owner: User, teammate: User
) -> None:
    Method.objects.update(visibility=Visibility.PRIVATE)
    for member in (owner, teammate):
        client.force_login(member)
        assert "only your team and the maintainers can see this page" in get(client, method).one("main").text


def test_details_are_chips_and_a_row_of_the_board_shows_the_first_of_them(
    client: Client, method: Method
) -> None:
    Method.objects.update(n_frames=2, uses_nerf=False, latency_ms=5.7, hardware="one GPU")
    builders.board_changed("test")
    chips = [chip.text for chip in get(client, method).one("ul", class_="tags").all("li")]
    assert chips == ["2 frames", "no NeRF", "5.7 ms latency", "one GPU"]
    row = row_of(pages.get(client, "/board/test/"), "Foo")
    assert [tag.text for tag in row.all("span", class_="detail")] == ["2 frames"]


def test_head_says_the_score_its_lead_and_the_way_there(client: Client, method: Method) -> None:
    main = get(client, method).one("main")
    best, own = (
        float(row_of(pages.get(client, "/board/test/"), name).all("td", class_="primary")[0].text.split()[0])
        for name in ("Deep Scale", "Foo")
    )
    card = main.one("dl", class_="score-card")
    assert f"Lead over the second {best - own:.1f} ×10⁻⁴ Deep Scale, {best}" in card.text
    assert "2 submissions, in order" in card.text
    assert len(card.all("svg", class_="sparkline")) == 1
    Method.objects.update(visibility=Visibility.ANONYMOUS)
    builders.board_changed("test")
    assert "in order" not in get(client, method).one("main").text, "nobody knows the order within a day"
    strip = main.one("figure", class_="all-values")
    assert strip.one("span", class_="spoken").text == "MiD of all methods: 0 lower, 5 not."
    assert len(strip.one("svg", class_="strip").all("line", class_="own")) == 1


def test_it_gives_a_sentence_to_quote_and_says_how_to_verify_the_number(
    client: Client, method: Method
) -> None:
    main = get(client, method).one("main")
    quoted = main.one("code", id="citation-test").text
    words = r"Foo: MiD [0-9.]+ ×10⁻⁴, rank 1 of 6, TSTTC Test, edition 1, submitted 20\d\d-\d\d-\d\d"
    assert re.fullmatch(words, quoted)
    hrefs = [link.attributes.get("href") for link in main.all("a")]
    assert {"/board/test/editions/1/", "/docs/cli/#verify"} <= {*hrefs}
    Method.objects.update(visibility=Visibility.PRIVATE)
    builders.board_changed("test")
    client.force_login(method.team.members.get())
    assert get(client, method).all("code", id="citation-test") == [], "nobody could look it up"


def test_nearby_ranks_are_those_that_they_would_be_beside_a_private_method(
    client: Client, method: Method, owner: User
) -> None:
    Method.objects.update(visibility=Visibility.PRIVATE)
    builders.board_changed("test")
    client.force_login(owner)
    main = get(client, method).one("main")
    assert "Rank if public 1 of 6" in main.one("dl", class_="score-card").text
    rows = main.one("table", class_="gaps").one("tbody").all("tr")
    ranks = [(row.all("td")[0].text, row.one("th").text) for row in rows]
    assert ranks == [("", "This methodwould be rank 1"), ("2", "Deep Scale"), ("3", "Deep Scale (NeRF)")]
    assert {len(row.all("td")) for row in rows} == {3}, "no columns for a test that nobody can make"
    assert "Ranks as if this method were public. A row quoted from a paper cannot be tested" in main.text


def test_own_anonymous_method_among_nearby_ranks_has_its_name_for_its_team_alone(
    client: Client, method: Method, edition: Edition, owner: User
) -> None:
    builders.submit(owner, builders.predictions(edition, factor=1.06), method="Bar", visibility="ANONYMOUS")
    builders.score_all()
    pseudonym = Method.objects.get(name="Bar").pseudonym
    for reader, name in ((None, pseudonym), (owner, f"Bar yours, shown as {pseudonym}")):
        if reader:
            client.force_login(reader)
        rows = get(client, method).one("table", class_="gaps").one("tbody").all("tr")
        assert [row.one("th").text for row in rows][:2] == ["This method", name]


def test_nearby_differences_have_their_intervals_once_a_worker_has_computed_them(
    client: Client, benchmark: None, tmp_path: Path, owner: User, stranger: User
) -> None:
    edition = builders.import_truth(tmp_path, n=600, n_recordings=50)
    builders.submit(owner, builders.predictions(edition, factor=1.02))
    builders.submit(stranger, builders.predictions(edition, factor=1.04), method="Bar")
    builders.score_all()
    address = f"/methods/{Method.objects.get(name='Foo').pk}/"
    gaps = [pages.get(client, address).one("table", class_="gaps").text]
    builders.infer_all()
    gaps.append(pages.get(client, address).one("table", class_="gaps").text)
    assert ["computing…" in text for text in gaps] == [True, False]
    assert re.search(r"1 This method [0-9.]+ 2 Bar [0-9.]+ −[0-9.]+ −[0-9.]+ to −[0-9.]+", gaps[1])


def test_own_method_offers_the_next_submission_and_lists_the_rejected_ones(
    signed_in: Client, edition: Edition, owner: User
) -> None:
    sent = builders.submit(owner, b"[]", method="Night & day", visibility="PRIVATE")
    builders.score_all()
    main = pages.get(signed_in, f"/methods/{sent.method_id}/").one("main")
    links = {a.text: a for a in main.one("p", class_="actions").all("a")}
    assert list(links) == ["Submit again", "Edit details", "All submissions", "Delete…"], "nothing to publish"
    assert [row.all("td")[3].text for row in main.one("tbody").all("tr")] == [
        "rejected The outermost value is a list"
    ]
    address = html.unescape(links["Submit again"].attributes["href"])
    form = pages.get(signed_in, address).one("form", id="submit")
    assert form.one("input", name="method").attributes["value"] == "Night & day"


def test_a_score_without_an_error_has_a_bound_and_no_interval(
    client: Client, benchmark: None, owner: User, tmp_path: Path
) -> None:
    """[0, 0] would say that no error can occur."""
    edition = builders.import_truth(tmp_path, split="val", protocol="tsttc-2")
    builders.open_values(edition)
    builders.submit(owner, builders.predictions(edition, factor=1.0001), split="val")
    builders.score_all()
    builders.infer_all()
    kept = {(each.metric, each.ttc_range): each for each in Score.objects.all()}
    assert kept["warning", "overall"].value == 0
    assert kept["warning", "overall"].low is None
    assert kept["mid", "overall"].low is not None
    n_sequences = edition.ground_truth.n_sequences
    text = get(client, Method.objects.get()).text
    assert "No interval: " in text
    assert f"WE overall: an error in 0 of {n_sequences:,} sequences (below " in text
    assert builders.infer_all() == 0, "what has no interval is not computed again"
