"""How often a page with a few methods of one quality says that the best is significantly better."""

import itertools
from dataclasses import dataclass

import numpy as np

from evaluator import Difference
from evaluator.scoring.differences import sign_flips
from evaluator.scoring.ranges import rank_ranges
from evaluator.scoring.significance import SIGNIFICANT, significant_together
from tests.validity import chunks
from tests.validity.fields import Draw


@dataclass(frozen=True)
class Verdicts:
    """Shares of `n` pages that name a winner: by each pair's own p, and corrected for all pairs."""

    uncorrected: float
    corrected: float
    n: int


def verdicts(
    draw: Draw, *, n_methods: int, n_recordings: int, n: int, n_flips: int, rng: np.random.Generator
) -> Verdicts:
    """Compare all methods of `n` pages; separate rank ranges count as a finding, as on the page."""
    both = list(itertools.combinations(range(n_methods), 2))
    n_uncorrected = n_corrected = 0
    for chunk in chunks(n):
        sums, counts = draw(n_recordings, chunk, rng)
        means = sums.sum(axis=1) / counts.sum(axis=0)
        p = [sign_flips(sums[i] - sums[j], counts, rng=rng, n_flips=n_flips).p for i, j in both]
        usable = np.ones(chunk, dtype=np.bool_)
        ranks = rank_ranges(sums, published=means, usable=usable, rng=rng)
        for page in range(chunk):
            best = int(means[:, page].argmin())
            gaps = [Difference(-1.0, -2.0, -0.1, float(each[page])) for each in p]
            findings = zip(both, gaps, significant_together(gaps), strict=True)
            of_best = [(pair, gap.p, is_apart) for pair, gap, is_apart in findings if best in pair]
            others = [i for i in range(n_methods) if i != best]
            is_separate = (ranks.high[best, page] < ranks.low[others, page]).any()
            n_uncorrected += any(each is not None and each < SIGNIFICANT for _, each, _ in of_best)
            n_corrected += bool(is_separate) or any(is_apart for *_, is_apart in of_best)
    return Verdicts(n_uncorrected / n, n_corrected / n, n)
