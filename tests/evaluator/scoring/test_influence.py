"""The number of recordings that a difference rests on, against all ways of leaving some out."""

import itertools

import numpy as np
import pytest

from evaluator import compare_predictions
from evaluator.scoring.differences import influence, sign_flips
from evaluator.scoring.significance import Influence
from evaluator.scoring.uncertainty import degrees_of
from evaluator.tables import sentences
from tests.evaluator.recordings import Floats, predictions, world

N_FLIPS = 499


def fewest(gaps: Floats, counts: Floats, *, seed: int) -> tuple[int | None, int | None]:
    """Try all sets of recordings: the fewest without which p is not small, and the sign turns."""
    total = gaps.sum()
    test_seed = int(np.random.default_rng(seed).integers(2**63 - 1))
    undecided = turned = None
    for n in range(1, len(gaps) + 1):
        for left_out in itertools.combinations(range(len(gaps)), n):
            kept = np.ones(len(gaps))
            kept[list(left_out)] = 0
            if turned is None and (gaps * kept).sum() * np.sign(total) < 0:
                turned = n
            if undecided is None:
                rng = np.random.default_rng(test_seed)
                rest = (gaps * kept)[:, None], (counts * kept)[:, None]
                if sign_flips(*rest, rng=rng, n_flips=N_FLIPS).p[0] >= 0.05:
                    undecided = n
        if undecided is not None and turned is not None:
            break
    return undecided, turned


@pytest.mark.parametrize("seed", range(6))
def test_the_fewest_recordings_are_those_of_trying_everything(seed: int) -> None:
    rng = np.random.default_rng(seed)
    counts = rng.integers(1, 20, 11).astype(float)
    gaps = counts * rng.normal(0.9 if seed % 2 else -0.9, 1.0, 11)
    measured = influence(gaps, counts, rng=np.random.default_rng(seed), n_flips=N_FLIPS)
    undecided, turned = fewest(gaps, counts, seed=seed)
    assert measured.n_units == 11
    assert measured.n_to_turn == turned, "for the sign, no other choice needs fewer"
    if measured.n_to_undecided is None:
        p = sign_flips(gaps[:, None], counts[:, None], rng=np.random.default_rng(1)).p[0]
        left = counts[np.argsort(gaps * np.sign(gaps.sum()))][: 11 - (undecided or 0)]
        assert p > 0.04 or degrees_of(left[:, None])[0] < 8
    else:
        assert undecided is not None
        assert undecided <= measured.n_to_undecided <= undecided + 1, "the order makes an upper bound"


@pytest.mark.parametrize("seed", range(5))
def test_a_difference_stops_being_significant_before_it_turns(seed: int) -> None:
    """Count to an undecided difference; until the other entry is significantly better takes many more."""
    rng = np.random.default_rng(seed)
    gaps = rng.normal(0.3, 1.0, 300)
    measured = influence(gaps, np.ones(300), rng=rng, n_flips=N_FLIPS)
    assert measured.n_to_undecided is not None
    assert measured.n_to_turn is not None
    assert measured.n_to_undecided < measured.n_to_turn < 100
    rest = np.sort(gaps)[: 300 - measured.n_to_undecided]
    p = sign_flips(rest[:, None], np.ones((len(rest), 1)), rng=rng, n_flips=9_999).p[0]
    assert p == pytest.approx(0.05, abs=0.03)


def test_what_is_not_significant_has_a_sign_alone() -> None:
    gaps = np.array([3.0, -1, -1, -0.5] + [0.1, -0.1] * 8)
    measured = influence(gaps, np.ones(20), rng=np.random.default_rng(0), n_flips=N_FLIPS)
    assert measured == Influence(n_units=20, n_to_undecided=None, n_to_turn=1)


def test_two_files_are_compared_with_what_their_difference_rests_on() -> None:
    truth = world(3)
    near, far = predictions(truth, 1, noise=0.2), predictions(truth, 2, noise=0.3)
    differences = compare_predictions(near, far, truth)
    (known,) = (gap.influence for name, gap in differences.items() if name == "mid")
    assert known is not None
    assert known.n_units == 40
    assert 0 < (known.n_to_undecided or 0) <= (known.n_to_turn or 41)
    assert all(gap.influence is None for name, gap in differences.items() if name != "mid")
    turned = compare_predictions(far, near, truth)["mid"]
    assert turned.influence == known
    assert differences["mid"].turned().influence == known
    assert "recordings that most favour near are left out" in sentences.influence(
        "near", "far", difference=differences["mid"]
    )
    assert "recordings that most favour near are left out" in sentences.influence(
        "far", "near", difference=turned
    )


def test_no_number_leaves_fewer_units_than_a_test_needs() -> None:
    """Of nine units, leaving out four leaves five: there no p is below 5%, whatever the values are."""
    differences, counts = np.full(9, -1.0), np.ones(9)
    rests_on = influence(differences, counts, rng=np.random.default_rng(0))
    assert rests_on.n_to_undecided is None


def test_a_turn_says_whether_the_other_is_then_significantly_better() -> None:
    rng = np.random.default_rng(1)
    differences = np.concatenate([rng.normal(1.0, 0.5, 58), [-60.0, -60.0]])
    rests_on = influence(differences, np.ones(60), rng=np.random.default_rng(0))
    assert (rests_on.n_to_turn, rests_on.is_turn_significant) == (2, True)
    few = np.concatenate([rng.normal(0.05, 1.0, 58), [-20.0, -20.0]])
    assert not influence(few, np.ones(60), rng=np.random.default_rng(0)).is_turn_significant
