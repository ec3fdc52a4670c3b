"""The matrix products of Pixel MSE are the literal loops, which cut one box after the other."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.tsttc_baselines.literal_pixel_mse import errors_one_by_one, toolkit_errors_one_by_one
from tests.tsttc_baselines.warped_frames import planted
from tsttc_baselines import pixel_mse_toolkit
from tsttc_baselines.boxes import expand
from tsttc_baselines.clips import TARGET, Image
from tsttc_baselines.pixel_mse import Comparison
from tsttc_baselines.scales import scale_bins


@pytest.mark.slow
@settings(max_examples=12)
@given(
    seed=st.integers(0, 1000),
    width=st.floats(8, 150),
    height=st.floats(8, 110),
    scale_ratio=st.floats(0.7, 1.4),
    max_shift=st.integers(0, 3),
    gain=st.floats(0.5, 1.0),
    offset=st.floats(-20, 20),
)
def test_the_matrix_product_is_the_literal_loop(
    seed: int,
    width: float,
    height: float,
    scale_ratio: float,
    max_shift: int,
    gain: float,
    offset: float,
) -> None:
    clip = planted(seed, scale_ratio=scale_ratio, size=(width, height))
    reference: Image = np.clip(clip.grey(0) * gain + offset, 0, 255).astype(np.uint8)
    pair = {"reference_box": expand(clip.boxes[0], 1.1), "target_box": expand(clip.boxes[TARGET], 1.1)}
    scales = scale_bins(frame_gap=5, n_bins=9)
    comparison = Comparison.of(reference, clip.grey(TARGET), max_scale=1.5, max_shift=max_shift, **pair)
    errors = comparison.errors(scales, max_shift=max_shift)
    literal = errors_one_by_one(reference, clip.grey(TARGET), scales=scales, max_shift=max_shift, **pair)
    np.testing.assert_allclose(errors, literal, rtol=1e-4)
    assert np.argmin(errors) == np.argmin(literal)


@pytest.mark.slow
@settings(max_examples=6)
@given(
    seed=st.integers(0, 1000), width=st.floats(8, 150), height=st.floats(8, 110), max_shift=st.integers(0, 3)
)
def test_the_grouped_products_are_the_toolkits_loop(
    seed: int, width: float, height: float, max_shift: int
) -> None:
    clip = planted(seed, scale_ratio=0.9, size=(width, height))
    crops = pixel_mse_toolkit.crops_of(
        clip.colour(0),
        clip.colour(TARGET),
        reference_box=expand(clip.boxes[0], 1.1),
        target_box=expand(clip.boxes[TARGET], 1.1),
        room=1 / 0.65,
        max_shift=max_shift,
    )
    scales = scale_bins(frame_gap=5, n_bins=17)
    errors = pixel_mse_toolkit.errors_of(crops, scales)
    literal = toolkit_errors_one_by_one(crops, scales)
    np.testing.assert_allclose(errors, literal, rtol=1e-4, atol=1e-7)
    assert np.argmin(errors) == np.argmin(literal)
