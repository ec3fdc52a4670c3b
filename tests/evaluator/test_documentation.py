"""The pages about format and scoring say what the code does."""

import json
import re

import numpy as np
import pytest

from evaluator import PROBLEM_CODES, PROTOCOLS, TTC_RANGES, GroundTruth, read_predictions
from evaluator.truth.csv_tables import Table
from tests.evaluator.worlds import REPOSITORY

FORMAT = (REPOSITORY / "docs" / "file-format.md").read_text(encoding="utf-8")
SCORING = (REPOSITORY / "docs" / "scoring.md").read_text(encoding="utf-8")
EXAMPLES = re.findall(r"```json\n(.*?)```", FORMAT, re.DOTALL)

MANIFEST = GroundTruth.from_table(
    Table(
        anno_id=[0, 1, 2],
        bag_stamp=["0007", "0007", "0012"],
        cam_id=["1", "1", "4"],
        ts_ns=[1_500_000_000, 2_100_000_000, 700_000_000],
        track_id=["3", "3", "11"],
        ttc_s=[5.0, -12.0, 1.0],
    )
).manifest


def test_the_page_shows_every_form() -> None:
    assert len(EXAMPLES) == 4


@pytest.mark.parametrize("example", EXAMPLES)
def test_every_example_is_accepted_and_says_about_the_same(example: str) -> None:
    predictions = read_predictions(example.encode(), manifest=MANIFEST)
    np.testing.assert_allclose(predictions.ttc_s, [5.31, -12.9, 0.84], rtol=2e-3)
    assert predictions.meta == json.loads(example).get("meta")


def test_every_problem_has_its_line() -> None:
    lines = dict(
        re.findall(r"^\| `([a-z0-9-]+)` \| (.*) \|$", FORMAT.partition("\n## Problems\n")[2], re.MULTILINE)
    )
    assert lines == PROBLEM_CODES, "give each its line in docs/file-format.md, under Problems"


def test_every_protocol_and_interval_is_described() -> None:
    assert [name for name in PROTOCOLS if f"`{name}`" not in SCORING] == [], (
        "describe them in docs/scoring.md"
    )
    for ttc_range in TTC_RANGES:
        low, high = (f"{value:g}".replace("-", "−") for value in (ttc_range.low_s, ttc_range.high_s))
        assert ttc_range.name in SCORING
        assert f"{low} ≤ τ ≤ {high}" in SCORING
    for boundary in PROTOCOLS["tsttc-1"].boundaries:
        assert boundary.replace("-", "−") in SCORING
