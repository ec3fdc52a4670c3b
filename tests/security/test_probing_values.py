"""What a submission tells of one value, in a small size; `probing_values.py` prints the whole table."""

import numpy as np
import pytest

from tests.security import probing_values
from tests.security.probing_values import RANGES, WAYS


def error_s(name: str, decimals: probing_values.Decimals, *, n_sequences: int = 3_000) -> float:
    rng = np.random.default_rng(1)
    return probing_values.median_error(
        name, n_sequences=n_sequences, decimals=decimals, n_readouts=300, rng=rng
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", RANGES)
def test_decoder_reads_a_value_where_everything_is_published_and_none_where_nothing_is(name: str) -> None:
    assert error_s(name, {"rte": 2}) < 0.1 * error_s(name, {})
    assert error_s(name, {"mid": 2}) < 0.1 * error_s(name, {})
    assert error_s(name, {"rte": -6}) == pytest.approx(error_s(name, {}), rel=0.05)


@pytest.mark.slow
def test_a_crucial_value_of_a_small_split_is_all_but_published() -> None:
    assert error_s("crucial", WAYS["RTE"]) < 0.1 * error_s("crucial", {})
    assert error_s("crucial", WAYS["RTE"], n_sequences=28_600) > 3 * error_s("crucial", WAYS["RTE"])


@pytest.mark.slow
@pytest.mark.parametrize("name", RANGES)
def test_mid_tells_a_value_as_well_as_rte_so_a_coarser_rte_would_hide_little(name: str) -> None:
    assert error_s(name, WAYS["MiD"]) == pytest.approx(error_s(name, WAYS["RTE"]), rel=0.3, abs=0.02)
    coarse = error_s(name, WAYS["MiD, and RTE in whole per cent"])
    assert coarse < 1.2 * error_s(name, WAYS["MiD"]) + 0.02
    assert coarse < 0.6 * error_s(name, {})
