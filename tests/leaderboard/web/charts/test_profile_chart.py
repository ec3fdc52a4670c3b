"""The chart of errors by TTC range, without a page."""

from typing import Any
from uuid import UUID

import pytest

from leaderboard.boards.rows import ConfidenceInterval as Interval
from leaderboard.boards.rows import Entry
from leaderboard.web.charts.chart_options import Chart
from leaderboard.web.charts.profile_chart import profile

NAMES = ("mid", "mid_crucial", "mid_small", "rte", "rte_crucial", "rte_small")


def entry(number: int, *, n_values: int = 6, decimals: int = 1, **intervals: Interval) -> Entry:
    values = [10.0 * number + i if i < n_values else None for i in range(len(NAMES))]
    return Entry(
        kind="submission", method=f"M{number}", team="T", scores=dict(zip(NAMES, values, strict=True)),
        decimals=decimals, method_id=UUID(int=number), intervals=intervals,
    )  # fmt: skip


def series_of(chart: Chart, kind: str) -> list[dict[str, Any]]:
    series: list[dict[str, Any]] = chart.options["baseOption"]["series"]
    return [each for each in series if each["type"] == kind]


def test_each_method_has_marks_beside_those_of_others_in_the_panel_of_each_metric() -> None:
    chart = profile([entry(1), entry(2, n_values=5), entry(3)])
    marks = series_of(chart, "scatter")
    assert [(each["name"], each["xAxisIndex"]) for each in marks] == [
        ("M1", 0), ("M1", 1), ("M2", 0), ("M2", 1), ("M3", 0), ("M3", 1),
    ]  # fmt: skip
    places = [[item["value"] for item in each["data"]] for each in marks]
    assert places[0] == [[pytest.approx(i - 0.16), 10.0 + i] for i in range(3)]
    assert places[2] == [[pytest.approx(i), 20.0 + i] for i in range(3)]
    assert places[4] == [[pytest.approx(i + 0.16), 30.0 + i] for i in range(3)]
    assert [y for _, y in places[3]] == [23.0, 24.0], "a range without a value has no mark"
    assert len({each["symbol"] for each in marks}) == len({each["itemStyle"]["color"] for each in marks}) == 3
    assert chart.options["media"][0]["option"]["legend"]["data"] == ["M1", "M2", "M3"]
    assert chart.columns == ("Error", "TTC range", "M1", "M2", "M3")
    assert [row[:2] for row in chart.rows] == [
        (symbol, words) for symbol in ("MiD", "RTE") for words in ("overall", "crucial", "small")
    ]
    assert chart.label == "MiD and RTE by TTC range of M1, M2, M3."
    assert marks[0]["data"][1]["read"] == ["MiD crucial: 11.0"]
    assert marks[0]["data"][1]["href"] == f"/methods/{UUID(int=1)}/"
    [of_mid, of_rte] = chart.options["baseOption"]["xAxis"]
    texts = [text for _, text in of_mid["axisLabel"]["formatter"]["of"]]
    assert (texts[0], texts[1]) == ("overall", "0–3 s\ncrucial")
    assert (of_rte["min"], of_rte["max"], of_rte["gridIndex"]) == (-0.5, 2.5, 1)
    # Every other range has a light strip behind it.
    strips = [[span[:2] for span in each["data"]] for each in series_of(chart, "custom")[:2]]
    assert strips == [[[-0.5, 0.5], [1.5, 2.5]]] * 2


def test_five_marks_of_a_range_stay_within_it_and_a_sixth_method_is_left_out() -> None:
    chart = profile([entry(9, n_values=0), *(entry(i) for i in range(1, 7))])
    first = [each["data"][0]["value"][0] for each in series_of(chart, "scatter") if not each["xAxisIndex"]]
    assert first == [pytest.approx(0.14 * i) for i in range(-2, 3)]
    assert chart.columns[2:] == ("M1", "M2", "M3", "M4", "M5")


def test_chart_of_one_method_has_no_legend_and_one_of_none_is_empty() -> None:
    chart = profile([entry(1)], n_metrics=1)
    assert [chart.n_panels, chart.options["media"][0]["option"]["legend"]["show"]] == [1, False]
    assert series_of(chart, "scatter")[0]["data"][0]["value"] == [0.0, 10.0]
    assert len(chart.rows) == 3
    assert profile([entry(1, n_values=0)]).rows == ()


def test_intervals_are_whiskers_and_words_where_both_ends_are_known() -> None:
    known = {
        "mid": Interval(9.0, 12.0),
        "mid_crucial": Interval(10.0, None),
        "mid_small": Interval(None, 15.0),
    }
    chart = profile([entry(1, **known), entry(2, decimals=2)])
    whiskers = [each for each in series_of(chart, "custom") if each["name"]]
    assert [(each["name"], each["xAxisIndex"], len(each["data"])) for each in whiskers] == [
        ("M1", 0, 1), ("M1", 1, 0), ("M2", 0, 0), ("M2", 1, 0),
    ]  # fmt: skip
    assert whiskers[0]["data"][0][1:] == [9.0, 12.0]
    assert whiskers[0]["encode"] == {"x": 0, "y": [1, 2]}, "axes hold both ends of a span"
    marks = series_of(chart, "scatter")[0]
    assert [mark["read"][0] for mark in marks["data"][:2]] == [
        "MiD overall: 10.0 (9.0 to 12.0)",
        "MiD crucial: 11.0",
    ]
    # As wide as with the most decimals.
    assert chart.rows[0][2] == '<span class="figure w5 d1">10.0</span> (9.0 to 12.0)'
    assert chart.rows[0][3] == '<span class="figure w5">20.00</span>'
    assert chart.has_intervals
    assert not profile([entry(1, mid=Interval(None, None, 1, 2))]).has_intervals
