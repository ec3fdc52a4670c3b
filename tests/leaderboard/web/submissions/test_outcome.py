"""What a submission's page says beyond the numbers: rank, comparison, a row for a paper, its cost."""

import re

import pytest
from django.db import connection
from django.test import Client
from django.test.utils import CaptureQueriesContext
from django.utils import timezone

from leaderboard.models import Edition, Method, PublishedResult, Score, Split, Submission, User
from leaderboard.submissions import intake
from tests import board_rows, builders, pages
from tests.editions import board_now
from tests.leaderboard.statistics.inferred_scores import put_ranges

pytestmark = pytest.mark.slow

PAGE = "/submissions/{}/"


@pytest.fixture
def inferred(entries: list[Submission]) -> list[Submission]:
    builders.infer_all()
    return entries


def look(client: Client, submission: Submission) -> pages.Element:
    return pages.page(client.get(PAGE.format(submission.pk)))


def card(root: pages.Element) -> str:
    return root.one("dl", class_="score-card").text


def beside(root: pages.Element) -> list[list[str]]:
    """The rows that it is compared with: name and what it is, then values and differences."""
    return [
        [row.one("th").text, *(cell.text for cell in row.all("td"))]
        for row in root.one("table", class_="beside").one("tbody").all("tr")
    ]


def mid(submission: Submission) -> float:
    return Score.objects.get(evaluation__submission=submission, metric="mid", ttc_range="overall").value


# --- rank ------------------------------------------------------------------------------------------------


def test_rank_is_the_boards_with_its_range(signed_in: Client, inferred: list[Submission]) -> None:
    [row] = [row for row in board_now().entries if row.submission_id == inferred[1].pk]
    interval = row.intervals["mid"]
    n_ranked = sum(row.rank is not None for row in board_now().entries)
    ends = {interval.rank_low, interval.rank_high}
    within = "–".join(str(end) for end in sorted(end for end in ends if end is not None))
    assert f"Rank {row.rank} of {n_ranked} 95% range ({within})" in card(look(signed_in, inferred[1]))


def test_maintainer_reads_the_same_rank_of_a_private_one_and_nobody_quotes_it(
    keeper: Client, edition: Edition, owner: User
) -> None:
    sent = builders.submit(owner, builders.predictions(edition, factor=1.01), visibility="PRIVATE")
    builders.score_all()
    root = look(keeper, sent)
    assert "Rank if public 1 of" in card(root)
    strip = root.one("figure", class_="all-values").text
    assert "every method on the board (log scale), from" in strip
    assert "the tall mark is this one, which is private" in strip
    assert ", rank" not in root.one("code", id="citation").text
    assert root.one("code", id="latex-row").text.startswith("-- &")


@pytest.mark.parametrize("visibility", ["PUBLIC", "PRIVATE"])
def test_what_another_submission_of_the_method_surpasses_has_no_rank(
    signed_in: Client, edition: Edition, owner: User, visibility: str
) -> None:
    worse, better = (
        builders.submit(owner, builders.predictions(edition, factor=factor), visibility=visibility)
        for factor in (1.2, 1.1)
    )
    builders.score_all()
    root = look(signed_in, worse)
    shows = "would show" if visibility == "PRIVATE" else "shows"
    assert f"Not this method’s best: the board {shows} another submission" in root.one("main").text
    assert "Rank" not in card(root)
    strip = root.one("figure", class_="all-values")
    assert "the tall mark is this submission, which the board does not show" in strip.text
    n_on_board = PublishedResult.objects.filter(split="test").count() + (visibility == "PUBLIC")
    words = strip.one("span", class_="spoken").text
    assert sum(int(n) for n in re.findall(r"\d+", words)) == n_on_board, (
        "the board's one of its method is drawn"
    )
    assert "Columns: rank (none" in root.one("main").text
    assert "Rank" in card(look(signed_in, better))


def test_what_may_be_the_best_is_marked_as_on_the_board(
    signed_in: Client, inferred: list[Submission]
) -> None:
    put_ranges(inferred[1], mid=(1, 9))
    builders.board_changed("test")
    for address in (PAGE.format(inferred[1].pk), f"/methods/{inferred[1].method_id}/"):
        root = pages.page(signed_in.get(address))
        cell = root.one("div", class_="result").all("tr")[1].all("td")[0]
        assert "with-best" in cell.classes
        assert cell.text.endswith(", may be the best of its column (95% confidence)")
        assert "grey: may be the best (95% confidence)" in root.one("main").text


# --- beside others ---------------------------------------------------------------------------------------


def test_it_stands_beside_the_teams_best_other_and_the_nearest_published_row(
    signed_in: Client, inferred: list[Submission]
) -> None:
    printed = [row for row in board_now().entries if row.kind == "published"]
    nearest = min(printed, key=lambda row: abs((row.scores["mid"] or 0) - mid(inferred[1])))
    root = look(signed_in, inferred[1])
    own, published = beside(root)
    assert own[0].startswith("M1.05, your team’s best other submission, 20")
    gap = round(mid(inferred[1]) - mid(inferred[0]), 1)
    assert gap > 0
    assert own[1:3] == [f"{mid(inferred[0]):.1f}", f"+{gap:.1f}"]
    assert published[0].startswith(f"{nearest.method}, nearest row from a paper, Shi et al.")
    assert nearest.scores["mid"] is not None
    gap = round(mid(inferred[1]) - nearest.scores["mid"], 1)
    assert published[2] == (f"+{gap:.1f}" if gap > 0 else f"−{-gap:.1f}")
    assert PAGE.format(inferred[0].pk) in [a.attributes["href"] for a in root.all("a")]


def test_it_stands_beside_the_previous_submission_of_its_method(
    signed_in: Client, edition: Edition, owner: User
) -> None:
    factors = (1.05, 1.2, 1.1)
    first, second, third = (
        builders.submit(owner, builders.predictions(edition, factor=factor)) for factor in factors
    )
    builders.score_all()
    previous, best, _ = beside(look(signed_in, third))
    assert previous[0].startswith("Foo, its previous submission, 20")
    assert previous[1:3] == [f"{mid(second):.1f}", f"−{round(mid(second) - mid(third), 1):.1f}"]
    assert best[1] == f"{mid(first):.1f}"
    beside_second = [row[0] for row in beside(look(signed_in, second))]
    assert ["previous" in words for words in beside_second] == [True, False]
    assert not any("best other" in words for words in beside_second), "that is the previous one"


def test_another_method_of_the_team_is_not_compared_with_where_values_are_hidden(
    signed_in: Client, inferred: list[Submission]
) -> None:
    hrefs = [a.attributes["href"] for a in look(signed_in, inferred[1]).all("a")]
    assert not [href for href in hrefs if href.startswith("/compare/")]


@pytest.mark.usefixtures("open_values")
def test_another_method_of_the_team_can_be_compared_with(
    signed_in: Client, inferred: list[Submission]
) -> None:
    [link] = [
        a.attributes["href"]
        for a in look(signed_in, inferred[1]).all("a")
        if a.attributes["href"].startswith("/compare/")
    ]
    assert signed_in.get(link.replace("&amp;", "&")).status_code == 200


def test_nothing_of_another_team_and_nothing_withdrawn_is_beside_it(
    signed_in: Client, edition: Edition, owner: User, stranger: User
) -> None:
    sent = builders.submit(owner, builders.predictions(edition, factor=1.2))
    builders.submit(stranger, builders.predictions(edition, factor=1.01), method="Foreign")
    gone = builders.submit(owner, builders.predictions(edition, factor=1.05), method="Gone")
    builders.score_all()
    intake.withdraw(submission=gone, actor=owner, now=timezone.now())
    rows = beside(look(signed_in, sent))
    assert len(rows) == 1
    assert "nearest row from a paper" in rows[0][0]


# --- for a paper -----------------------------------------------------------------------------------------


def test_latex_row_is_that_of_the_boards_table(signed_in: Client, inferred: list[Submission]) -> None:
    row = look(signed_in, inferred[1]).one("code", id="latex-row").raw_text
    board = signed_in.get("/board/test.tex").content.decode()
    assert row in board.splitlines()
    assert " & M1.1 & Owls & " in row


def test_latex_row_of_an_anonymous_method_names_neither_it_nor_its_team(
    signed_in: Client, edition: Edition, owner: User
) -> None:
    sent = builders.submit(owner, builders.predictions(edition), method="Secret Net", visibility="ANONYMOUS")
    builders.score_all()
    row = look(signed_in, sent).one("code", id="latex-row").raw_text
    assert f" & {sent.method.pseudonym} & Anonymous & " in row
    assert "Secret" not in row
    assert sent.method.team.name not in row


def test_score_is_quoted_in_one_line_and_no_interval_breaks(
    signed_in: Client, inferred: list[Submission]
) -> None:
    root = look(signed_in, inferred[1])
    quoted = root.one("code", id="citation").text
    score = r"M1\.1: MiD [0-9.]+ ×10⁻⁴ \(95% CI \[[0-9.]+, [0-9.]+\]\)"
    board = r"TSTTC Test, edition 1, submitted 20\d\d-\d\d-\d\d"
    assert re.fullmatch(rf"{score}, rank \d( \(\d–\d\))? of \d+, {board}", quoted)
    cells = root.one("div", class_="result").all("td", class_="span")
    assert all(
        re.fullmatch(r"[0-9.]+–[0-9.]+", cell.all("span")[0].text) for cell in cells if cell.text != "–"
    )
    assert len(root.one("figure", class_="all-values").all("svg")) == 2


# --- what a rejected file costs --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("limit", "left"), [(20, ". 19 more rejected files are allowed in the next 24 hours."), (None, ".")]
)
def test_rejected_file_uses_no_quota_and_page_says_how_many_more_are_taken(
    signed_in: Client, edition: Edition, owner: User, limit: int | None, left: str
) -> None:
    Split.objects.filter(pk="test").update(quota_rejected_limit=limit)
    sent = builders.submit(owner, b"[]")
    builders.score_all()
    assert (
        f"This file was not scored and did not count against your quota{left} Correct"
        in look(signed_in, sent).one("main").text
    )


# --- cost ------------------------------------------------------------------------------------------------


def n_queries(client: Client, address: str, **query: str) -> int:
    with CaptureQueriesContext(connection) as queries:
        client.get(address, query)
    return len(queries)


def test_number_of_queries_does_not_grow_with_the_board_or_the_team(
    signed_in: Client, inferred: list[Submission], edition: Edition, owner: User, stranger: User
) -> None:
    address = PAGE.format(inferred[1].pk)
    methods = list(Method.objects.filter(team=inferred[0].method.team))
    board_rows.score(edition, methods=methods, user=owner)  # earlier ones, to compare with
    builders.board_changed("test")
    look(signed_in, inferred[1])
    before = n_queries(signed_in, address)
    assert before <= 13
    board_rows.fill(edition, n=30, user=stranger)
    board_rows.score(edition, methods=methods, user=owner, seed=1)
    builders.board_changed("test")
    look(signed_in, inferred[1])
    assert n_queries(signed_in, address) == before
