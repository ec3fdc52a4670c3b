"""What a submission tells of hidden labels, in a small size; `probing.py` prints the whole table."""

import numpy as np
import pytest

from tests.security import probing

SIZE = {"n_sequences": 28_600, "n_recordings": 100}


@pytest.mark.slow
@pytest.mark.parametrize("base", probing.BASES, ids=lambda base: base.name.partition(":")[0])
def test_a_decimal_less_tells_less_of_the_chosen_labels(base: probing.Base) -> None:
    means_by_way = probing.measured(n_chosen=8, n_readouts=2, base=base, **SIZE)
    n_right, bits = zip(*([mean.value for mean in means] for means in means_by_way.values()), strict=True)
    fine, published, with_warnings, bound, bound_beside_many, bound_with_warnings = range(len(probing.WAYS))
    assert n_right[published] <= n_right[fine]
    assert bits[published] <= bits[fine] - 3
    assert bits[published] <= bits[bound] <= bits[bound_beside_many]
    assert bits[bound] <= bits[fine]
    # Why no hidden split has the warning error.
    assert bits[published] < bits[with_warnings] <= bits[bound_with_warnings]
    assert bits[bound] < bits[bound_with_warnings]


def test_the_decoder_reads_everything_where_everything_is_published() -> None:
    world = probing.world(n_chosen=6, rng=np.random.default_rng(1), n_sequences=2_000, n_recordings=50)
    assert probing.read(world, decimals=6).n_right == 6
    assert probing.read(world, decimals=-6).bits < 0.01
