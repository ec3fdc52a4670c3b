"""Rank ranges of large boards stay what they are, to the last digit.

`tests/golden/rank_ranges.json` has them; `python -m tests.evaluator.scoring.test_golden_ranges` records them
again.
"""

import hashlib
import json

import numpy as np
import pytest

from evaluator.scoring.ranges import Quoted, RankRanges, rank_ranges
from tests.services import REPOSITORY

PATH = REPOSITORY / "tests" / "golden" / "rank_ranges.json"
GOLDEN = json.loads(PATH.read_text())


def board(*, n_entries: int, n_recordings: int, n_columns: int, step: float, n_quoted: int) -> RankRanges:
    """The ranges of a made-up board: some entries alike, some without a value, some from papers."""
    rng = np.random.default_rng([n_entries, n_recordings])
    counts = np.ceil(rng.lognormal(3, 1, (n_recordings, n_columns)))
    shared = rng.lognormal(0, 0.5, (n_recordings, n_columns))
    means = 20 + step * np.arange(n_entries)[:, None] + rng.normal(0, 0.2, (n_entries, n_columns))
    noise = rng.normal(0, 4, (n_entries, n_recordings, n_columns))
    sums = (means[:, None] * shared + noise) * counts
    sums[1::17] = sums[::17][: len(sums[1::17])]
    published = np.round(sums.sum(axis=1) / counts.sum(axis=0), 1)
    published[2::13, n_columns - 1] = np.nan
    usable = np.arange(n_columns) != 1
    values = np.round(rng.uniform(18, 24 + step * n_entries, (n_quoted, n_columns)), 1)
    values[:1, 0] = np.nan
    quoted = Quoted(values, np.where(np.isnan(values), np.nan, 0.05), counts) if n_quoted else None
    signs = np.random.default_rng(5)
    return rank_ranges(sums, published=published, usable=usable, rng=signs, quoted=quoted)


def digest(ranges: RankRanges) -> str:
    """Digest of both ends of all ranges."""
    return hashlib.sha256(np.stack([ranges.low, ranges.high]).astype("<i8").tobytes()).hexdigest()


def recorded(case: dict[str, dict[str, int]]) -> dict[str, object]:
    ranges = board(**case["board"])  # type: ignore[arg-type]  # as they are recorded
    first = [ranges.low[:9, 0].tolist(), ranges.high[:9, 0].tolist()]
    return {"board": case["board"], "first": first, "digest": digest(ranges)}


@pytest.mark.slow
@pytest.mark.parametrize("case", GOLDEN, ids=lambda case: case["board"]["n_entries"])
def test_ranges_of_large_boards_are_those_that_were_recorded(case: dict[str, dict[str, int]]) -> None:
    assert recorded(case) == case


if __name__ == "__main__":
    PATH.write_text(json.dumps([recorded(case) for case in GOLDEN], indent=1) + "\n")
