"""From tracks to sequences: which values, which frames, what is counted."""

import numpy as np
import pytest

from evaluator.metrics.registry import MID
from evaluator.problems import Rejected
from tests.tsttc_baselines.annotation.made_tracks import tracks_of
from tsttc_baselines.annotation.choice import choose
from tsttc_baselines.annotation.pipeline import DEPTHS, Depth, annotate, frame_ttc

N_FRAMES = 12


def steady(n_tracks: int = 1, *, n_frames: int = N_FRAMES, mps: float = -10.0) -> np.ndarray:
    frames = np.arange(n_frames)[:, None]
    return 30.0 + mps * frames / 10 + np.arange(n_tracks) * 0.5


def test_time_to_contact_is_depth_over_velocity_on_both_sides_of_the_vehicle() -> None:
    ahead, behind = steady(), -steady() - 4.0
    for depth_m in (ahead, behind):
        annotated = annotate(tracks_of(depth_m))
        assert annotated.table.ttc_s == pytest.approx([2.5, 1.9])
        assert annotated.table.ts_ns == [500_000_000, 1_100_000_000]
    assert annotate(tracks_of(steady(mps=10.0))).table.ttc_s == pytest.approx([-3.5, -4.1])


def braking(n_tracks: int = 300) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Depth, true velocity and true time to contact while the vehicle in front brakes with 3 m/s²."""
    rng = np.random.default_rng(5)
    time_s = np.arange(30)[:, None] / 10
    start_m, start_mps = rng.uniform(30, 60, n_tracks), rng.uniform(-3, 1, n_tracks)
    true_m = start_m + start_mps * time_s - 1.5 * time_s**2
    mps = start_mps - 3 * time_s
    return true_m + rng.normal(0, 0.05, true_m.shape), mps, -true_m / mps


@pytest.mark.slow
def test_the_choice_by_radar_has_at_most_0_7_of_the_error_of_ten_frames_when_a_vehicle_brakes() -> None:
    depth_m, mps, ttc_s = braking()
    rng = np.random.default_rng(6)
    with_radar = frame_ttc(tracks_of(depth_m, radar_mps=mps + rng.normal(0, 0.1, mps.shape)))
    without = frame_ttc(tracks_of(depth_m))
    late = np.tile(np.arange(30)[:, None] >= 15, (1, depth_m.shape[1])).ravel()
    chosen, alone = (
        MID.errors(frames.ttc_s[late], ttc_s.ravel()[late]).mean() for frames in (with_radar, without)
    )
    assert chosen <= 0.7 * alone
    assert set(without.q.tolist()) == {10}
    assert {"radar", "agree"} <= set(with_radar.choice[late].tolist())


def test_gaps_of_the_radar_leave_the_longest_window_and_are_counted() -> None:
    depth_m, mps, _ = braking(20)
    gaps = mps.copy()
    gaps[17] = np.nan
    annotated = annotate(tracks_of(depth_m, radar_mps=gaps), cut="overlapping")
    at_gap = np.array(annotated.table.ts_ns) == 17 * 10**8
    chosen = annotated.frames.choice[annotated.rows[:, -1]]
    assert set(chosen[at_gap].tolist()) <= {"no-radar", "agree"}
    assert annotated.counts["without_radar"] == 20
    assert annotated.counts["choice_no-radar"] == np.count_nonzero(chosen == "no-radar") > 0


def test_of_windows_that_differ_the_one_nearest_to_the_radar_counts() -> None:
    ttc_s = np.array([[2.0, 2.0, 5.0], [4.0, 4.0, 5.0], [8.0, 8.0, 5.0]])
    index, reason = choose(ttc_s, np.array([3.5, np.nan, 2.0]))
    assert index.tolist() == [1, 2, 2]
    assert reason.tolist() == ["radar", "no-radar", "agree"]


def test_sequences_are_cut_as_the_toolkit_does_or_overlap() -> None:
    tracks = tracks_of(steady(2))
    cut = annotate(tracks)
    assert cut.table.ts_ns == [500_000_000] * 2 + [1_100_000_000] * 2
    overlapping = annotate(tracks, cut="overlapping")
    assert len(overlapping.table.ttc_s) == 2 * 7
    assert overlapping.rows.shape == (14, 6)
    assert (np.diff(tracks.ts_ns[overlapping.rows]) == 100_000_000).all()


def test_truncated_and_small_frames_end_a_sequence_and_still_count_for_the_velocity() -> None:
    tracks = tracks_of(steady())
    tracks.is_truncated[2] = True
    tracks.box_px[3, 2] = 110.0
    tracks.box_px[4] = np.nan
    annotated = annotate(tracks)
    assert annotated.table.ts_ns == [1_000_000_000]
    assert annotated.frames.n_frames[annotated.rows[0, -1]] == 10
    assert [annotated.counts[name] for name in ("truncated", "small_box", "without_box")] == [1, 1, 1]


def test_a_track_that_was_lost_begins_again() -> None:
    tracks = tracks_of(np.vstack([steady(), steady() + 50]))
    tracks.ts_ns[N_FRAMES:] += 5_000_000_000
    annotated = annotate(tracks)
    first_after = annotated.rows[2, -1]
    assert annotated.frames.n_frames[first_after] == 6
    assert annotated.table.ttc_s[2] == pytest.approx(7.5)


def test_what_stands_still_is_counted_and_left_out() -> None:
    annotated = annotate(tracks_of(np.hstack([steady(), np.full((N_FRAMES, 1), 20.0)])))
    assert annotated.counts["standing_still"] == 2
    assert len(annotated.table.ttc_s) == 2


def test_tracks_without_any_sequence_are_a_problem() -> None:
    with pytest.raises(Rejected, match="No sequence remains of 5 observations of 1 vehicles"):
        annotate(tracks_of(steady(n_frames=5)))


@pytest.mark.parametrize(
    ("off_m", "expected"),
    [
        (3.0, {"measured": 2.8, "consensus": 2.5, "checked": 2.5}),
        (0.5, {"measured": 2.55, "consensus": 2.5, "checked": 2.55}),
    ],
    ids=["jump", "acceleration"],
)
def test_a_frame_off_the_line_has_its_depth_as_measured_or_as_the_line_says(
    off_m: float, expected: dict[Depth, float]
) -> None:
    depth_m = steady()
    depth_m[5] += off_m
    ttc_s = {depth: annotate(tracks_of(depth_m), depth=depth).table.ttc_s[0] for depth in DEPTHS}
    assert ttc_s == pytest.approx(expected)
    assert annotate(tracks_of(depth_m)).table.ttc_s[0] == ttc_s["checked"]
