"""The page of the tables of the paper: every value, charts of sweeps, downloads, the rows of the boards."""

import json

import pytest
from django.test import Client

from evaluator.papers.tables import published_tables
from evaluator.tables.published import printed_tables
from leaderboard.models import PublishedResult
from leaderboard.web.charts.paper_charts import sweep
from tests.leaderboard.web.test_every_page import assert_sound

pytestmark = pytest.mark.usefixtures("benchmark")


@pytest.mark.slow
def test_the_page_has_every_value_and_marks_the_defaults(client: Client) -> None:
    answer = client.get("/published/")
    root = assert_sound(answer)
    tables = root.all("table")
    assert len(tables) == 12
    ordered = sorted(
        printed_tables(),
        key=lambda each: (not each.table.is_result, each.table.parameter is not None, not sweep(each)),
    )
    for shown, drawn in zip(ordered, tables, strict=True):
        texts = [
            [cell.text.removesuffix(" (default)") for cell in row.all("th") + row.all("td")]
            for row in drawn.all("tr")
        ]
        assert texts == [
            [heading or "Name" for heading in shown.headings],
            *(list(row.cells) for row in shown.rows),
        ]
    best = [[cell.text for cell in row.all("strong")] for row in tables[0].all("tr")[1:]]
    assert [row[:2] for row in best if row] == [
        ["13.5"],
        ["14.3", "26.5"],
        ["14.8", "27.6"],
        ["15.6", "11.5"],
    ]
    assert answer.text.count("(default)</span>") == sum(
        row.is_default for table in published_tables().tables for row in table.rows
    )
    assert "15.5 is probably right" in answer.text


def test_sweeps_have_a_chart_with_every_number_of_their_table() -> None:
    charts = {shown.table.name: sweep(shown) for shown in printed_tables()}
    assert [name.removeprefix("ablation-") for name, chart in charts.items() if chart] == [
        *("scale-bins-pixel-mse", "scale-bins-deep-scale", "frame-gap"),
        *("nerf-sequences", "target-size", "kernel-size"),
    ]
    gap = charts["ablation-frame-gap"].options["baseOption"]["series"]
    drawn = [mark["value"][1] for each in gap if each["type"] == "scatter" for mark in each["data"]]
    rows = published_tables().table("ablation-frame-gap").rows
    assert sorted(drawn) == sorted(value for row in rows for value in row.values)
    lines = [mark["read"] for each in gap if each["type"] == "scatter" for mark in each["data"]]
    assert ["MiD 41.0", "the paper's default"] in lines
    assert "Axes" not in charts["ablation-frame-gap"].note, "its axes are logarithmic"
    assert charts["ablation-kernel-size"].note.endswith("Axes do not start at 0.")
    for axis in charts["ablation-kernel-size"].options["baseOption"]["yAxis"]:
        assert axis["max"] < 2 * axis["min"], "from near the values: from 0 the lines are level"


def test_tables_are_downloaded_and_the_api_has_their_numbers(client: Client) -> None:
    for suffix, start in (("csv", '"split","method"'), ("tex", "% Frame gap."), ("md", "| Method |")):
        answer = client.get(f"/published/ablation-frame-gap.{suffix}")
        assert answer.text.startswith(start)
        assert answer["Content-Disposition"].endswith(f'"tsttc-paper-ablation-frame-gap.{suffix}"')
    for address in ("/published/nowhere.csv", "/published/ablation-frame-gap.bib"):
        assert client.get(address).status_code == 404
    document = json.loads(client.get("/api/v1/published/ablation-frame-gap").content)
    assert document["rows"][4]["values"] == [41.0, 29.9]
    assert document["rows"][4]["is_default"]
    assert len(json.loads(client.get("/api/v1/published").content)) == 12


def test_the_rows_of_the_boards_are_those_of_the_main_table() -> None:
    table = published_tables().table("main-results")
    shown = {
        (row.split_id, row.slug): [row.scores[name] for name in table.columns]
        for row in PublishedResult.objects.all()
    }
    assert shown == {(row.split, row.method): list(row.values) for row in table.rows}
