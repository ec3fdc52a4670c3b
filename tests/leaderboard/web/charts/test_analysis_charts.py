"""Charts of an error analysis, without a page."""

from collections.abc import Mapping
from typing import Any

import pytest

from evaluator.metrics.registry import MID, RTE
from leaderboard.boards.rows import Entry
from leaderboard.web.charts import analysis_charts
from leaderboard.web.charts.chart_options import Chart

Row = Mapping[str, Any]


def series_of(chart: Chart, kind: str) -> list[dict[str, Any]]:
    series: list[dict[str, Any]] = chart.options["baseOption"]["series"]
    return [each for each in series if each["type"] == kind]


def data(chart: Chart, kind: str) -> list[tuple[str, int, list[Any]]]:
    return [
        (
            each["name"],
            each["yAxisIndex"],
            [getattr(item, "get", lambda _, i=item: i)("value") for item in each["data"]],
        )
        for each in series_of(chart, kind)
    ]


# --- errors by time to contact ----------------------------------------------------------------------------


def row(
    low: float, high: float, mid: float, rte: float, *, mid_ends: tuple[float, float] | None = None
) -> Row:
    intervals = {"mid": mid_ends} if mid_ends else {}
    return {"low_s": low, "high_s": high, "n": 1200, "mid": mid, "rte": rte, "intervals": intervals}


BINS = [row(-4, -2, 9.0, 50.0), row(0, 2, 8.0, 40.0, mid_ends=(7.0, 9.5)), row(2, 5, 7.0, 30.0)]
OTHER = Entry(kind="published", slug="o", method="Other", team="T", scores={"mid": 1.0})


def test_curve_has_the_middle_of_each_range_and_no_line_over_a_gap() -> None:
    chart = analysis_charts.curve(BINS, [MID, RTE])
    assert data(chart, "line") == [
        ("Mean error", 0, [[-3.0, 9.0]]), ("Mean error", 0, [[1.0, 8.0], [3.5, 7.0]]),
        ("Mean error", 1, [[-3.0, 50.0]]), ("Mean error", 1, [[1.0, 40.0], [3.5, 30.0]]),
    ]  # fmt: skip
    assert [points for _, _, points in data(chart, "scatter")] == [
        points for _, _, points in data(chart, "line")
    ]
    bands = [points for name, panel, points in data(chart, "custom") if points and panel == 0]
    assert bands == [[[1.0, 7.0, 9.5]]]
    assert [points for _, panel, points in data(chart, "custom") if panel == 1] == [[], []]
    reads = [[mark["name"], *mark["read"]] for mark in series_of(chart, "scatter")[1]["data"]]
    assert reads == [
        ["0 to 2 s", "MiD 8.00 (7.00 to 9.50)", "1,200 sequences"],
        ["2 to 5 s", "MiD 7.00", "1,200 sequences"],
    ]  # fmt: skip
    assert chart.rows[1] == ("0 to 2", "1,200", "8.00 (7.00 to 9.50)", "40.00")
    assert [css for _, css in chart.headings] == ["", "number", "number", "number"]
    assert legend_of(chart) == ["Mean error", "95% confidence interval"]
    assert (chart.has_intervals, chart.note) == (True, "")
    assert chart.label == "Mean MiD and RTE by true time to contact."
    plain = analysis_charts.curve([BINS[0], BINS[2]], [MID])
    assert (legend_of(plain), plain.has_intervals) == (["Mean error"], False)
    assert analysis_charts.curve([], [MID]).rows == ()


def legend_of(chart: Chart) -> list[Any]:
    names: list[Any] = chart.options["media"][0]["option"]["legend"]["data"]
    return names


def test_curves_of_two_other_rows_are_grey_one_of_them_dashed_and_stand_in_the_table() -> None:
    best, baseline = [row(0, 2, 5.0, 20.0)], [row(2, 5, 6.0, 25.0)]
    chart = analysis_charts.curve(BINS, [MID], [("Best", OTHER, best), ("Baseline", OTHER, baseline)])
    assert data(chart, "line")[:2] == [
        ("Best: Other", 0, [[1.0, 5.0]]), ("Baseline: Other", 0, [[3.5, 6.0]]),
    ]  # fmt: skip
    looks = [(each["lineStyle"]["color"], each["lineStyle"]["type"]) for each in series_of(chart, "line")]
    assert looks == [("--quiet", "solid"), ("--quiet", "dashed"), ("--s1", "solid"), ("--s1", "solid")]
    assert [line[3:] for line in chart.rows] == [("–", "–"), ("5.00", "–"), ("–", "6.00")]
    solid, dashed = legend_of(chart)[2:]
    assert (solid["name"], dashed["name"]) == ("Best: Other", "Baseline: Other")
    assert solid["icon"].count("M") < dashed["icon"].count("M"), "a key of a dashed line has two pieces"


@pytest.mark.parametrize(("low", "is_logarithmic"), [(1.0, False), (0.4, True)])
def test_axis_of_errors_knows_the_ends_of_intervals(low: float, is_logarithmic: bool) -> None:
    bins = [row(0, 2, 5.0, 1.0, mid_ends=(low, 6.0))]
    [axis] = analysis_charts.curve(bins, [MID]).options["baseOption"]["yAxis"]
    assert (axis["type"] == "log") is is_logarithmic


# --- who is warned ----------------------------------------------------------------------------------------


def side(n: int, share: float | None, interval: tuple[float, float] | None = None) -> Row:
    return {"n": n, "share": share, "interval": interval}


def test_warnings_have_a_panel_for_each_side_without_thresholds_that_concern_no_sequence() -> None:
    rows = [
        {"threshold_s": 1.0, "missed": side(0, None), "false": side(1500, 4.0)},
        {"threshold_s": 2.5, "missed": side(1, 20.0, (10.0, 30.0)), "false": side(9, 3.0)},
    ]
    chart = analysis_charts.warnings(rows)
    assert data(chart, "line") == [
        ("Share of sequences", 0, [[2.5, 20.0]]), ("Share of sequences", 1, [[1.0, 4.0], [2.5, 3.0]]),
    ]  # fmt: skip
    assert data(chart, "scatter") == data(chart, "line")
    assert [points for _, _, points in data(chart, "custom")] == [[[2.5, 10.0, 30.0]], []]
    missed, false_alarms = series_of(chart, "scatter")
    assert [missed["data"][0]["name"], *missed["data"][0]["read"]] == [
        "2.5 s", "Missed warnings 20.00 (10.00 to 30.00)%", "of 1 sequence",
    ]  # fmt: skip
    assert false_alarms["data"][0]["read"] == ["False alarms 4.00%", "of 1,500 sequences"]
    assert chart.rows == (
        ("1", "0", "–", "1,500", "4.00"), ("2.5", "1", "20.00 (10.00 to 30.00)", "9", "3.00"),
    )  # fmt: skip
    assert chart.columns == (
        "Threshold in s",
        "Sequences",
        "Missed warnings %",
        "Sequences",
        "False alarms %",
    )
    assert {css for _, css in chart.headings[1:]} == {"number"}
    assert {(axis["min"], axis["max"]) for axis in chart.options["baseOption"]["xAxis"]} == {(1.0, 2.5)}
    assert {axis["min"] for axis in chart.options["baseOption"]["yAxis"]} == {0}
    assert (legend_of(chart), chart.has_intervals) == (
        ["Share of sequences", "95% confidence interval"],
        True,
    )
    plain = analysis_charts.warnings(rows[:1])
    assert (legend_of(plain), plain.has_intervals) == ([], False)
    assert analysis_charts.warnings([]).rows == ()


# --- how errors are distributed ---------------------------------------------------------------------------


def test_histogram_has_a_bar_for_each_bin_and_the_last_one_holds_what_is_more() -> None:
    bins = [
        {"low": 0.0, "high": 4.0, "n": 1},
        {"low": 4.0, "high": 8.0, "n": 1200},
        {"low": 8.0, "high": None, "n": 3},
    ]
    chart = analysis_charts.histogram(bins, MID)
    [bars] = series_of(chart, "bar")
    assert [item["value"] for item in bars["data"]] == [[0, 1], [1, 1200], [2, 3]]
    assert [(item["name"], *item["read"]) for item in bars["data"]] == [
        ("MiD 0.00 to 4.00", "1 sequence"), ("MiD 4.00 to 8.00", "1,200 sequences"),
        ("MiD 8.00 and more", "3 sequences"),
    ]  # fmt: skip
    assert chart.rows[1:] == (("4.00 to 8.00", "1,200"), ("8.00 and more", "3"))
    assert [css for _, css in chart.headings] == ["", "number"]
    hidden, scale = chart.options["baseOption"]["xAxis"]
    assert (hidden["data"], hidden["show"]) == ([0, 1, 2], False)
    assert (scale["min"], scale["max"], scale["gridIndex"], scale["position"]) == (0.0, 3.0, 0, "bottom")
    [counts] = chart.options["baseOption"]["yAxis"]
    assert (counts["min"], counts["minInterval"]) == (0, 1), "there is no half sequence"
    assert scale["name"].endswith("(MiD), ×10⁻⁴")
    assert analysis_charts.histogram([], MID).rows == ()


@pytest.mark.parametrize(
    ("lows", "ticks"),
    [
        ((0.0, 4.0, 8.0, 12.0), [(0.0, "0"), (1.25, "5"), (2.5, "10"), (3.5, "more")]),
        ((0.0,), [(0.0, "0"), (0.5, "more")]),
        # A wide scale has a value half a bar from "more".
        ((0.0, 5.0, 10.0), [(0.0, "0"), (0.5, "2.5"), (1.0, "5"), (1.5, "7.5"), (2.0, "10"), (2.5, "more")]),
        # Eight of the bars end at 8, half a bar from "more".
        (tuple(float(i) for i in range(9)), [(0.0, "0"), (2.0, "2"), (4.0, "4"), (6.0, "6"), (8.5, "more")]),
    ],
)
def test_scale_of_bars_has_round_values_where_they_leave_room(
    lows: tuple[float, ...], ticks: list[tuple[float, str]]
) -> None:
    assert analysis_charts._bar_ticks([{"low": low} for low in lows]) == ticks


# --- predicted against true -------------------------------------------------------------------------------


def test_scatter_has_each_sequence_in_the_order_of_truth_and_outliers_at_its_edge() -> None:
    drawn = {"true_s": [3.0, -25.0, 1.0], "predicted_s": [99.0, 2.0, -30.0]}
    chart = analysis_charts.scatter(drawn)
    [cloud], [perfect] = series_of(chart, "scatter"), series_of(chart, "line")
    assert [item["value"] for item in cloud["data"]] == [[-20.0, 2.0], [1.0, -20.0], [3.0, 20.0]]
    assert [cloud["data"][0]["name"], *cloud["data"][0]["read"]] == ["true -25.000 s", "predicted 2.000 s"]
    assert perfect["data"] == [[-20.0, -20.0], [20.0, 20.0]]
    assert chart.rows == (("-25.000", "2.000"), ("1.000", "-30.000"), ("3.000", "99.000"))
    assert {css for _, css in chart.headings} == {"number"}
    for axis in ("xAxis", "yAxis"):
        [drawn_axis] = chart.options["baseOption"][axis]
        assert [drawn_axis[name] for name in ("min", "max", "interval")] == [-20.0, 20.0, 10]
    assert analysis_charts.scatter({"true_s": [], "predicted_s": []}).rows == ()
