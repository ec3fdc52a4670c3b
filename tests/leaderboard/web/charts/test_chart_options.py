"""Axes, legends and panels of charts: what has a place, and that nothing lies on anything else."""

import re
from typing import Any
from uuid import UUID

import pytest

from evaluator.metrics.registry import MID
from leaderboard.web.charts import svg
from leaderboard.web.charts.chart_options import (
    _STACKED_PX,
    Chart,
    Frame,
    Mark,
    error_axis,
    log_axis,
    names_axis,
    ranks_axis,
    round_range,
)
from tests.services import REPOSITORY


@pytest.mark.parametrize(
    ("low", "high", "ends"),
    [
        (13.0, 41.0, (10.0, 50.0)), (20.0, 20.0, (20.0, 50.0)), (1.0, 10.0, (1.0, 10.0)),
        (0.03, 0.2, (0.02, 0.2)), (9.99, 10.01, (5.0, 20.0)), (50.0, 51.0, (50.0, 100.0)),
    ],
)  # fmt: skip
def test_range_is_the_next_round_numbers_that_enclose_the_values(
    low: float, high: float, ends: tuple[float, float]
) -> None:
    assert round_range(low, high) == ends


@pytest.mark.parametrize(
    ("values", "room", "ticks"),
    [
        ([13.0, 41.0], 0.0, [10, 20, 50]),
        # The ends alone would leave the middle without a name.
        ([2.0, 5.0], 0.0, [2, 3, 4, 5]),
        ([11.0, 19.0], 0.0, [10, 12, 15, 20]),
        ([52.0, 99.0], 0.0, [50, 60, 80, 100]),
        # Of several decades their beginnings.
        ([1.5, 900.0], 0.0, [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000]),
        ([0.6, 900.0], 0.0, [1, 10, 100, 1000]),
        # Free below the values: a part of the whole.
        ([20.0, 41.0], 0.2, [10, 20, 50]),
        ([25.0, 41.0], 0.2, [20, 30, 40, 50]),
        ([25.0, 41.0], 0.3, [10, 20, 50]),
    ],
)
def test_logarithmic_axis_has_round_ends_and_named_steps_between(
    values: list[float], room: float, ticks: list[float]
) -> None:
    axis = log_axis(values, room=room)
    assert axis["axisLabel"]["customValues"] == axis["axisTick"]["customValues"] == ticks
    assert axis["min"] <= ticks[0]
    assert axis["max"] == ticks[-1]


@pytest.mark.parametrize(
    ("values", "kind", "ends"),
    [
        ([10.0, 60.0], "value", (0, None)), ([10.0, 60.1], "log", (10.0, 100.0)),
        ([0.0, 60.0], "value", (0, None)), ([], "value", (0, None)),
    ],
)  # fmt: skip
def test_axis_of_errors_is_straight_from_zero_up_to_six_times_the_smallest(
    values: list[float], kind: str, ends: tuple[float, float | None]
) -> None:
    axis = error_axis(MID, values)
    assert (axis["type"], axis["min"], axis.get("max")) == (kind, *ends)
    assert axis["name"] == ("MiD, ×10⁻⁴ (log scale)" if kind == "log" else "MiD, ×10⁻⁴")
    assert (axis["splitLine"]["show"], axis["axisLine"]["show"]) == (True, False)


def test_near_axis_has_round_ends_around_the_values() -> None:
    axis = error_axis(MID, [13.2, 15.9], is_near=True)
    assert (axis["min"], axis["max"], axis["interval"]) == (13.0, 16.0, 1.0)


def test_axis_of_names_has_room_for_each_and_one_of_ranks_names_all_up_to_thirteen() -> None:
    axis = names_axis(["a", "b", "c"])
    assert (axis["min"], axis["max"], axis["axisLabel"]["customValues"]) == (-0.5, 2.5, [0, 1, 2])
    assert axis["axisLabel"]["formatter"] == {"call": "texts", "of": [[0, "a"], [1, "b"], [2, "c"]]}
    intervals = [
        ranks_axis(["1"] * n, is_upright=u)["axisLabel"].get("interval")
        for n, u in ((13, False), (14, False), (14, True))
    ]
    assert intervals == [0, None, 0]


# --- panels and legends -----------------------------------------------------------------------------------


def layouts(n_panels: int, *names: str, **options: Any) -> list[dict[str, Any]]:
    """The layouts of a frame: wide, narrow and narrowest."""
    frame = Frame(x_axes=[{}] * n_panels, y_axes=[{}] * n_panels, series=[], names=names, **options)
    return [each["option"] for each in frame.options()["media"]]


@pytest.mark.parametrize(("n", "parts"), [(2, (0.5,)), (3, (1 / 3, 2 / 3))])
def test_panels_stand_side_by_side_and_on_a_narrow_screen_one_above_the_other(
    n: int, parts: tuple[float, ...]
) -> None:
    wide, narrow, narrowest = (each["grid"] for each in layouts(n, "A"))
    for grids, before, after in (
        (wide, "left", "right"),
        (narrow, "top", "bottom"),
        (narrowest, "top", "bottom"),
    ):
        assert len(grids) == n
        for first, second, part in zip(grids, grids[1:], parts, strict=False):
            end, start = 100 - percent(first[after]), percent(second[before])
            assert end < start < 100
            if before == "left":
                assert (end + start) / 2 == pytest.approx(100 * part, abs=1)
        heights = [grid[before] for grid in grids if isinstance(grid[before], str)]
        assert heights == sorted(heights)
    # The legend takes its height from all panels.
    assert percent(layouts(n, *["A" * 40] * 9)[1]["grid"][1]["top"]) > percent(narrow[1]["top"])


def percent(text: str) -> float:
    return float(text.removesuffix("%"))


@pytest.mark.parametrize(("n", "height_px"), [(2, 704), (3, 896)])
@pytest.mark.parametrize("n_names", [0, 1, 6])
def test_panels_above_each_other_share_the_height_that_the_legend_leaves(
    n: int, height_px: int, n_names: int
) -> None:
    for layout in layouts(n, *["A" * 40] * n_names)[1:]:
        ends = [[in_px(grid[side], height_px) for side in ("top", "bottom")] for grid in layout["grid"]]
        heights = [height_px - top - bottom for top, bottom in ends]
        assert max(heights) - min(heights) < 20
        assert min(heights) > height_px / n / 3


@pytest.mark.parametrize(
    ("n", "narrow_px", "selector"),
    [(2, 600, r':not\(\[data-panels="1"\], \[data-panels="3"\]\)'), (3, 900, r'\[data-panels="3"\]')],
)
def test_panels_stack_at_the_width_and_height_that_the_style_sheet_gives_them(
    n: int, narrow_px: int, selector: str
) -> None:
    css = (REPOSITORY / "static/site.css").read_text()
    [block] = [
        part
        for part in css.split("@container ")
        if part.startswith(f"(max-width: {narrow_px}px)") and re.search(rf"\.chart{selector}:is\(", part)
    ]
    found = re.search(rf"\.chart{selector}:is\([^{{]*{{\s*height: (\d+)rem", block)
    assert found is not None
    assert int(found[1]) * 16 == _STACKED_PX[n]
    queries = [each.get("query") for each in Frame([{}] * n, [{}] * n, []).options()["media"]]
    assert queries[:2] == [None, {"maxWidth": narrow_px}]


def in_px(side: int | str, height_px: int) -> float:
    return percent(side) / 100 * height_px if isinstance(side, str) else side


@pytest.mark.parametrize(
    ("names", "n_lines"),
    [
        ((), (0, 0, 0)), (("A",), (1, 1, 1)), (("A" * 20,) * 2, (1, 1, 2)), (("A" * 20,) * 3, (1, 2, 3)),
        # A name is cut where it would be longer than a line.
        (("A" * 90,) * 2, (2, 2, 2)), (("A" * 5,) * 9, (1, 2, 3)), (("A" * 5,) * 10, (2, 2, 3)),
    ],
)  # fmt: skip
def test_ground_begins_below_all_lines_of_the_legend(
    names: tuple[str, ...], n_lines: tuple[int, ...]
) -> None:
    none = [each["grid"][0]["top"] for each in layouts(1)]
    tops = [each["grid"][0]["top"] for each in layouts(1, *names)]
    assert [(top - least) / 24 for top, least in zip(tops, none, strict=True)] == list(n_lines)
    for each in layouts(1, *names):
        shown = [each["legend"][name] for name in ("show", "left", "top")]
        assert shown == [bool(names), 0, 0], "it begins in the corner of the drawing"
    lower = [each["grid"][0]["top"] for each in layouts(1, *names, top=30)]
    assert [low - top for low, top in zip(lower, tops, strict=True)] == [30, 30, 30]


def test_legend_of_more_panels_has_more_room_in_a_line() -> None:
    names = ["A" * 20] * 4
    tops = [layouts(n, *names)[0]["grid"][0]["top"] for n in (1, 3)]
    assert tops[0] - tops[1] == 24
    frames = [Frame(x_axes=[{}] * n, y_axes=[{}] * n, series=[]) for n in (1, 2, 3)]
    widths = [[each.get("query") for each in frame.options()["media"]][1]["maxWidth"] for frame in frames]
    assert widths == [600, 600, 900]


def test_names_before_the_ground_have_the_room_that_is_left_for_them() -> None:
    assert ["yAxis" in each for each in layouts(1)] == [False] * 3
    of_width = layouts(1, left=(220, 126), y_labels_by_width=({"a": 1}, {"b": 2}))
    assert [each["yAxis"] for each in of_width] == [
        [{"axisLabel": {"width": 204, "a": 1}}], *[[{"axisLabel": {"width": 110, "b": 2}}]] * 2,
    ]  # fmt: skip
    assert [each["grid"][0]["left"] for each in of_width] == [220, 126, 126]
    assert of_width[0]["grid"][0]["bottom"] < layouts(1)[0]["grid"][0]["bottom"]


def test_each_axis_is_of_its_panel_and_a_further_one_of_the_last() -> None:
    frame = Frame(
        x_axes=[{}] * 2, y_axes=[{}] * 2, series=[], further_x_axes=[{}], names=["A", "B"], keys={"B": "rect"}
    )
    base = frame.options()["baseOption"]
    assert [axis["gridIndex"] for axis in base["xAxis"]] == [0, 1, 1]
    assert [axis["gridIndex"] for axis in base["yAxis"]] == [0, 1]
    assert base["xAxis"][2]["position"] == "bottom"
    assert (base["animation"], base["useUTC"]) == (False, True)
    assert frame.options()["media"][0]["option"]["legend"]["data"] == ["A", {"name": "B", "icon": "rect"}]


@pytest.mark.parametrize("href", ["", f"/methods/{UUID(int=1)}/"])
def test_chart_has_links_where_a_mark_has_one(href: str) -> None:
    item = Mark(1.0, 2.0, ("A", "b", "c"), href).item()
    assert (item["value"], item["name"], item["read"], item.get("href", "")) == (
        [1.0, 2.0],
        "A",
        ["b", "c"],
        href,
    )
    options = {"baseOption": {"series": [{"data": [Mark(1, 2, ("B",)).item(), item]}], "yAxis": [{}, {}]}}
    chart = Chart(kind="", label="", options=options, columns=(), rows=())
    assert (chart.has_links, chart.n_panels, bool(chart)) == (bool(href), 2, False)


# --- ticks ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("low", "high", "n", "ticks"),
    [
        (9.3, 31.0, 4, (0, 10, 20, 30, 40)), (0.6, 0.6, 3, (0.6, 0.7)), (0.0, 0.0, 3, (0.0, 0.1)),
        (0.0, 4.0, 4, (0, 1, 2, 3, 4)), (0.0, 4.1, 4, (0, 2, 4, 6)), (0.0, 10.0, 4, (0, 2.5, 5, 7.5, 10)),
        (0.0, 20.0, 4, (0, 5, 10, 15, 20)), (-3.0, 3.0, 4, (-4, -2, 0, 2, 4)),
        (5.0, 44.6, 4, (0, 20, 40, 60)),
        (13.2, 15.9, 4, (13, 14, 15, 16)), (0.3, 0.7, 4, (0.3, 0.4, 0.5, 0.6, 0.7)),
    ],
)  # fmt: skip
def test_ticks_are_few_round_and_enclose_the_values(
    low: float, high: float, n: int, ticks: tuple[float, ...]
) -> None:
    assert svg.round_ticks(low, high, n=n) == ticks
