"""What a submission tells of hidden labels, in a small size; `probing.py` prints the whole table."""

import numpy as np

from tests.security import probing

SIZE = {"n_sequences": 28_600, "n_recordings": 100}


def test_one_s_own_pair_told_every_chosen_label_and_tells_nothing_now() -> None:
    found = probing.measured(n_chosen=8, n_readouts=2, **SIZE)
    n_right, bits = zip(*([mean.value for mean in means] for means in found.values()), strict=True)
    means, _, all_before, means_now, bound_now = range(len(probing.WAYS))
    assert n_right[all_before] >= 7.5
    assert bits[all_before] > bits[means]
    assert n_right[means_now] <= n_right[all_before] - 1
    assert bits[means_now] <= bits[all_before] - 6
    assert bits[bound_now] <= bits[all_before] - 3


def test_the_decoder_reads_everything_where_everything_is_told() -> None:
    world = probing.world(n_chosen=6, rng=np.random.default_rng(1), n_sequences=2_000, n_recordings=50)
    assert probing.read(world, decimals=6).n_right == 6
    assert probing.read(world, decimals=-6).bits < 0.01


def test_many_sequences_moved_alike_tell_more_bits_and_name_none() -> None:
    """So the bits of eight or twelve chosen sequences are no bound for a submission."""
    few, many = (
        probing.bits_moved_alike(n_chosen=n, n_sequences=28_600, n_readouts=20).value for n in (100, 1_000)
    )
    assert 12 < few < 16
    assert 19 < many < 23
    nothing = probing.bits_moved_alike(n_chosen=10, n_sequences=28_600, n_readouts=5, decimals=-6)
    assert nothing.value < 0.01
