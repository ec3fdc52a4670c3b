"""What one more submission tells of one hidden value: the time to contact itself, not only its range.

    python -m tests.security.probing_values 4000     the table of docs/hidden-values.md, about a minute
    python -m tests.security.probing_values          with 2,000 readouts of each row

File 0 predicts 0.05 s for one sequence and file 1 predicts 20 s (-0.15 s and -20 s where the object moves
away); all else is equal. A true value between the two moves both errors by an amount that depends on it, and
the published means of its range and of all sequences show that amount to one unit of their last digit. The
decoder weighs every value of a fine grid by how likely it gives what was published, and names the median. It
knows the range, which the means tell first.
"""

import sys
from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from evaluator import rounded

Floats = NDArray[np.float64]

RANGES: Final = {"crucial": (0.0, 3.0), "small": (3.0, 6.0), "large": (6.0, 20.0), "negative": (-20.0, 0.0)}
# As in `probing`: shares of all sequences; the rest is out of range.
SHARES: Final = {"crucial": 0.09, "small": 0.20, "large": 0.43, "negative": 0.264}
# The nearest and the farthest prediction on the side of the truth.
ENDS_S: Final = (0.05, 20.0)
ENDS_OF_NEGATIVE_S: Final = (-0.15, -20.0)
N_GRID: Final = 4_000
# No true value is nearer to 0 than this, of the ranges that touch it.
NEAREST_S: Final = 0.2

Decimals = Mapping[str, int]
# With how many decimals each metric is published; a metric that is absent is not looked at.
WAYS: Final[dict[str, Decimals]] = {
    "its range alone": {},
    "MiD": {"mid": 1},
    "RTE": {"rte": 1},
    "MiD and RTE": {"mid": 1, "rte": 1},
    "MiD, and RTE in whole per cent": {"mid": 1, "rte": 0},
    "both without decimals": {"mid": 0, "rte": 0},
}


def errors(metric: str, predicted_s: float, true_s: Floats) -> Floats:
    """The error of one prediction for each true value."""
    if metric == "rte":
        return np.asarray(100 * np.abs((predicted_s - true_s) / true_s))
    return np.asarray(1e4 * np.abs(_log_ratio(np.asarray(predicted_s)) - _log_ratio(true_s)))


def _log_ratio(time_s: Floats) -> Floats:
    return np.asarray(-np.log1p(1 / (10 * time_s)))


def moved(metric: str, true_s: Floats) -> Floats:
    """By how much file 1 has a larger error than file 0."""
    near, far = ENDS_OF_NEGATIVE_S if np.all(true_s < 0) else ENDS_S
    return errors(metric, far, true_s) - errors(metric, near, true_s)


def draw(name: str, n: int, rng: np.random.Generator) -> Floats:
    """True values of a range, with sizes as log-normal as those of a drive: a median of 9 s."""
    low, high = sorted(np.abs(RANGES[name]))
    drawn = np.empty(0)
    while len(drawn) < n:
        sizes = rng.lognormal(np.log(9), 0.8, 20 * n)
        drawn = np.append(drawn, sizes[(sizes > max(low, NEAREST_S)) & (sizes < high)])
    return drawn[:n] * (-1 if name == "negative" else 1)


def median_error(
    name: str, *, n_sequences: int, decimals: Decimals, n_readouts: int, rng: np.random.Generator
) -> float:
    """The median error, in seconds, of what the decoder names."""
    # Values as common as true ones are, so that a plain weight is their posterior.
    grid = np.sort(draw(name, N_GRID, rng))
    missed = []
    for true_s in draw(name, n_readouts, rng).tolist():
        weights = np.ones(N_GRID)
        for metric, n_decimals in decimals.items():
            amounts, amount = moved(metric, grid), float(moved(metric, np.array(true_s)))
            for n in (SHARES[name] * n_sequences, n_sequences):
                before = rng.uniform(100, 200)
                steps = _published(before + amount / n, n_decimals) - _published(before, n_decimals)
                # Where between two published values the mean lies is chance.
                weights *= np.maximum(0.0, 1 - np.abs(amounts / n - steps) * 10.0**n_decimals)
        total = np.cumsum(weights)
        named = grid[int(np.searchsorted(total, total[-1] / 2))]
        missed.append(abs(named - true_s))
    return float(np.median(missed))


def _published(mean: float, n_decimals: int) -> float:
    shown = rounded(mean, decimals=n_decimals)
    assert shown is not None
    return shown


def main(n_readouts: int = 2_000) -> None:
    for n_sequences in (3_000, 28_600):
        sys.stdout.write(f"\n{n_sequences:,} sequences, {n_readouts:,} readouts, median error in s\n\n")
        sys.stdout.write(f"| told | {' | '.join(RANGES)} |\n|---|{'---|' * len(RANGES)}\n")
        for way, decimals in WAYS.items():
            cells = [
                median_error(
                    name,
                    n_sequences=n_sequences,
                    decimals=decimals,
                    n_readouts=n_readouts,
                    rng=np.random.default_rng([n_sequences, k]),
                )
                for k, name in enumerate(RANGES)
            ]
            sys.stdout.write(f"| {way} | {' | '.join(f'{cell:.2f}' for cell in cells)} |\n")
            sys.stdout.flush()


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
