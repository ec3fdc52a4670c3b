"""Made-up recordings for tests of intervals, differences and rank ranges."""

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from evaluator import GroundTruth, Predictions
from evaluator.scoring.differences import sign_flips
from evaluator.truth.csv_tables import Table

Floats = NDArray[np.float64]
N_BAGS = 40


def world(seed: int, *, n_bags: int = N_BAGS, per_bag: int = 6) -> GroundTruth:
    rng = np.random.default_rng(seed)
    n = n_bags * per_bag
    return GroundTruth.from_table(
        Table(
            anno_id=list(range(n)),
            bag_stamp=[f"{row % n_bags:04d}" for row in range(n)],
            cam_id=["1"] * n,
            ts_ns=[1_000 * row for row in range(n)],
            track_id=["1"] * n,
            ttc_s=(rng.uniform(0.5, 25, n) * rng.choice([1, 1, -1], n)).tolist(),
        )
    )


def predictions(truth: GroundTruth, seed: int, *, noise: float = 0.2) -> Predictions:
    rng = np.random.default_rng(seed)
    values = truth.ttc_s * rng.lognormal(0, noise, truth.n_sequences)
    return Predictions.from_arrays(ttc_s=values, manifest=truth.manifest)


def some_sums(seed: int, *, n_entries: int = 6, step: float = 0.5) -> tuple[Floats, Floats]:
    """Sums (entries, recordings, 1) and counts (recordings, 1) of entries that are ever a little worse."""
    rng = np.random.default_rng(seed)
    counts = rng.integers(1, 30, (N_BAGS, 1)).astype(float)
    errors = 20 + rng.normal(0, 3, (1, N_BAGS, 1)) + rng.normal(0, 1.5, (n_entries, N_BAGS, 1))
    return counts * (errors + step * np.arange(n_entries)[:, None, None]), counts


def sign_flip_p(differences: Floats, *, rng: np.random.Generator, n_flips: int = 9_999) -> Floats:
    """The p of every column of `differences` (recordings, columns), which needs no counts."""
    return sign_flips(differences, np.ones_like(differences), rng=rng, n_flips=n_flips).p


def permutation_p(gaps: Floats, *, n_resamples: int) -> float:
    """The p of one column by scipy's test."""
    test = stats.permutation_test(
        (gaps,),
        lambda x, axis: x.sum(axis=axis),
        permutation_type="samples",
        n_resamples=n_resamples,
        vectorized=True,
        rng=np.random.default_rng(0),
    )
    return float(test.pvalue)
