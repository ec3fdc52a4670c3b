"""The baselines on rendered frames: how long a pair takes without decoding, and how large the errors are.

Everything runs in one thread, and times are the processor's, so that the ratios hold on a busy machine. The
literal loop cuts 125 × 49 boxes; the toolkit's loop resamples 125 times and compares 49 patches of each.
"""

# ruff: noqa: E402 -- libraries read the number of threads when NumPy is imported
import os

for _variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_variable] = "1"

import statistics
import time
from collections.abc import Callable, Sequence

import cv2
import numpy as np

from baselines import pixel_mse_toolkit
from baselines.boxes import expand, shared_expansion
from baselines.clips import TARGET, Clip
from baselines.estimates import Unusable
from baselines.pixel_mse import PixelMse
from baselines.rendering.clips import render
from baselines.scales import scale_bins
from baselines.simulation import split
from benchmarks._simulation import print_rendering, print_scenarios
from evaluator import GroundTruth, Predictions, evaluate, fps_of_gap, scale_ratio_to_ttc
from tests.baselines.literal_pixel_mse import errors_one_by_one, toolkit_errors_one_by_one

SEED = 1
N_SEQUENCES = 320
N_LITERAL = 20
SCALES = scale_bins(frame_gap=5)


def loaded(clip: Clip) -> Clip:
    """The same clip with first and last frame decoded, grey and in colour."""
    frames = {(frame, colour): clip.load(frame, colour) for frame in range(6) for colour in (False, True)}
    return Clip(clip.anno_id, clip.boxes, lambda frame, colour: frames[frame, colour])


def mean_ms(work: Callable[[Clip], object], clips: Sequence[Clip], *, n_times: int = 3) -> float:
    """Processor time a clip: the least of some for each, so that a neighbour's noise is left out."""

    def once(clip: Clip) -> float:
        begun_s = time.process_time()
        work(clip)
        return time.process_time() - begun_s

    return 1e3 * statistics.fmean(min(once(clip) for _ in range(n_times)) for clip in clips)


def pair_of(clip: Clip) -> dict[str, np.ndarray]:
    """The expanded boxes."""
    height, width = clip.grey(TARGET).shape
    ratio = shared_expansion(clip.boxes[0], clip.boxes[TARGET], width_px=width, height_px=height)
    return {"reference_box": expand(clip.boxes[0], ratio), "target_box": expand(clip.boxes[TARGET], ratio)}


def literal(clip: Clip) -> None:
    """The paper's words."""
    errors_one_by_one(clip.grey(0), clip.grey(TARGET), scales=SCALES, max_shift=3, **pair_of(clip))


def toolkits_loop(clip: Clip) -> None:
    """The toolkit's algorithm on a processor."""
    crops = pixel_mse_toolkit.crops_of(
        clip.colour(0), clip.colour(TARGET), room=1 / SCALES[0], max_shift=3, **pair_of(clip)
    )
    toolkit_errors_one_by_one(crops, SCALES)


def print_speed(clips: Sequence[Clip]) -> None:
    """Milliseconds of a pair, and ratios."""
    few = clips[:: len(clips) // N_LITERAL]
    searches = {
        "full": PixelMse(),
        "coarse_to_fine": PixelMse(search="coarse-to-fine"),
        "toolkit_product": PixelMse(variant="toolkit"),
    }
    loops = {"literal_loop": mean_ms(literal, few), "toolkit_loop": mean_ms(toolkits_loop, few)}
    for name, duration_ms in loops.items():
        print(f"baselines.pixel_mse_{name} = {duration_ms:.0f} ms")
    for name, search in searches.items():

        def estimate(clip: Clip, search: PixelMse = search) -> None:
            search(clip, frame_gap=5)

        print(f"baselines.pixel_mse_{name} = {mean_ms(estimate, clips):.2f} ms")
        # A hundred times as short as a loop, a search needs more tries until one is not disturbed.
        same_ms = mean_ms(estimate, few, n_times=20)
        for loop, duration_ms in loops.items():
            print(f"baselines.pixel_mse_{name}_over_{loop} = {duration_ms / same_ms:.0f} times as fast")


def scored(estimator: PixelMse, clips: Sequence[Clip], truth: GroundTruth, *, frame_gap: int = 5) -> str:
    """MiD and RTE over all clips; what cannot be estimated counts as no change of size."""

    def ratio(clip: Clip) -> float:
        try:
            return estimator(clip, frame_gap=frame_gap).scale_ratio
        except Unusable:
            return 1.0

    ttc_s = scale_ratio_to_ttc([ratio(clip) for clip in clips], fps_hz=fps_of_gap(frame_gap))
    means = evaluate(Predictions.from_arrays(ttc_s=ttc_s, manifest=truth.manifest), truth).scores["overall"]
    return f"{means.mid:.1f} MiD, {means.rte:.1f} % RTE"


def print_errors(clips: Sequence[Clip], truth: GroundTruth) -> None:
    """The errors of the variants and ablations on rendered frames."""
    print(f"baselines.pixel_mse_error = {scored(PixelMse(), clips, truth)}")
    fine = PixelMse(search="coarse-to-fine")
    print(f"baselines.pixel_mse_coarse_to_fine_error = {scored(fine, clips, truth)}")
    for shift in (3, 0):
        variant = PixelMse(variant="toolkit", shift=shift)
        print(f"baselines.pixel_mse_toolkit_error_shift_{shift} = {scored(variant, clips, truth)}")
    for shift in range(5):
        print(f"baselines.pixel_mse_error_shift_{shift} = {scored(PixelMse(shift=shift), clips, truth)}")
    for gap in range(1, 6):
        print(f"baselines.pixel_mse_error_gap_{gap} = {scored(PixelMse(), clips, truth, frame_gap=gap)}")
    for bins in (25, 50, 75, 100, 125, 150):
        print(f"baselines.pixel_mse_error_bins_{bins} = {scored(PixelMse(bins=bins), clips, truth)}")


def main() -> None:
    """Measure and print."""
    cv2.setNumThreads(1)
    print_scenarios()
    print_rendering()
    drawn = split(rng=np.random.default_rng(SEED), n_sequences=N_SEQUENCES, n_recordings=8)
    clips = [loaded(render(drawn, anno_id=row, seed=SEED).clip) for row in range(N_SEQUENCES)]
    print_speed(clips)
    print_errors(clips, drawn.truth)
