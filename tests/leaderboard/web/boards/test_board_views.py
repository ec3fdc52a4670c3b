"""Confidence intervals, rank ranges and marks of a board, and the ways to look at it: columns, filters."""

import re
from pathlib import Path

import pytest
from django.http import HttpResponseBase
from django.test import Client

from evaluator import SCORE_NAMES
from leaderboard.models import Method, Submission, User, Visibility
from tests import builders, pages
from tests.leaderboard.web.boards.test_board import MID, row_of
from tests.pages import get

pytestmark = pytest.mark.slow


@pytest.fixture
def inferred(benchmark: None, tmp_path: Path, owner: User) -> list[Submission]:
    """Two scored submissions with their intervals, in every column."""
    edition = builders.import_truth(tmp_path, n=600, n_recordings=50)
    entries = [
        builders.submit(owner, builders.predictions(edition, factor=factor), method=f"M{factor}")
        for factor in (1.05, 1.06)
    ]
    builders.score_all()
    Method.objects.filter(pk=entries[0].method_id).update(
        uses_nerf=False, n_frames=2, latency_ms=12.0, hardware="one GPU", code_url="https://example.org/code"
    )
    builders.infer_all()
    builders.board_changed("test")
    return entries


def test_values_have_intervals_ranks_have_ranges_and_what_is_with_the_best_is_marked(
    client: Client, inferred: list[Submission]
) -> None:
    root = get(client)
    row = row_of(root, inferred[0].method.name)
    (cell,) = row.all("td", class_="interval")
    low, high = (float(end) for end in cell.one("span", class_="spoken").text.split(" to "))
    assert low < float(row.all("td", class_="primary")[0].text.split()[0]) < high
    assert cell.one("svg").attributes["aria-hidden"] == "true"
    assert cell.attributes["title"] == f"95% confidence interval: {low:.1f} to {high:.1f}"
    assert all("title" in each.attributes for each in row.all("td", class_="wide"))
    for cell in root.one("table", class_="board").all("td", class_="with-best"):
        assert ", may be the best of its column (95% confidence)" in cell.text
    legend = root.one("details", class_="legend").text
    assert re.search(r"the bar its 95% confidence interval \(bootstrap over [\d,]+ recordings\)", legend)
    assert "Rings are values quoted from papers. They have no confidence interval" in legend
    assert "rows quoted from papers never have a range" in legend
    published = row_of(root, "Deep Scale")
    assert "papers do not report" in published.one("td", class_="interval").attributes["title"]
    assert published.one("td", class_="interval").text == "no confidence interval"


def test_marked_are_exactly_the_values_whose_rank_range_begins_at_1(
    client: Client, inferred: list[Submission]
) -> None:
    root = get(client)
    answer = client.get("/api/v1/splits/test/board?intervals=1").json()
    for entry in answer["entries"]:
        low = [entry["intervals"].get(name, {}).get("rank_low") for name in SCORE_NAMES]
        cells = row_of(root, entry["method"]).all("td")
        values = [cell for cell in cells if not {"interval", "choose", "rank"} & set(cell.classes)]
        assert ["with-best" in cell.classes for cell in values] == [rank == 1 for rank in low]
        assert [each["is_with_best"] for each in entry["intervals"].values()] == [
            each["rank_low"] == 1 for each in entry["intervals"].values()
        ]


def test_a_rank_range_is_printed_where_it_is_more_than_the_rank(
    client: Client, inferred: list[Submission]
) -> None:
    root = get(client)
    printed = []
    for entry in client.get("/api/v1/splits/test/board?intervals=1").json()["entries"]:
        interval = entry["intervals"].get("mid", {})
        ends = (interval.get("rank_low"), interval.get("rank_high"))
        is_wide = None not in ends and ends != (entry["rank"], entry["rank"])
        texts = [each.text for each in row_of(root, entry["method"]).all("span", class_="range")]
        assert len(texts) == is_wide
        printed += texts
    assert all(re.search(r"\(\d+(–\d+)?\)$", text) for text in printed)


def test_one_error_alone_has_a_whisker_in_every_column(client: Client, inferred: list[Submission]) -> None:
    root = get(client, "/board/test/?columns=rte&sort=-rte")
    assert len(row_of(root, inferred[0].method.name).all("svg", class_="whisker")) == 5
    assert [len(row) for row in pages.board_rows(root)] == [MID + 5] * len(pages.board_rows(root))
    assert [a.text for a in root.one("nav", class_="columns").all("a") if "aria-current" in a.attributes] == [
        "RTE"
    ]
    heads = root.one("table", class_="board").one("thead")
    hrefs = {a.attributes["href"] for a in heads.all("a")}
    assert all("columns=rte" in href for href in hrefs)
    assert len({axis.text for axis in heads.all("svg", class_="axis")}) == 1, "one scale for all"


def test_heads_name_an_interval_only_where_one_is_drawn(client: Client, inferred: list[Submission]) -> None:
    both, one = (get(client, f"/board/test/{query}") for query in ("", f"?q={inferred[0].method.name}"))
    assert "95% CI" in both.one("table", class_="board").one("thead").text
    assert "95% CI" not in one.one("table", class_="board").one("thead").text


def test_filters_and_search_show_what_fits_and_keep_the_ranks(
    client: Client, inferred: list[Submission]
) -> None:
    name = inferred[0].method.name
    everything = {row[1]: row[0] for row in pages.board_rows(get(client))}
    for query, expected in (
        ("frames=2", {name}),
        ("latency=12&q=m1", {name}),
        ("frames=2&code=yes&latency=12.5", {name}),
        (f"q={name.upper()}", {name}),
        ("q=shi", {row for row in everything if "published" in row}),
    ):
        root = get(client, f"/board/test/?{query}")
        matches = pages.board_rows(root)
        assert len(matches) == len(expected), query
        assert all(everything[row[1]] == row[0] for row in matches)
        text = root.one("main").text
        assert f"{len(matches)} of {len(everything)} results" in text
        assert f"Bold: best of all {len(everything)}, underlined" in text
        assert "All methods with intervals, also those that the filter hides." in text
    assert "filter hides" not in get(client).one("main").text


def test_chips_say_what_is_filtered_and_the_panel_opens_for_a_fault_alone(
    client: Client, inferred: list[Submission]
) -> None:
    def panel(response: HttpResponseBase) -> pages.Element:
        return pages.page(response).one("details", class_="filters-of-board")

    filtered = client.get("/board/test/?frames=2")
    assert "open" not in panel(filtered).attributes
    assert [chip.text for chip in pages.page(filtered).all("a", class_="chip")] == ["Frames used: 2"]
    assert "Not applied" not in pages.page(filtered).one("p", class_="found").text
    wrong = client.get("/board/test/?frames=9")
    assert "open" in panel(wrong).attributes
    assert "Not applied: Frames used" in pages.page(wrong).one("p", class_="found").text


def test_filters_that_nothing_fits_leave_a_sentence_and_a_way_back(
    client: Client, inferred: list[Submission]
) -> None:
    root = get(client, "/board/test/?q=nothing+like+it&sort=rte")
    assert root.all("table", class_="board") == []
    assert f"0 of {2 + 5} results" in root.one("main").text
    (back,) = [a for a in root.all("a") if a.text == f"Show all {2 + 5} results"]
    assert back.attributes["href"] == "?sort=rte"
    assert root.all("nav", class_="columns") + root.all("details", class_="exports") == [], "nothing to show"


@pytest.mark.parametrize(
    ("query", "sentence"),
    [
        ("columns=all", "This address asks for unknown columns, “all”. The board shows all columns."),
        ("page=0", "The board has no page '0'; expected a number from 1 on."),
        ("page=٣", "expected a number from 1 on"),
        ("sort=<script>", "This board has no “<script>” column, so it is sorted by rank."),
        ("at=2026-13-40", "is not a date or a time"),
        ("frames=9", "The filter 'frames' is '9'; expected one of 2, 3, 4, 5, 6."),
    ],
)
def test_malformed_views_are_a_clear_400(client: Client, benchmark: None, query: str, sentence: str) -> None:
    response = client.get(f"/board/test/?{query}")
    assert response.status_code == 400
    assert sentence in pages.page(response).one("main").text


def test_long_boards_come_in_pages(
    client: Client, inferred: list[Submission], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("leaderboard.web.boards.tables.PER_PAGE", 3)
    seen: list[str] = []
    address = "/board/test/?sort=mid"
    for _ in range(3):
        root = get(client, address)
        seen += [row[1] for row in pages.board_rows(root)]
        following = [a for a in root.one("nav", class_="pages").all("a") if a.text == "Next"]
        address = f"/board/test/{following[0].attributes['href']}" if following else ""
    assert address == ""
    assert len(seen) == len(set(seen)) == 7


def test_rows_to_compare_are_ticked_in_a_form_that_needs_no_script(
    client: Client, inferred: list[Submission]
) -> None:
    form = get(client).one("form", class_="board-form")
    assert form.attributes["action"] == "/compare/"
    boxes = form.all("input", type="checkbox")
    assert {box.attributes["value"] for box in boxes} == {str(entry.method_id) for entry in inferred}
    assert all(box.attributes["aria-label"].startswith("Compare ") for box in boxes)
    assert get(client, "/board/test/?at=2030-01-01").all("form", class_="board-form") != []
    Method.objects.exclude(pk=inferred[0].method_id).update(visibility=Visibility.PRIVATE)
    builders.board_changed("test")
    assert get(client).all("form", class_="board-form") == []
