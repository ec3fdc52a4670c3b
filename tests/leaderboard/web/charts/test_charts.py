"""The page of a board's charts, and the charts of an error analysis."""

import json
import re
from dataclasses import replace
from datetime import timedelta
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np
import pytest
from django.contrib.auth.models import AnonymousUser
from django.db.models import Q
from django.test import Client
from django.utils import timezone

from evaluator.metrics.registry import MID, WARNING
from leaderboard.boards import snapshots
from leaderboard.boards.rows import ConfidenceInterval, Entry
from leaderboard.boards.snapshots import Attempt
from leaderboard.models import Comparison, Edition, Method, Submission, User
from leaderboard.statistics import comparisons
from leaderboard.statistics.comparisons import Pair
from leaderboard.web.charts import analysis_charts, board_charts, chart_views, profile_chart
from leaderboard.web.charts.chart_options import Mark
from leaderboard.web.charts.chart_series import Look, named_marks
from leaderboard.web.charts.significance_chart import alike_words
from tests import builders, pages
from tests.pages import get

pytestmark = pytest.mark.slow

RANGES = ["overall", "0–3 s crucial", "3–6 s small", "6–20 s large", "−20–0 s negative"]


def rows(client: Client, chart: str) -> list[list[str]]:
    """The table behind a chart of the test board, as texts."""
    figure = get(client, "/board/test/charts/").one("figure", **{"data-chart": chart})
    return [[cell.text for cell in row.all("td")] for row in figure.one("tbody").all("tr")]


def spread(entries: list[Submission]) -> None:
    """Let each entry be of another day: a progress."""
    for i, entry in enumerate(entries):
        at = timezone.now() - timedelta(days=3 * i + 3)
        Submission.objects.filter(pk=entry.pk).update(submitted_at=at)
    builders.board_changed("test")


def options_of(figure: pages.Element) -> Any:
    """Return the options that the script draws, as ECharts takes them."""
    return json.loads(figure.one("script").raw_text)["baseOption"]


def test_every_chart_has_its_options_and_the_table_with_the_same_numbers(
    client: Client, entries: list[Submission]
) -> None:
    Method.objects.update(latency_ms=3.5, hardware="one GPU")
    spread(entries)
    builders.infer_all()
    root = get(client, "/board/test/charts/")
    assert [figure.attributes["data-chart"] for figure in root.all("figure")] == [
        "profile",
        "progress",
        "latency",
        "significance",
    ]
    for figure in root.all("figure"):
        assert figure.one("div", class_="drawing").attributes["role"] == "img"
        assert figure.one("div", class_="drawing").attributes["aria-label"].endswith(".")
        numbers = read_numbers(options_of(figure))
        assert numbers
        shown = {number for cell in figure.all("td") for number in NUMBER.findall(cell.text)}
        assert numbers <= shown, figure.attributes["data-chart"]


NUMBER = re.compile(r"\d+\.\d+")


def read_numbers(options: Any) -> set[str]:
    """Return every number with a point in the lines that marks show to a reader."""
    lines = [
        line
        for series in options["series"]
        for mark in series["data"]
        if "read" in mark
        for line in mark["read"]
    ]
    return {number for line in lines for number in NUMBER.findall(line)}


def test_no_option_is_finer_than_the_values_of_the_edition(
    client: Client, edition: Edition, entries: list[Submission]
) -> None:
    builders.infer_all()
    for figure in get(client, "/board/test/charts/").all("figure"):
        for series in options_of(figure)["series"]:
            for item in series["data"]:
                for value in item["value"][1:] if isinstance(item, dict) else item[1:]:
                    assert round(value, edition.decimals) == value


def test_the_options_of_the_progress_are_those_of_the_page(client: Client, entries: list[Submission]) -> None:
    spread(entries)
    figure = get(client, "/board/test/charts/").one("figure", **{"data-chart": "progress"})
    assert client.get("/board/test/charts/progress.json").json()["baseOption"] == options_of(figure)
    assert client.get("/board/nowhere/charts/progress.json").status_code == 404


def test_a_progress_has_three_dates_and_else_errors_by_range_are_drawn(
    client: Client, entries: list[Submission]
) -> None:
    def below(address: str) -> list[tuple[str, bool]]:
        figures = get(client, address).all("figure", class_="chart")
        return [(figure.attributes["data-chart"], bool(figure.all("table"))) for figure in figures]

    assert below("/board/test/") == [("profile", True)]
    assert "Charts not shown yet" in get(client, "/board/val/charts/").one("main").text
    assert ("progress", True) not in below("/board/test/charts/")
    assert client.get("/board/test/charts/progress.json").json() == {}
    spread(entries)
    assert below("/board/test/") == [("progress", False)]
    # Its data are on another page: without scripts there is no heading over an empty area.
    assert get(client, "/board/test/").all("section", class_="drawn-only")
    assert ("progress", True) in below("/board/test/charts/")


def test_caption_of_the_progress_says_that_it_has_all_rows_whatever_the_filter(
    client: Client, entries: list[Submission]
) -> None:
    spread(entries)

    def words(url: str) -> str:
        section = get(client, url).one("section", class_="board-progress")
        return section.one("p", class_="note").text

    start = "All public submissions to Test"
    assert words("/board/test/").startswith(f"{start}, and rows quoted from papers.")
    filtered = words("/board/test/?q=M1.05")
    assert filtered.startswith(f"{start}, also those that the filter hides, and rows quoted from papers.")


def test_below_a_board_the_chart_does_not_change_with_its_filters(
    client: Client, entries: list[Submission]
) -> None:
    charts = [
        get(client, address).one("figure").one("script").raw_text
        for address in ("/board/test/", "/board/test/?q=M1.05&sort=-mid")
    ]
    assert charts[0] == charts[1]


def test_the_lowest_so_far_is_drawn_until_today(edition: Edition, entries: list[Submission]) -> None:
    spread(entries)
    now = timezone.now() + timedelta(days=90)
    chart = chart_views.progress(snapshots.board(split=edition.split, viewer=AnonymousUser()), now=now)
    base = chart.options["baseOption"]
    today_ms = now.replace(hour=0, minute=0, second=0, microsecond=0).timestamp() * 1000
    assert base["series"][0]["data"][-1][0] == today_ms <= base["xAxis"][0]["max"]


def test_the_front_is_what_nothing_beats_in_both(client: Client, entries: list[Submission]) -> None:
    for latency_ms, entry in zip((40.0, 3.0, 12.0, 1.0), entries, strict=True):
        Method.objects.filter(pk=entry.method_id).update(latency_ms=latency_ms, hardware="one GPU")
    builders.board_changed("test")
    latency_rows = rows(client, "latency")
    points = [(float(row[2]), float(row[4])) for row in latency_rows]
    front = [point for point, row in zip(points, latency_rows, strict=True) if row[5] == "yes"]
    assert front == [p for p in points if not any(q != p and q[0] <= p[0] and q[1] <= p[1] for q in points)]


def test_chart_says_what_it_leaves_out_and_its_legend_has_every_mark(
    client: Client, edition: Edition, entries: list[Submission]
) -> None:
    def notes() -> str:
        return get(client, "/board/test/charts/").one("figure", **{"data-chart": "latency"}).text

    Method.objects.update(latency_ms=3.5, hardware="one GPU")
    builders.board_changed("test")
    assert "Latency is self-reported on different hardware." in notes()
    assert "No latency is given for SOT and Detection." in notes()
    figure = get(client, "/board/test/charts/").one("figure", **{"data-chart": "latency"})
    (legend, *_) = [each["option"]["legend"] for each in json.loads(figure.one("script").raw_text)["media"]]
    assert {"name": "Pareto front", "icon": "circle"} in legend["data"], "a front of one mark is no line"


def test_a_method_that_improves_on_itself_is_named_once() -> None:
    front = [Mark(float(i), 9.0 - i, (name,)) for i, name in enumerate(["A", "A", "B"])]
    items = named_marks("", front, range(3), Look())["data"]
    assert [item.get("label") for item in items] == [{"show": False}, None, None]


def test_a_board_with_nothing_to_draw_says_so_and_has_no_empty_chart(client: Client, benchmark: None) -> None:
    root = get(client, "/board/demo/charts/")
    assert root.all("figure") == []
    assert "There are no results on Demo yet." in root.one("main").text
    assert client.get("/board/nowhere/charts/").status_code == 404


def test_leaders_by_range_stand_below_their_chart_as_a_table(
    client: Client, entries: list[Submission]
) -> None:
    root = get(client, "/board/test/charts/")
    leads = root.one("section", **{"aria-labelledby": "leaders"}).one("tbody")
    assert [row.one("th").text for row in leads.all("tr")] == RANGES
    on_landing = get(client, "/").one("table", class_="attempts-list").one("tbody")
    _, *by_range = [row.text for row in leads.all("tr")]
    assert [row.text for row in on_landing.all("tr")] == by_range, "there the leaders stand above"


@pytest.mark.parametrize(
    ("rows", "names"),
    [
        ([("A", "x", 2021), ("B", "x", 2023)], ["A", "B"]),
        ([("A", "x", 2021), ("A", "y", 2021), ("B", "x", 2023)], ["A (x)", "A (y)", "B"]),
        ([("A", "x", 2021), ("A", "x", 2023)], ["A (2021)", "A (2023)"]),
        ([("A", "x", None), ("A", "x", None)], ["A (1)", "A (2)"]),
    ],
)
def test_methods_of_one_name_differ_by_team_then_year_then_position(
    rows: list[tuple[str, str, int | None]], names: list[str]
) -> None:
    shown = [Entry("published", method, team, {}, year=year) for method, team, year in rows]
    assert profile_chart.distinct_names(shown) == names


def test_private_methods_are_in_no_chart_not_even_their_teams(
    client: Client, entries: list[Submission], owner: User, edition: object
) -> None:
    builders.submit(owner, builders.predictions(edition, factor=1.01), method="Secret", visibility="PRIVATE")
    builders.score_all()
    before = client.get("/board/test/charts/").content
    assert b"Secret" not in before
    client.force_login(owner)
    assert b"Secret" not in client.get("/board/test/charts/").content


# --- significance ----------------------------------------------------------------------------------------


@pytest.fixture
def compared(entries: list[Submission], edition: Edition) -> list[Submission]:
    """Entries that may be compared though they are of one team: the labels of their split are open."""
    builders.open_values(edition)
    builders.infer_all()
    return entries


def pairs_figure(client: Client) -> pages.Element:
    return get(client, "/board/test/charts/").one("figure", **{"data-chart": "significance"})


def test_what_is_being_computed_is_no_missing_test_and_comes_by_itself(
    client: Client, compared: list[Submission]
) -> None:
    early = get(client, "/board/test/charts/").one("section", id="pairs")
    assert early.attributes["hx-trigger"] == "every 3s"
    assert early.all("figure") == [], "a map of empty cells"
    n_pairs = len(compared) * (len(compared) - 1) // 2
    assert early.one("p", role="status").text.startswith(f"{n_pairs} of {n_pairs} pairs are being computed.")
    builders.infer_all()
    Comparison.objects.filter(pk=Comparison.objects.first().pk).update(differences=None, computed_at=None)
    names = [series["name"] for series in options_of(pairs_figure(client))["series"]]
    assert "computing…" in names, "most are ready"
    words = get(client, "/board/test/charts/").one("section", id="pairs").text
    assert "All pairs tested so far differ significantly (p < 0.05). Still computing: 1 pair." in words
    builders.infer_all()
    assert "hx-trigger" not in get(client, "/board/test/charts/").one("section", id="pairs").attributes
    cells = [mark for series in options_of(pairs_figure(client))["series"] for mark in series["data"]]
    assert all(cell["text"].startswith("−") for cell in cells), "the row is better"
    # Both say whether differences are shown: a page that was narrow keeps what it was given.
    media = json.loads(pairs_figure(client).one("script").raw_text)["media"]
    assert all("show" in each["label"] for layout in media for each in layout["option"]["series"])


def test_first_rows_are_compared_once_the_page_is_read(client: Client, compared: list[Submission]) -> None:
    assert Comparison.objects.count() == 0
    client.get("/board/test/charts/")
    n_pairs = len(compared) * (len(compared) - 1) // 2
    assert Comparison.objects.filter(computed_at=None).count() == n_pairs
    builders.infer_all()
    pair_rows = rows(client, "significance")
    assert len(pair_rows) == n_pairs
    assert all(float(row[2].replace("−", "-")) <= 0 for row in pair_rows)
    client.get("/board/test/charts/")
    assert Comparison.objects.count() == n_pairs


@pytest.mark.parametrize(("n_first", "words"), [(3, "column, for the first 3 submissions."), (5, "column.")])
def test_map_of_a_long_board_says_that_it_has_its_beginning(
    client: Client, compared: list[Submission], monkeypatch: pytest.MonkeyPatch, n_first: int, words: str
) -> None:
    monkeypatch.setattr(comparisons, "N_FIRST", n_first)
    client.get("/board/test/charts/")
    # Half of them wait: the map is shown, and of more it is not.
    made = list(Comparison.objects.values_list("pk", flat=True))
    for n_waiting, is_early in ((len(made) // 2, False), (len(made) // 2 + 1, True)):
        builders.infer_all()
        Comparison.objects.filter(pk__in=made[:n_waiting]).update(differences=None, computed_at=None)
        context = client.get("/board/test/charts/").context
        assert (context["n_waiting"], context["is_early"]) == (n_waiting, is_early)
        assert context["cell_words"].split("MiD of the ")[-1].startswith(words)


def test_resolution_of_each_column_is_a_table_of_ranges_and_metrics(
    client: Client, compared: list[Submission]
) -> None:
    def resolutions() -> list[pages.Element]:
        return get(client, "/board/test/charts/").all("section", **{"aria-labelledby": "resolution"})

    assert resolutions() == [], "nothing is known yet"
    builders.infer_all()
    of_one = Q(first__submission=compared[0]) | Q(second__submission=compared[0])
    Comparison.objects.filter(of_one).update(differences=None, computed_at=None)
    assert resolutions() == [], "a median of some would change with each that comes"
    builders.infer_all()
    (section,) = resolutions()
    assert [head.text for head in section.one("thead").all("th")] == ["TTC range", "MiD ×10⁻⁴", "RTE %"]
    rows_of_ranges = section.one("tbody").all("tr")
    assert [row.one("th").text for row in rows_of_ranges] == RANGES
    assert all(float(cell.text) > 0 for cell in rows_of_ranges[0].all("td"))


def test_pairs_that_do_not_differ_are_named_above_the_map(
    client: Client, edition: Edition, compared: list[Submission], owner: User
) -> None:
    def words() -> str:
        client.get("/board/test/charts/")
        builders.infer_all()
        return get(client, "/board/test/charts/").one("section", id="pairs").text

    assert "All tested pairs differ significantly (p < 0.05)." in words()
    values = json.loads(builders.predictions(edition, factor=1.05))
    rng = np.random.default_rng(0)
    twin = {key: value * rng.choice([0.999, 1.001]) for key, value in values.items()}
    builders.submit(owner, json.dumps(twin).encode(), method="Twin")
    builders.score_all()
    name = r"(M1\.05|Twin) \(rank \d\)"
    assert re.search(
        rf"All tested pairs differ significantly \(p < 0\.05\), except {name} and {name}\.", words()
    )


def test_rank_ranges_that_overlap_although_their_pairs_differ_are_explained(
    compared: list[Submission],
) -> None:
    def pairs() -> tuple[Pair, ...]:
        (split,) = [each for each in snapshots.splits() if each.pk == "test"]
        return comparisons.of_first(board=snapshots.board(split=split, viewer=AnonymousUser()))

    def certain(entry: Entry) -> Entry:
        ranks = ConfidenceInterval(rank_low=entry.rank, rank_high=entry.rank)
        return replace(entry, intervals={entry.primary: ranks})

    pairs()
    builders.infer_all()
    sentence = " Rank ranges are corrected for the number of tests, so some of them still overlap."
    words = alike_words(pairs())
    assert words.endswith(sentence)
    apart = [replace(pair, first=certain(pair.first), second=certain(pair.second)) for pair in pairs()]
    assert alike_words(apart) == words.removesuffix(sentence)


def test_pairs_that_are_withheld_show_their_published_difference_alone(
    client: Client, edition: Edition, compared: list[Submission], owner: User
) -> None:
    builders.submit(owner, builders.predictions(edition, factor=1.02), method="X", visibility="ANONYMOUS")
    builders.score_all()
    client.get("/board/test/charts/")
    builders.infer_all()
    hidden = [row for row in rows(client, "significance") if "Anonymous" in f"{row[0]} {row[1]}"]
    assert len(hidden) == len(compared)
    assert {(row[3], row[4]) for row in hidden} == {("", "no test")}
    series = {each["name"]: each for each in options_of(pairs_figure(client))["series"]}
    untested = series["no test (anonymous)"]
    assert len(untested["data"]) == len(compared)
    assert untested["itemStyle"]["borderColor"] == "--quiet", "its fill is too pale to be seen"


# --- the closer look -------------------------------------------------------------------------------------


@pytest.fixture
def open_split(tmp_path: Path, benchmark: None, owner: User) -> Submission:
    """A scored submission to `val`, whose truth may be looked into."""
    edition = builders.import_truth(tmp_path, split="val")
    sent = builders.submit(owner, builders.predictions(edition), split="val")
    builders.score_all()
    return sent


def test_team_looks_closer_at_what_it_sent_to_an_open_split(
    client: Client, open_split: Submission, teammate: User, stranger: User
) -> None:
    address = f"/submissions/{open_split.pk}/analysis/"
    client.force_login(teammate)
    assert "is being computed" in get(client, address).one("main").text
    builders.infer_all()
    root = get(client, address)
    assert [figure.attributes["data-chart"] for figure in root.all("figure")] == [
        "curve",
        "histogram",
        "scatter",
    ]
    assert all(figure.one("tbody").all("tr") for figure in root.all("figure"))
    assert "Best on the board" not in root.one("main").text, "there is no other row"
    worst = [float(row.all("td")[1].text) for row in root.all("table")[-1].one("tbody").all("tr")]
    assert worst == sorted(worst, reverse=True)
    assert address in client.get(f"/submissions/{open_split.pk}/").content.decode()
    client.force_login(stranger)
    assert client.get(address).status_code == 404


def test_errors_by_time_stand_beside_those_of_the_best_public_row_and_of_the_baseline(
    client: Client, open_split: Submission, stranger: User
) -> None:
    edition = open_split.evaluations.get().edition
    for factor, name, shown in (
        (1.01, "Secret", "PRIVATE"),
        (1.02, "Best", "PUBLIC"),
        (1.3, "Pixel MSE, ours", "PUBLIC"),
        (1.4, "Pixel MSE, worse", "PUBLIC"),
    ):
        builders.submit(
            stranger, builders.predictions(edition, factor=factor), split="val", method=name, visibility=shown
        )
    builders.score_all()
    builders.infer_all()
    client.force_login(open_split.submitted_by)
    figure = get(client, f"/submissions/{open_split.pk}/analysis/").one("figure", **{"data-chart": "curve"})
    heads = [head.text for head in figure.one("thead").all("th")]
    names = ("Best", "Pixel MSE, ours")
    assert heads[-4:] == [f"{metric} of {name}" for name in names for metric in ("MiD", "RTE")]
    best = Submission.objects.get(method__name="Best").evaluations.get().analysis.content["curve"]
    cells = [row.all("td")[-4].text for row in figure.one("tbody").all("tr")]
    assert cells == [f"{row['mid']:.2f}" for row in best]
    series = options_of(figure)["series"]
    grey = [each for each in series if each["name"] == "Best on the board: Best"]
    dashed = {each["name"] for each in series if each.get("lineStyle", {}).get("type") == "dashed"}
    assert dashed == {"Baseline: Pixel MSE, ours"}
    assert [y for each in grey if each["yAxisIndex"] == 0 for _, y in each["data"]] == [
        row["mid"] for row in best
    ]


def test_three_metrics_have_three_panels_and_a_chart_of_who_is_warned(
    client: Client, tmp_path: Path, benchmark: None, owner: User
) -> None:
    edition = builders.import_truth(tmp_path, split="val", protocol="tsttc-2")
    sent = builders.submit(owner, builders.predictions(edition), split="val")
    builders.score_all()
    builders.infer_all()
    client.force_login(owner)
    analysis, charts = get(client, f"/submissions/{sent.pk}/analysis/"), get(client, "/board/val/charts/")
    figures = {
        figure.attributes["data-chart"]: figure for figure in (*charts.all("figure"), *analysis.all("figure"))
    }
    for kind, n_panels in (("profile", 3), ("curve", 3), ("warnings", 2)):
        options = json.loads(figures[kind].one("script").raw_text)
        for each in options["media"]:
            grids = each["option"]["grid"]
            assert len(grids) == n_panels
            sides = {(grid["left"], grid["top"]) for grid in grids}
            assert len(sides) == n_panels, "no panel lies on another"
        assert {axis["gridIndex"] for axis in options["baseOption"]["yAxis"]} == set(range(n_panels))
    rows = [[cell.text for cell in row.all("td")] for row in figures["warnings"].one("tbody").all("tr")]
    assert [row[0] for row in rows] == ["1", "1.5", "2", "2.5", "2.7", "3", "3.5", "4", "4.5", "5"]
    missed, false_alarms = (each.text for each in analysis.one("dl").all("dd"))
    shares = [
        f"{value}% {interval}".strip() for value, _, interval in (rows[4][j].partition(" ") for j in (2, 4))
    ]
    assert missed == f"{shares[0]} of the {rows[4][1]} sequences with 0 < τ ≤ 2.7 s"
    assert false_alarms == f"{shares[1]} of the {rows[4][3]} sequences with τ ≤ 0 or τ > 2.7 s"


def test_of_a_large_board_the_front_and_the_lowest_are_drawn_and_the_chart_says_so(
    edition: Edition, entries: list[Submission], monkeypatch: pytest.MonkeyPatch
) -> None:
    shown = snapshots.board(split=edition.split, viewer=AnonymousUser()).entries
    (first, *_) = [entry for entry in shown if entry.method_id is not None]
    began = timezone.now()
    attempts = [
        Attempt(first.method_id, uuid4(), began + timedelta(days=day), {"mid": mid})
        for day, mid in enumerate((60.0, 90.0, 80.0, 50.0, 70.0))
    ]
    whole = board_charts.progress([first], attempts, metric=MID, now=began)
    assert (len(whole.rows), whole.note) == (5, "")
    monkeypatch.setattr(board_charts, "MAX_BEHIND", 2)
    chart = board_charts.progress([first], attempts, metric=MID, now=began)
    assert [float(row[3].partition(">")[2].partition("<")[0]) for row in chart.rows] == [60, 80, 50, 70]
    assert chart.note == "Shown are the 4 with the lowest MiD, or on the line, of 5."
    assert sum(len(each["data"]) for each in chart.options["baseOption"]["series"][1:]) >= 4


@pytest.mark.parametrize(("far", "ends"), [(0.5, (0, 6.0)), (30.0, (-20.0, 20.0))])
def test_wrong_warnings_are_drawn_near_the_threshold_unless_there_are_some_elsewhere(
    far: float, ends: tuple[float, float]
) -> None:
    bins = [
        {"low_s": low, "high_s": low + 1.0, "n": 9, MID.name: 1.0, WARNING.name: wrong}
        for low, wrong in ((2.0, 40.0), (12.0, far))
    ]
    chart = analysis_charts.curve(bins, [MID, WARNING])
    of_mid, of_warnings = chart.options["baseOption"]["xAxis"]
    assert (of_mid["min"], of_mid["max"]) == (-20.0, 20.0)
    assert (of_warnings["min"], of_warnings["max"]) == ends
    assert bool(chart.note) is (ends[1] == 6.0)
