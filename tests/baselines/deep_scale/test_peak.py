"""The estimate from the peak of the similarity: which scale ratio it finds, and when it is used."""

import numpy as np
import pytest

from baselines.deep_scale.estimator import DeepScale
from baselines.deep_scale.peak import top_of
from baselines.deep_scale.weights import read_weights
from baselines.methods import OWN_WEIGHTS
from tests.baselines.scenes import planted


@pytest.mark.parametrize("scale_ratio", [0.7, 1.17])
def test_a_planted_scale_ratio_is_found_to_less_than_half_a_bin(scale_ratio: float) -> None:
    found = DeepScale(decoding="peak")(planted(scale_ratio), frame_gap=5).scale_ratio
    assert found == pytest.approx(scale_ratio, abs=0.022)


def test_the_card_of_weights_says_how_they_are_decoded() -> None:
    assert read_weights(OWN_WEIGHTS).use.decoding == "peak"
    clip = planted(0.9)
    auto, peak, head = (
        DeepScale(decoding=decoding)(clip, frame_gap=5).scale_ratio for decoding in ("auto", "peak", "head")
    )
    assert auto == peak != head


def test_the_top_lies_between_the_places() -> None:
    places = 0.9 + 0.01 * np.arange(9)
    assert top_of(places, -np.square(places - 0.9432)) == pytest.approx(0.9432)
    # At an end there is no parabola, and a top is at most one step away.
    assert top_of(places, places) == places[-1]
    assert abs(top_of(places, np.array([0, 0, 1, 1.5, 1.5001, 1.5, 1.4999, 0, 0])) - places[4]) <= 0.01
