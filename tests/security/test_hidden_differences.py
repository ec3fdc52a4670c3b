"""Whether intervals of hidden splits hold the true difference; `hidden_differences.py` prints the table."""

import numpy as np
import pytest

from tests.security import hidden_differences


@pytest.mark.parametrize("power", hidden_differences.POWERS)
@pytest.mark.parametrize("delta", hidden_differences.DELTAS)
def test_published_interval_of_a_small_difference_holds_it(delta: float, power: int) -> None:
    rng = np.random.default_rng([int(1e3 * delta), power])
    figures = hidden_differences.coverage(delta, power=power, n=300, rng=rng)
    assert figures.of_all >= 0.95
    assert not figures.of_significant < 0.95  # NaN where none is
