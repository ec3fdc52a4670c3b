"""How often the detectable difference is found, and how much it varies between sets of recordings."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from evaluator import Difference
from evaluator.scoring import differences
from tests.validity import CHUNK, chunks
from tests.validity.worlds import LENGTHS

Floats = NDArray[np.float64]
Shape = tuple[int, int]

# Differences per sequence of a recording, with mean 0 and variance 1.
SHAPES: Final[dict[str, Callable[[np.random.Generator, Shape], Floats]]] = {
    "normal": lambda rng, shape: rng.standard_normal(shape),
    "Laplace": lambda rng, shape: rng.laplace(scale=0.5**0.5, size=shape),
    "exponential": lambda rng, shape: rng.exponential(size=shape) - 1,
    "exponential, turned": lambda rng, shape: 1 - rng.exponential(size=shape),
}


@dataclass(frozen=True)
class Detectable:
    """The share of `n` repetitions in which the median detectable difference is found.

    `ratio` is that of its 90% quantile to its 10% quantile.
    """

    power: float
    ratio: float
    n: int


def detectable(name: str, *, n_recordings: int, n: int, n_flips: int, rng: np.random.Generator) -> Detectable:
    """Simulate differences of one shape, then the same with the median detectable difference added."""

    def compared(shift: float) -> list[Difference]:
        results: list[Difference] = []
        for chunk in chunks(n):
            counts = LENGTHS[rng.integers(0, len(LENGTHS), size=(n_recordings, chunk))]
            gaps = counts * (SHAPES[name](rng, (n_recordings, chunk)) + shift)
            names = [str(i) for i in range(CHUNK)][:chunk]
            nothing = np.zeros_like(gaps)
            pairs = differences.difference(gaps, nothing, counts, names=names, signs=rng, n_flips=n_flips)
            results += pairs.values()
        return results

    sizes = np.array([each.resolution for each in compared(0.0) if each.resolution is not None])
    low, middle, high = np.quantile(sizes, [0.1, 0.5, 0.9]).tolist()
    n_significant = sum(each.is_significant for each in compared(middle))
    return Detectable(n_significant / n, high / low, n)
