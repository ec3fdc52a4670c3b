"""Names and units in the command's tables."""

import pytest

from evaluator.cli.layout import short_name, units
from evaluator.cli.values import overall_of


@pytest.mark.parametrize(("name", "text"), [("mid", "MiD"), ("rte_crucial", "RTE_c"), ("mid_new", "MiD_n")])
def test_a_score_has_a_short_name(name: str, text: str) -> None:
    assert short_name(name) == text


@pytest.mark.parametrize(
    ("names", "text"),
    [
        (["mid"], "MiD ×10⁻⁴, lower is better"),
        (
            ["mid", "mid_crucial", "mid_negative", "rte"],
            "MiD ×10⁻⁴, RTE %, lower is better; TTC ranges in s: c 0–3, n −20–0",
        ),
    ],
)
def test_units_and_ranges_of_the_columns_are_explained(names: list[str], text: str) -> None:
    assert units(names) == text


def test_overall_scores_are_those_of_no_range_once_each() -> None:
    assert overall_of(["mid", "mid_small", "rte", "mid"]) == ["mid", "rte"]
