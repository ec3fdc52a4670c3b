"""Time to contact, scale ratio, and the rates between them."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evaluator.metrics.scale import (
    convert_rate,
    fps_of_gap,
    scale_ratio_10hz,
    scale_ratio_to_ttc,
    ttc_to_scale_ratio,
)

rates = st.sampled_from([2.0, 2.5, 10 / 3, 5.0, 10.0])
# At f·τ in (-1, 0] the object would have passed the observer between the frames: no positive scale ratio says
# so.
times = st.floats(0.05, 1e3) | st.floats(-1e3, -0.6)


def test_frame_gaps_are_the_rates_of_ten_hertz_video() -> None:
    assert fps_of_gap([1, 2, 3, 4, 5]).tolist() == [10.0, 5.0, 10 / 3, 2.5, 2.0]


@pytest.mark.slow
@given(ttc_s=times, fps_hz=rates)
def test_scale_ratio_and_ttc_are_inverse(ttc_s: float, fps_hz: float) -> None:
    ratio = ttc_to_scale_ratio(ttc_s, fps_hz=fps_hz)
    assert float(scale_ratio_to_ttc(ratio, fps_hz=fps_hz)) == pytest.approx(ttc_s, rel=1e-9)


@pytest.mark.slow
@given(ttc_s=times.filter(lambda t: abs(t) < 200), from_fps_hz=rates, to_fps_hz=rates)
def test_the_rate_changes_the_ratio_but_not_the_time(
    ttc_s: float, from_fps_hz: float, to_fps_hz: float
) -> None:
    ratio = ttc_to_scale_ratio(ttc_s, fps_hz=from_fps_hz)
    converted = convert_rate(ratio, from_fps_hz=from_fps_hz, to_fps_hz=to_fps_hz)
    assert float(converted) == pytest.approx(float(ttc_to_scale_ratio(ttc_s, fps_hz=to_fps_hz)), rel=1e-9)
    assert float(scale_ratio_to_ttc(converted, fps_hz=to_fps_hz)) == pytest.approx(ttc_s, rel=1e-9)


def test_a_size_that_stays_never_makes_contact() -> None:
    assert float(scale_ratio_to_ttc(1.0, fps_hz=2)) == math.inf
    assert float(ttc_to_scale_ratio(math.inf, fps_hz=2)) == 1.0
    assert float(ttc_to_scale_ratio(-math.inf, fps_hz=2)) == 1.0


@given(ttc_s=times)
def test_the_ratio_inside_mid_is_the_ten_hertz_ratio_up_to_its_epsilon(ttc_s: float) -> None:
    with_epsilon = float(scale_ratio_10hz(ttc_s))
    assert with_epsilon == 1 / ((1 / (ttc_s * 10) + 1) + 1e-6)
    assert with_epsilon == pytest.approx(float(ttc_to_scale_ratio(ttc_s, fps_hz=10)), rel=3e-6)


def test_the_frame_gap_stands_for_its_rate_and_one_of_both_is_needed() -> None:
    for convert in (scale_ratio_to_ttc, ttc_to_scale_ratio):
        assert convert(0.8, frame_gap=2) == convert(0.8, fps_hz=5)
        with pytest.raises(TypeError, match="found neither"):
            convert(0.8)
        with pytest.raises(TypeError, match="found both"):
            convert(0.8, fps_hz=5, frame_gap=2)
