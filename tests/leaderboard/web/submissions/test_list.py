"""The list of one's own submissions: what is in it, search, filters, pages, and links both ways."""

import html

import pytest
from django.test import Client
from pytest_django import DjangoAssertNumQueries

from leaderboard.models import Edition, User
from tests import builders, pages

pytestmark = pytest.mark.slow


def test_list_has_my_teams_submissions_with_state_and_errors(
    signed_in: Client, edition: Edition, owner: User, teammate: User, stranger: User
) -> None:
    scored = builders.submit(owner, builders.predictions(edition), method="Scored one")
    builders.submit(teammate, b"[]", method="Bad one")
    builders.submit(stranger, builders.predictions(edition), method="Foreign one")
    builders.score_all()
    builders.submit(owner, builders.predictions(edition, factor=1.3), method="Waiting one")
    rows = [
        [cell.text for cell in row.all("td")]
        for row in pages.page(signed_in.get("/submissions/")).one("tbody").all("tr")
    ]
    assert [row[1].removesuffix(" predictions.json") for row in rows] == [
        "Waiting one",
        "Bad one",
        "Scored one",
    ]
    assert [row[3] for row in rows] == [
        "queued",
        "rejected The outermost value is a list",
        "scored Best of its method: compare with others: Scored one",
    ]
    mid = scored.evaluations.get().scores.get(metric="mid", ttc_range="overall").value
    assert [row[4] for row in rows] == ["–", "–", f"{mid:.1f}"]


def test_empty_list_says_what_to_do(signed_in: Client, benchmark: None) -> None:
    main = pages.page(signed_in.get("/submissions/")).one("main")
    assert "You have no submissions yet" in main.text
    assert "/submit/" in [a.attributes["href"] for a in main.all("a")]


def test_number_of_queries_does_not_grow_with_the_list(
    signed_in: Client, edition: Edition, owner: User, django_assert_max_num_queries: DjangoAssertNumQueries
) -> None:
    for i in range(5):
        builders.submit(owner, builders.predictions(edition, factor=1.1 + i / 10))
    builders.score_all()
    signed_in.get("/submissions/")  # The first reader after a change reads the board.
    with django_assert_max_num_queries(10):
        signed_in.get("/submissions/")


@pytest.mark.parametrize(
    ("asked", "expected"),
    [
        ({"q": "NIGHT"}, ["Second try"]),
        ({"q": "v2.json"}, ["First try"]),
        ({"state": "REJECTED"}, ["Broken"]),
        ({"split": "val"}, []),
        ({"q": "try", "state": "SCORED", "split": "test"}, ["Second try", "First try"]),
        ({"state": "nonsense"}, ["Broken", "Second try", "First try"]),
        ({"method": "nonsense"}, ["Broken", "Second try", "First try"]),
    ],
)
def test_list_is_searched_and_filtered(
    signed_in: Client, edition: Edition, owner: User, asked: dict[str, str], expected: list[str]
) -> None:
    good = [builders.predictions(edition, factor=factor) for factor in (1.1, 1.2)]
    builders.submit(owner, good[0], method="First try", filename="v2.json")
    builders.submit(owner, good[1], method="Second try", note="one night more")
    builders.submit(owner, b"[]", method="Broken")
    builders.score_all()
    main = pages.page(signed_in.get("/submissions/", asked)).one("main")
    named = [row.all("td")[1].one("a").text for body in main.all("tbody") for row in body.all("tr")]
    assert named == expected
    if not expected:
        assert "No submission matches." in main.text


def test_list_and_method_lead_to_each_other(signed_in: Client, edition: Edition, owner: User) -> None:
    sent = builders.submit(owner, builders.predictions(edition), method="Linked")
    builders.submit(owner, builders.predictions(edition, factor=1.4), method="Other")
    builders.score_all()
    links = [a.attributes["href"] for a in pages.page(signed_in.get(f"/methods/{sent.method_id}/")).all("a")]
    assert f"/submissions/{sent.pk}/" in links
    assert f"/submissions/?method={sent.method_id}" in links
    [row] = pages.page(signed_in.get(f"/submissions/?method={sent.method_id}")).one("tbody").all("tr")
    assert f"/methods/{sent.method_id}/" in [a.attributes["href"] for a in row.all("a")]
    visitor = pages.page(Client().get(f"/methods/{sent.method_id}/"))
    assert not [a for a in visitor.all("a") if a.attributes["href"].startswith("/submissions/")]


def test_long_lists_come_in_pages(
    signed_in: Client, edition: Edition, owner: User, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("leaderboard.web.submissions.submission_views.PER_PAGE", 2)
    for i in range(3):
        builders.submit(owner, builders.predictions(edition, factor=1.1 + i / 10))
    root = pages.page(signed_in.get("/submissions/"))
    assert len(root.one("tbody").all("tr")) == 2
    assert root.one("nav", class_="pages").one("a").attributes["href"] == "?page=2"
    assert len(pages.page(signed_in.get("/submissions/?page=2")).one("tbody").all("tr")) == 1
    assert signed_in.get("/submissions/?page=nonsense").status_code == 200


def test_best_of_the_team_stands_on_top_and_rows_of_the_board_can_be_compared(
    signed_in: Client, edition: Edition, owner: User, stranger: User
) -> None:
    theirs = builders.submit(stranger, builders.predictions(edition, factor=1.01), method="Foreign one")
    best = builders.submit(
        owner, builders.predictions(edition, factor=1.05), method="Mine", visibility="PRIVATE"
    )
    worse = builders.submit(
        owner, builders.predictions(edition, factor=1.2), method="Mine", visibility="PRIVATE"
    )
    builders.score_all()
    main = pages.page(signed_in.get("/submissions/")).one("main")
    line = main.one("div", class_="intro")
    (value,) = best.evaluations.get().scores.filter(metric="mid", ttc_range="overall").values_list("value")
    assert line.text.startswith(f"Best on Test: Mine, MiD {value[0]:.1f} ×10⁻⁴, would be rank 2 of 7, ")
    assert line.text.endswith(" behind the best (Foreign one: compare)")
    compare = f"/compare/?split=test&m={best.method_id}&m={theirs.method_id}"
    assert [html.unescape(a.attributes["href"]) for a in line.all("a")] == [
        "/board/test/",
        f"/submissions/{best.pk}/",
        compare,
    ]
    assert signed_in.get(compare).status_code == 200
    links = {
        row.all("a")[0].attributes["href"]: [
            a.attributes["href"] for a in row.all("a") if "compare" in a.text
        ]
        for row in main.one("tbody").all("tr")
    }
    assert links[f"/submissions/{worse.pk}/"] == [], "the board shows another submission of the method"
    (choice,) = links[f"/submissions/{best.pk}/"]
    chosen = pages.get(signed_in, html.unescape(choice)).one("form", id="compare-form")
    assert [box.attributes["value"] for box in chosen.all("input") if "checked" in box.attributes] == [
        str(best.method_id)
    ]
