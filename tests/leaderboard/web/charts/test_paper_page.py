"""The page of the tables of the paper: every value, charts of sweeps, downloads, the rows of the boards."""

import json

import pytest
from django.test import Client

from evaluator.metrics.protocol import SCORE_NAMES
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


SWEEPS = {shown.table.name: shown for shown in printed_tables() if sweep(shown)}


@pytest.mark.parametrize("name", SWEEPS)
def test_sweep_has_a_line_and_marks_of_each_column_at_its_settings(name: str) -> None:
    shown, chart = SWEEPS[name], sweep(SWEEPS[name])
    table, base = shown.table, chart.options["baseOption"]
    rows = [row for row in table.rows if isinstance(row.setting, int | float) and row.setting is not True]
    settings = sorted({float(row.setting) for row in rows})
    room = (settings[-1] - settings[0]) / 25
    for axis in base["xAxis"]:
        assert (axis["min"], axis["max"]) == pytest.approx((settings[0] - room, settings[-1] + room))
        assert axis["axisLabel"]["formatter"]["of"] == [[each, f"{each:,g}"] for each in settings]
        assert axis["name"] == shown.headings[shown.n_names - 1]
    scores = [column for column in table.columns if column in SCORE_NAMES]
    of_method = {row.method: [each for each in rows if each.method == row.method] for row in rows}
    expected = {
        (
            ["mid", "rte"].index(column.partition("_")[0]),
            tuple((float(row.setting), row.values[table.columns.index(column)]) for row in some),
        )
        for some in of_method.values()
        for column in scores
    }
    lines, marks = ([each for each in base["series"] if each["type"] == kind] for kind in ("line", "scatter"))
    assert {(each["yAxisIndex"], tuple(map(tuple, each["data"]))) for each in lines} == expected
    assert {
        (each["xAxisIndex"], tuple(tuple(mark["value"]) for mark in each["data"])) for each in marks
    } == expected
    # One colour and shape for each name, in all panels.
    looks = {(each["name"], each["itemStyle"]["color"], each["symbol"]) for each in marks}
    assert len(looks) == len({name for name, *_ in looks}) == len({(ink, shape) for _, ink, shape in looks})
    assert {(each["name"], each["lineStyle"]["color"]) for each in lines} == {look[:2] for look in looks}
    keys = {each["name"]: each["icon"] for each in chart.options["media"][0]["option"]["legend"]["data"]}
    assert keys == {name: shape for name, _, shape in looks}
    for each in marks:
        for mark in each["data"]:
            is_default = any(row.is_default for row in rows if row.setting == mark["value"][0])
            assert ("the paper's default" in mark["read"]) is is_default
            assert (mark.get("itemStyle", {}).get("color") == "--ground") is is_default
            assert f" {mark['value'][1]:.1f}" in mark["read"][0]
    assert chart.label.startswith("MiD and RTE for " if len(base["yAxis"]) == 2 else "MiD for ")
    assert f" for {len(settings)} settings: {shown.title}." in chart.label
    assert len(chart.rows) == len(shown.rows)


def test_lowest_values_are_explained_where_they_are_marked_and_there_alone(client: Client) -> None:
    drawn = client.get("/published/").context["tables"]
    marked = [
        any(cell.is_best for rows in each["row_groups"] for _, row in rows for cell in row) for each in drawn
    ]
    assert [each["has_best"] for each in drawn] == marked
    assert {True, False} == set(marked)
