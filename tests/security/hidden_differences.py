"""How often the published interval of a hidden split's difference holds the true difference.

    python -m tests.security.hidden_differences          the figures of docs/uncertainty.md, about a minute
    python -m tests.security.hidden_differences 400      with so many repetitions of each row

Two methods differ by δ in truth, on 150 recordings whose differences are symmetric. What a hidden split
publishes of them is made by the board's own functions. δ is small beside the last digit, and the recordings
are so much alike that it is found with a power of 50, 80 or 98 %. `LOW_POWERS` are differences that are
found in few cases.
"""

import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from evaluator import Difference
from evaluator.scoring.differences import rounded_difference, sign_flips

DELTAS: Final = (0.02, 0.05, 0.08, 0.2)
# δ in standard errors, by the power of the test.
POWERS: Final = {50: 1.96, 80: 2.8, 98: 4.0}
LOW_POWERS: Final = {7: 0.3, 17: 1.0}
DECIMALS: Final = 1
N_RECORDINGS: Final = 150
N_SIGN_FLIPS: Final = 1_999
CHUNK: Final = 100


@dataclass(frozen=True)
class Coverage:
    """Shares of the repetitions: how many intervals hold δ, of all and of those shown as significant."""

    of_all: float
    of_significant: float
    significant: float
    n: int


def coverage(delta: float, *, power: int, n: int, rng: np.random.Generator) -> Coverage:
    """Publish `n` differences of two methods that truly differ by `delta`."""
    published = [each for _ in range(0, n, CHUNK) for each in _published(delta, power, rng)][:n]
    holds = np.array([_holds(each, delta) for each in published])
    is_significant = np.array([each.is_significant for each in published])
    of_significant = float(holds[is_significant].mean()) if is_significant.any() else float("nan")
    return Coverage(float(holds.mean()), of_significant, float(is_significant.mean()), n)


def _holds(difference: Difference, delta: float) -> bool:
    assert difference.low is not None
    assert difference.high is not None
    return difference.low <= delta <= difference.high


def _published(delta: float, power: int, rng: np.random.Generator) -> Iterator[Difference]:
    """What is published in as many repetitions as fit into memory."""
    from leaderboard.models import Edition, Split  # noqa: PLC0415 - needs Django's settings
    from leaderboard.statistics import disclosure  # noqa: PLC0415 - likewise

    edition = Edition(split=Split(is_hidden=True), decimals=DECIMALS)
    counts = np.round(40 * rng.lognormal(0, 0.4, (N_RECORDINGS, CHUNK))).clip(1)
    total = counts.sum(axis=0)
    spread = delta / (POWERS | LOW_POWERS)[power] * total / np.sqrt((counts**2).sum(axis=0))
    gaps = counts * (delta + spread * rng.standard_normal(counts.shape))
    flips = sign_flips(gaps, counts, rng=rng, n_flips=N_SIGN_FLIPS)
    # Where a value lies between two that can be published is chance.
    others = rng.uniform(14.0, 15.0, CHUNK)
    means = gaps.sum(axis=0) / total
    for i in range(CHUNK):
        gap = Difference(float(means[i]), float(flips.low[i]), float(flips.high[i]), float(flips.p[i]))
        first, second = float(others[i] + means[i]), float(others[i])
        shown = rounded_difference(gap, first=first, second=second, decimals=DECIMALS)
        yield disclosure.published_difference(gap, shown, edition=edition)


def main(n: int = 4_000) -> None:
    os.environ.setdefault("DJANGO_SETTINGS_MODULE", "leaderboard.settings")
    import django  # noqa: PLC0415 - the settings have to be named first

    django.setup()
    sys.stdout.write(f"{n:,} repetitions of each row\n\n")
    sys.stdout.write("| δ | power | significant | all intervals | those of significant ones |\n")
    sys.stdout.write("|---|---|---|---|---|\n")
    for delta in DELTAS:
        for power in POWERS | LOW_POWERS:
            rng = np.random.default_rng([int(1e3 * delta), power])
            figures = coverage(delta, power=power, n=n, rng=rng)
            shares = (figures.significant, figures.of_all, figures.of_significant)
            cells = " | ".join(f"{100 * share:.1f}" for share in shares)
            sys.stdout.write(f"| {delta} | {power} % | {cells} |\n")
            sys.stdout.flush()


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
