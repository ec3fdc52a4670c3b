"""Charts of a board, without a page: what is drawn of each row, and what the table beside has."""

from datetime import UTC, datetime
from typing import Any
from uuid import UUID

import pytest

from evaluator.metrics.registry import MID
from leaderboard.boards.rows import Entry
from leaderboard.boards.snapshots import Attempt
from leaderboard.methods.details import stated
from leaderboard.web.charts import board_charts
from leaderboard.web.charts.chart_options import Chart

NOON = datetime(2026, 11, 20, 12, tzinfo=UTC)
NAMES = ("Best so far", "Submissions", "Published results")


def day(number: int, month: int = 11) -> datetime:
    return NOON.replace(day=number, month=month)


def ms(at: datetime) -> float:
    return at.replace(hour=0).timestamp() * 1000


def sent(number: int, value: float | None = 9.0, **details: Any) -> Entry:
    return Entry(
        kind="submission", method=f"S{number}", team="Owls", scores={"mid": value}, decimals=1,
        method_id=UUID(int=number), details=stated(**details),
    )  # fmt: skip


def quoted(name: str, value: float | None, year: int | None, **details: Any) -> Entry:
    return Entry(
        kind="published", slug=name, method=name, team="A. Author, B. Author, C. Author",
        scores={"mid": value}, year=year, details=stated(**details),
    )  # fmt: skip


def attempt(number: int, at: datetime, value: float | None) -> Attempt:
    return Attempt(UUID(int=number), UUID(int=100 * number + at.day), at, {"mid": value})


ROWS = [
    sent(1), sent(2), quoted("P", 30.0, 2024), quoted("Q", 25.5, 2026), quoted("R", None, 2020),
    quoted("T", 1.0, None),
]  # fmt: skip
ATTEMPTS = [
    attempt(2, day(5), 20.0), attempt(1, day(3), 28.0), attempt(1, day(7), 20.0), attempt(2, day(9), 10.5),
    attempt(3, day(1), 0.5), attempt(1, day(2), None),
]  # fmt: skip


def series_of(chart: Chart) -> list[dict[str, Any]]:
    series: list[dict[str, Any]] = chart.options["baseOption"]["series"]
    return series


def places(series: dict[str, Any]) -> list[tuple[str, list[float]]]:
    return [(item["name"], item["value"]) for item in series["data"]]


# --- progress --------------------------------------------------------------------------------------------


def test_progress_has_attempts_of_shown_methods_by_day_and_quoted_rows_in_the_middle_of_their_year() -> None:
    chart = board_charts.progress(ROWS, ATTEMPTS, metric=MID, now=NOON)
    assert [(date, method, team, best) for date, method, team, _, best in chart.rows] == [
        ("2024", "P", "Author et al.", "yes"),
        ("2026", "Q", "Author et al.", "yes"),
        ("2026-11-03", "S1", "Owls", ""),
        ("2026-11-05", "S2", "Owls", "yes"),
        ("2026-11-07", "S1", "Owls", ""),  # as low as what was there
        ("2026-11-09", "S2", "Owls", "yes"),
    ]
    assert [cell for *_, cell, _ in chart.rows] == [
        '<span class="">30.00</span>', '<span class="">25.50</span>', '<span class="d1">28.0</span>',
        '<span class="d1">20.0</span>', '<span class="d1">20.0</span>', '<span class="d1">10.5</span>',
    ]  # fmt: skip
    front = [
        (day(1, month=7).replace(year=2024), 30.0), (day(1, month=7), 25.5), (day(5), 20.0), (day(9), 10.5),
    ]  # fmt: skip
    best, behind_sent, front_sent, behind_quoted, front_quoted = series_of(chart)
    corners = [[ms(at), value] for at, value in front]
    assert best["data"] == [*corners, [ms(NOON), 10.5]]
    assert places(behind_sent) == [("S1", [ms(day(3)), 28.0]), ("S1", [ms(day(7)), 20.0])]
    assert places(front_sent) == [("S2", corners[2]), ("S2", corners[3])]
    assert (places(behind_quoted), places(front_quoted)) == ([], [("P", corners[0]), ("Q", corners[1])])
    assert [each["name"] for each in series_of(chart)] == [NAMES[0], *NAMES[1:2] * 2, *NAMES[2:] * 2]
    assert [each.get("symbol") for each in series_of(chart)[1:]] == ["circle"] * 2 + ["diamond"] * 2
    assert [each["itemStyle"]["color"] for each in series_of(chart)[1:]] == ["--ground", "--s1"] * 2
    assert all(each["itemStyle"]["borderWidth"] >= 1 for each in series_of(chart)[1:]), (
        "neighbours stay apart"
    )
    # What is better lies above what is behind it, and both above the line.
    assert best["z"] < behind_sent["z"] == behind_quoted["z"] < front_sent["z"] == front_quoted["z"]
    assert (best["step"], best["silent"], best["showSymbol"]) == ("end", True, False)
    assert chart.note == "Rows quoted from papers are placed in the middle of their year."
    assert chart.label.endswith(": from P MiD 30.00 to S2 MiD 10.5.")
    assert chart.headings[3] == ("MiD ×10⁻⁴", "number")
    assert chart.is_zoomable
    assert chart.options["baseOption"]["toolbox"]["feature"]["dataZoom"]["yAxisIndex"] == "none"


def test_mark_says_method_team_value_and_day_and_praise_on_the_front_alone() -> None:
    chart = board_charts.progress(ROWS, ATTEMPTS, metric=MID, now=NOON)
    _, behind, front, _, of_papers = series_of(chart)
    assert behind["data"][0]["read"] == ["Owls", "MiD 28.0 ×10⁻⁴, 2026-11-03"]
    assert front["data"][0]["read"] == ["Owls", "MiD 20.0 ×10⁻⁴, 2026-11-05", "the best when it came"]
    assert front["data"][0]["href"] == f"/methods/{UUID(int=2)}/"
    assert "href" not in of_papers["data"][0]
    assert chart.has_links
    # A method that improves on itself is named at its best.
    assert [item.get("label") for item in front["data"]] == [{"show": False}, None]
    # A name has the room between the corner before its mark and the one after.
    corners = [item["value"] for item in (*of_papers["data"], *front["data"])]
    assert of_papers["labelLayout"]["of"] == [[None, corners[1]], [corners[0], corners[2]]]
    assert front["labelLayout"]["of"] == [[corners[1], corners[3]], [corners[2], None]]


@pytest.mark.parametrize(("n_dates", "is_drawn"), [(2, False), (3, True)])
def test_results_of_three_dates_are_a_progress(n_dates: int, is_drawn: bool) -> None:
    # Two of one day are one date.
    attempts = [attempt(1, day(i % n_dates + 1), 9.0 - i) for i in range(4)]
    assert board_charts.has_progress(ROWS[:1], attempts) is is_drawn
    chart = board_charts.progress(ROWS[:1], attempts, metric=MID, now=NOON)
    assert (bool(chart), len(chart.rows)) == (is_drawn, 4 * is_drawn)
    assert chart.note == ""


def test_line_of_one_best_goes_on_to_today_or_is_shown_in_the_legend_by_its_mark() -> None:
    falling = [attempt(1, day(i), float(i)) for i in (1, 2, 3)]
    line, *_ = series_of(board_charts.progress(ROWS[:1], falling, metric=MID, now=NOON))
    assert line["data"] == [[ms(day(1)), 1.0], [ms(NOON), 1.0]]
    legend = legend_of(board_charts.progress(ROWS[:1], falling, metric=MID, now=NOON))
    assert legend == ["Best so far", "Submissions"]
    # As many points as have room for a name each: those behind are named too, and larger.
    assert behind_look(falling) == (17.0, True)
    more = [*falling, *(attempt(1, day(i), float(i)) for i in (4, 5))]
    assert behind_look(more) == (17.0, True)
    assert behind_look([*more, attempt(1, day(6), 6.0)]) == (9.0, False)


def legend_of(chart: Chart) -> list[Any]:
    names: list[Any] = chart.options["media"][0]["option"]["legend"]["data"]
    return names


def behind_look(attempts: list[Attempt]) -> tuple[float, bool]:
    _, behind, *_ = series_of(board_charts.progress(ROWS[:1], attempts, metric=MID, now=NOON))
    return behind["symbolSize"], behind.get("label", {}).get("show", False)


@pytest.mark.parametrize(
    ("first", "last", "ends", "title"),
    [
        # A margin of 4 %, at least a day, on either side of the submissions and of today.
        (day(9), day(11), (day(8), day(21)), "Date in 2026 (UTC)"),
        (NOON.replace(year=2025, month=11, day=20), day(11), None, "Date"),
        (day(20, 10), day(11), None, "Date in 2026 (UTC)"),
    ],
)
def test_time_axis_has_a_margin_around_submissions_and_today(
    first: datetime, last: datetime, ends: tuple[datetime, datetime] | None, title: str
) -> None:
    attempts = [attempt(1, first, 3.0), attempt(1, day(10), 2.0), attempt(1, last, 1.0)]
    [axis] = board_charts.progress(ROWS[:1], attempts, metric=MID, now=NOON).options["baseOption"]["xAxis"]
    margin = 0.04 * (ms(NOON) - ms(first))
    low, high = (ms(ends[0]), ms(ends[1])) if ends else (ms(first) - margin, ms(NOON) + margin)
    assert (axis["min"], axis["max"]) == (pytest.approx(low), pytest.approx(high))
    assert axis["name"] == title
    assert axis["axisLabel"]["showMinLabel"] is False


def test_time_axis_has_whole_years_around_papers() -> None:
    rows = [quoted("P", 30.0, 2024), quoted("Q", 25.5, 2025), quoted("R", 20.0, 2026)]
    [axis] = board_charts.progress(rows, metric=MID, now=day(1, month=10)).options["baseOption"]["xAxis"]
    years = [datetime(year, 1, 1, tzinfo=UTC).timestamp() * 1000 for year in (2024, 2027)]
    assert [axis["min"], axis["max"]] == years
    assert axis["axisLabel"]["showMinLabel"]
    turn = [attempt(1, day(d, month=12), 9.0 - d) for d in (28, 30, 31)]
    new_year = datetime(2027, 1, 3, tzinfo=UTC)
    [axis] = board_charts.progress(ROWS[:1], turn, metric=MID, now=new_year).options["baseOption"]["xAxis"]
    assert axis["name"] == "Date in 2026 and 2027 (UTC)"


# --- latency ---------------------------------------------------------------------------------------------


TIMED = [
    sent(1, 10.0, latency_ms=40.0, hardware="GPU"), sent(2, 30.0, latency_ms=5.0),
    sent(3, 20.0, latency_ms=12.5), sent(4, 25.0, latency_ms=12.5),
    quoted("P", 35.5, 2024, latency_ms=80.0, hardware="CPU"),
]  # fmt: skip


def test_latency_has_ranked_public_rows_with_a_latency_and_names_the_others() -> None:
    untimed = [sent(9, 50.0), sent(8, None), sent(7, None, latency_ms=3.0)]
    chart = board_charts.latency([*TIMED, *untimed, hidden(sent(6, 1.0, latency_ms=1.0))], metric=MID)
    assert [(row[0], row[2], row[3], row[5]) for row in chart.rows] == [
        ("S2", "5", "not specified", "yes"),
        ("S3", "12.5", "not specified", "yes"),
        ("S4", "12.5", "not specified", ""),
        ("S1", "40", "GPU", "yes"),
        ("P", "80", "CPU", ""),
    ]
    assert chart.note == ("Latency is self-reported on different hardware. No latency is given for S9.")
    assert chart.label == (
        "MiD of each method against its latency, with the Pareto front: from S2 MiD 30.0 to S1 MiD 10.0."
    )
    assert [i for i, (_, css) in enumerate(chart.headings) if css] == [2, 4]
    line, behind, front, behind_quoted, front_quoted = series_of(chart)
    assert line["data"] == [[5.0, 30.0], [12.5, 20.0], [40.0, 10.0], [40.0, 10.0]]
    assert places(front) == [("S2", [5.0, 30.0]), ("S3", [12.5, 20.0]), ("S1", [40.0, 10.0])]
    assert (places(behind), places(behind_quoted)) == ([("S4", [12.5, 25.0])], [("P", [80.0, 35.5])])
    assert front["data"][0]["read"] == [
        "Owls", "MiD 30.0 ×10⁻⁴, 5 ms on unknown hardware", "on the Pareto front",
    ]  # fmt: skip
    assert front_quoted["data"] == []
    assert legend_of(chart) == ["Pareto front", *NAMES[1:]]


def hidden(entry: Entry) -> Entry:
    return Entry(
        kind="submission", method="Hidden", team="T", scores=entry.scores, method_id=entry.method_id,
        details=entry.details, visibility="PRIVATE",
    )  # fmt: skip


def test_axes_have_room_for_names_below_the_front_and_before_the_fastest() -> None:
    [axis] = board_charts.latency(TIMED, metric=MID).options["baseOption"]["xAxis"]
    assert (axis["type"], axis["min"], axis["max"]) == ("log", 2.0, 100.0)
    # 20 to 500 enclose the values: below them is less than a fifth.
    far = [attempt(1, day(i), value) for i, value in ((1, 300.0), (2, 90.0), (3, 30.0))]
    [axis] = board_charts.progress(ROWS[:1], far, metric=MID, now=NOON).options["baseOption"]["yAxis"]
    assert (axis["type"], axis["min"], axis["max"]) == ("log", 10.0, 500.0)


def test_four_latencies_are_a_chart_and_names_of_up_to_six_methods_without_one_are_given() -> None:
    assert board_charts.latency(TIMED[:3], metric=MID).rows == ()
    assert (
        board_charts.latency(TIMED[:4], metric=MID).note == "Latency is self-reported on different hardware."
    )
    untimed = [sent(10 + i, 50.0) for i in range(7)]
    assert "S15." in board_charts.latency([*TIMED, *untimed[:6]], metric=MID).note
    assert "S15 and 1 other method." in board_charts.latency([*TIMED, *untimed], metric=MID).note
    papers = [quoted(name, 9.0, 2024, latency_ms=i + 1.0) for i, name in enumerate("ABCD")]
    chart = board_charts.latency(papers, metric=MID)
    assert chart.note == "Latency is as printed in the papers, on different hardware."
    # A front of one mark is no line.
    assert legend_of(chart) == [{"name": "Pareto front", "icon": "diamond"}, "Published results"]
    assert chart.label.endswith("with the Pareto front: A MiD 9.00.")


@pytest.mark.parametrize("n_behind", [2, 3])
def test_of_many_behind_a_front_the_lowest_are_drawn(n_behind: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(board_charts, "MAX_BEHIND", 2)
    behind = [sent(10 + i, 30.0 - i, latency_ms=50.0 + i) for i in range(n_behind)]
    chart = board_charts.latency([*TIMED[:3], *behind], metric=MID)
    drawn = {row[0] for row in chart.rows}
    assert drawn == {"S1", "S2", "S3", *(each.method for each in behind[-2:])}
    assert ("Shown are the 5 with the lowest MiD, or on the line, of 6." in chart.note) is (n_behind == 3)
