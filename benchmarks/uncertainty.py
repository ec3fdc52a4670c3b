"""What intervals and rank ranges cost: 200 entries, ten columns, 10,000 resamples, on one core.

The sums per recording are at hand, as they are in a worker's private directory; the weights are drawn within
the time. Rank ranges read their critical values from 2,000 draws, as everywhere.
`python -m benchmarks.uncertainty [N_RECORDINGS …]`.
"""

import os

os.environ["OPENBLAS_NUM_THREADS"] = "1"

import sys
from collections.abc import Sequence

import numpy as np

from benchmarks.evaluator import best_s, figure
from evaluator import SCORE_NAMES
from evaluator.scoring import differences, ranges, uncertainty

N_ENTRIES = 200
N_COLUMNS = 10
DIGEST = "sha256:" + 64 * "0"


def make_sums(n_bags: int, n_entries: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Sums (entries, recordings, columns) and counts (recordings, columns) of entries from 14 to 60."""
    counts = rng.integers(0, 80, (n_bags, N_COLUMNS)).astype(float)
    hardness = rng.normal(0, 4, (1, n_bags, N_COLUMNS))
    level = rng.uniform(14, 60, (n_entries, 1, 1))
    return counts * (level + hardness + rng.normal(0, 2, (n_entries, n_bags, N_COLUMNS))), counts


def main(sizes: Sequence[int] = (100, 300, 700)) -> None:
    """Print one line per figure, `name = value unit`."""
    for n_bags in sizes:
        rng = np.random.default_rng(1)
        sums, counts = make_sums(n_bags, N_ENTRIES, rng)

        def weights(counts: np.ndarray = counts) -> uncertainty.Bootstrap:
            return uncertainty.bootstrap_of(DIGEST, counts)

        bootstrap = weights()

        def intervals(sums: np.ndarray = sums, own: uncertainty.Bootstrap = bootstrap) -> None:
            own.intervals(sums)

        def places(sums: np.ndarray = sums, own: uncertainty.Bootstrap = bootstrap) -> None:
            signs = uncertainty.generator_of(DIGEST, purpose="signs")
            ranges.rank_ranges(sums, published=own.means(sums), usable=own.usable, rng=signs)

        def everything(sums: np.ndarray = sums) -> None:
            own = weights()
            intervals(sums, own)
            places(sums, own)

        def pair(sums: np.ndarray = sums, counts: np.ndarray = counts) -> None:
            signs = uncertainty.generator_of(DIGEST, purpose="signs")
            differences.difference(sums[0], sums[1], counts, names=SCORE_NAMES, signs=signs)

        figure("uncertainty", n_bags, "weights", best_s(weights) * 1e3, "ms")
        figure("uncertainty", n_bags, "intervals_of_200", best_s(intervals), "s")
        figure("uncertainty", n_bags, "rank_ranges_of_200", best_s(places), "s")
        figure("uncertainty", n_bags, "everything_of_200", best_s(everything), "s")
        figure("uncertainty", n_bags, "one_comparison", best_s(pair) * 1e3, "ms")


if __name__ == "__main__":
    main([int(argument) for argument in sys.argv[1:]] or (100, 300, 700))
