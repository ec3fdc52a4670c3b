"""The benchmarks and the page of their figures name the same goals."""

import re

from benchmarks import __main__ as bench
from tests.journeys.production import REPOSITORY

ROW = re.compile(r"\| ([≥≤])\s([\d.]+)[^|]*\|[^|]*\|[^|]*\| `([a-z]+\.\w+)`")


def test_the_page_of_capacity_states_the_goals_that_are_measured() -> None:
    signs = {"≥": ">=", "≤": "<="}
    rows = ROW.findall((REPOSITORY / "docs/capacity.md").read_text())
    assert {name: (signs[sign], float(goal)) for sign, goal, name in rows} == bench.GOALS
    assert {name.partition(".")[0] for name in bench.GOALS} == set(bench.NAMES)


def test_a_figure_is_printed_with_its_goal() -> None:
    assert bench.judged("inference.200 = 3.5 s").endswith("(goal <= 3: MISSED)")
    assert bench.judged("board.page_of_empty = 0.7 of it").endswith("(goal >= 0.5: holds)")
    assert bench.judged("board.empty = 1.2 ms") == "board.empty = 1.2 ms"
    assert bench.judged("wrk is not here") == "wrk is not here"
