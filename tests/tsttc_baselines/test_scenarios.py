"""The six scripts: how many runs, where their events lie, and that no step is needed to get there."""

from collections import Counter

import numpy as np
import pytest

from tsttc_baselines.scenarios import LANE_WIDTH_M, Run, runs, solve

CENTIMETRE = 0.01


def of_script(number: int) -> list[Run]:
    return [run for run in runs() if run.script == number]


def stepped(run: Run, *, step_s: float) -> tuple[float, float, float]:
    """The end of a run in seconds, the gap and the sideways distance then, by small steps in time."""
    time_s, gap_m, ego, vehicle, sideways_m = 0.0, run.gap_m, run.ego_mps, run.vehicle_mps, 0.0
    brakes = changes = False
    while True:
        brakes = brakes or time_s >= run.brake_after_s or gap_m <= run.brake_gap_m
        changes = changes or gap_m <= run.lane_gap_m
        closing = ego - vehicle
        ego += step_s * (-run.brake_mps2 if brakes else run.ego_mps2)
        vehicle = max(0.0, vehicle + step_s * run.vehicle_mps2)
        gap_m += step_s * (vehicle - ego)
        sideways_m += step_s * run.lateral_mps * changes
        time_s += step_s
        is_over = closing > 0 >= ego - vehicle or sideways_m >= LANE_WIDTH_M or gap_m <= run.end_gap_m
        if is_over:
            return time_s, gap_m, sideways_m


def test_closed_triples_give_3218_runs_and_half_open_ones_2089() -> None:
    assert Counter(run.script for run in runs(closed=True)) == {1: 3, 2: 27, 3: 216, 4: 2, 5: 1584, 6: 1386}
    assert Counter(run.script for run in runs(closed=False)) == {1: 3, 2: 24, 3: 160, 4: 2, 5: 1000, 6: 900}


def test_script_1_has_the_gap_of_its_closed_form_when_ego_brakes() -> None:
    gap_m = solve(of_script(1)).at(np.array([3.0])).gap_m
    np.testing.assert_allclose(gap_m[:, 0], 50 - 3 * 3**2 / 2, atol=CENTIMETRE)


def test_script_1_ends_with_the_smallest_gap_of_its_closed_form() -> None:
    # Braking distances to standstill: (v − 3·3)² / 2·3 are left to the vehicle, v² / 2·4 to ego.
    v = np.array([40, 60, 80]) / 3.6
    expected_m = 36.5 + (v - 9) ** 2 / 6 - v**2 / 8
    np.testing.assert_allclose(solve(of_script(1)).last.gap_m[:, 0], expected_m, atol=CENTIMETRE)
    np.testing.assert_allclose(expected_m, [21.81, 11.57, 3.91], atol=CENTIMETRE)


@pytest.mark.slow
def test_script_4_at_80_km_per_h_ends_in_contact_and_would_end_17_m_beyond() -> None:
    assert solve(of_script(4)).last.gap_m[1, 0] == pytest.approx(0, abs=1e-9)
    through = Run(**{name: getattr(of_script(4)[1], name) for name in Run.__slots__} | {"end_gap_m": -100.0})
    assert solve([through]).last.gap_m[0, 0] == pytest.approx(-17.1, abs=0.05)


def test_script_2_leaves_the_lane_in_the_time_that_its_width_takes() -> None:
    motion = solve(of_script(2))
    finished = motion.last.lateral_m[:, 0] > LANE_WIDTH_M - CENTIMETRE
    contact = motion.last.gap_m[:, 0] < CENTIMETRE
    assert (finished ^ contact).all()
    reached_s = np.array([(run.gap_m - run.lane_gap_m) * 3.6 / 20 for run in of_script(2)])
    np.testing.assert_allclose(motion.end_s[finished], (reached_s + LANE_WIDTH_M / 2)[finished], atol=1e-9)


@pytest.mark.parametrize("script", [5, 6])
def test_scripts_5_and_6_never_come_nearer_than_5_m(script: int) -> None:
    motion = solve(of_script(script))
    gap_m = motion.at(np.linspace(0, 12, 200)).gap_m
    assert np.nanmin(gap_m) >= 5 - 1e-9
    assert np.nanmin(motion.last.gap_m) < 5.2


@pytest.mark.parametrize("script", [1, 2, 3, 4, 5, 6])
def test_small_steps_in_time_come_to_the_same_end(script: int) -> None:
    chosen = of_script(script)[:: max(1, len(of_script(script)) // 6)]
    motion = solve(chosen)
    for number, run in enumerate(chosen):
        end_s, gap_m, _ = stepped(run, step_s=0.002)
        assert motion.end_s[number] == pytest.approx(end_s, abs=0.02)
        assert motion.last.gap_m[number, 0] == pytest.approx(gap_m, abs=0.1)


def test_after_the_end_of_a_run_there_is_nothing() -> None:
    motion = solve(of_script(1))
    after = motion.at(motion.end_s[:, None] + np.array([0.01, 5.0]))
    assert np.isnan(after.gap_m).all()
    assert np.isnan(after.ttc_s).all()
