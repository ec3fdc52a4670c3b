"""Fields of equally good methods, one of them odd, and recordings that come in days."""

from statistics import NormalDist
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tests.error_models import Drawn, Model, odd_field
from tests.validity.fields import Draw

Floats = NDArray[np.float64]
# As unequal as the real test set's recordings, about: log-normal, σ = 0.4.
LENGTHS: Final = np.round(
    [40 * np.exp(0.4 * NormalDist().inv_cdf((i + 0.5) / 10_000)) for i in range(10_000)]
)
# Of the logarithm of a recording's level.
_SIGMA: Final = 0.4


def one_odd(name: str, *, n_methods: int) -> Draw:
    """All methods alike but for the last, which comes to the same mean as the second of `name`'s model."""

    def draw(n_recordings: int, n: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
        return odd_field(name, n_methods, n_recordings, n, rng)

    return draw


def in_days(per_day: int, rho: float, *, n_methods: int) -> Draw:
    """Recordings in days, `per_day` of them one after the other; every method has levels of its own.

    `rho` is the correlation of the logarithms of two levels of one day.
    """

    def draw(n_recordings: int, n: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
        counts = LENGTHS[rng.integers(0, len(LENGTHS), size=(n_recordings, n))]
        n_days = -(-n_recordings // per_day)
        of_day = rng.standard_normal((n_methods, n_days, n)).repeat(per_day, axis=1)[:, :n_recordings]
        own = rng.standard_normal((n_methods, n_recordings, n))
        levels = np.exp(_SIGMA * (rho**0.5 * of_day + (1 - rho) ** 0.5 * own) - _SIGMA**2 / 2)
        return levels * rng.gamma(np.broadcast_to(counts, levels.shape)), counts

    return draw


def dominated(*, n_methods: int, worse: float | None = None) -> Draw:
    """Methods whose errors are 60 times as large in one recording, each in one of its own; all equally good.

    With `worse` that is so of the last method alone, whose other errors are larger by this factor.
    """
    alike = in_days(1, 0.0, n_methods=n_methods)

    def draw(n_recordings: int, n: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
        sums, counts = alike(n_recordings, n, rng)
        if worse is not None:
            sums[-1] *= worse
        for method in range(n_methods) if worse is None else [n_methods - 1]:
            sums[method, rng.integers(0, n_recordings, n), np.arange(n)] *= 60
        return sums, counts

    return draw


def failing_model(*, share: float, times: float) -> Model:
    """Two methods of one mean; in a `share` of recordings the second's error is `times` as large."""
    alike = in_days(1, 0.0, n_methods=2)

    def both(n_recordings: int, n: int, rng: np.random.Generator) -> Drawn:
        (first, second), counts = alike(n_recordings, n, rng)
        fails = rng.random(counts.shape) < share
        return Drawn(counts, first, second * np.where(fails, times, 1.0) / (1 + share * (times - 1)))

    return Model(f"{share:.0%} × {times:g}", "one fails rarely and very badly", lambda: 1.0, both)


def day_model(per_day: int, rho: float) -> Model:
    """Two methods on recordings that come in days."""
    draw = in_days(per_day, rho, n_methods=2)

    def both(n_recordings: int, n: int, rng: np.random.Generator) -> Drawn:
        (first, second), counts = draw(n_recordings, n, rng)
        return Drawn(counts, first, second)

    return Model(f"days of {per_day}", "recordings of one day are alike", lambda: 1.0, both)


def summed(values: Floats, *, per_day: int) -> Floats:
    """Sums of each day, for values (…, recordings, n)."""
    starts = np.arange(0, values.shape[-2], per_day)
    return np.asarray(np.add.reduceat(values, starts, axis=-2))


def by_day(draw: Draw, *, per_day: int) -> Draw:
    """The same field with days as units."""

    def drawn(n_recordings: int, n: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
        sums, counts = draw(n_recordings, n, rng)
        return summed(sums, per_day=per_day), summed(counts, per_day=per_day)

    return drawn
