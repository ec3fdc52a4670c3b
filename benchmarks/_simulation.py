"""The driving scripts against a plain loop, and the renderer, in processor time."""

import statistics
import time
from collections.abc import Callable
from functools import partial

import numpy as np

from baselines.rendering.clips import render
from baselines.scenarios import LANE_WIDTH_M, Run, runs, solve
from baselines.simulation import split

STEP_S = 0.001
"""A plain loop comes to the closed forms within about 1 cm with such steps; with 10 ms it misses 9 cm."""
N_STEPPED = 20
N_RENDERED = 200
SEED = 1


def stepped(run: Run) -> list[float]:
    """The gaps of a run at 10 Hz, by small steps in plain Python."""
    gaps_m, time_s, gap_m, ego, vehicle, sideways_m = (
        [run.gap_m],
        0.0,
        run.gap_m,
        run.ego_mps,
        run.vehicle_mps,
        0.0,
    )
    brakes = changes = False
    n_steps = 0
    while True:
        brakes = brakes or time_s >= run.brake_after_s or gap_m <= run.brake_gap_m
        changes = changes or gap_m <= run.lane_gap_m
        closing = ego - vehicle
        ego += STEP_S * (-run.brake_mps2 if brakes else run.ego_mps2)
        vehicle = max(0.0, vehicle + STEP_S * run.vehicle_mps2)
        gap_m += STEP_S * (vehicle - ego)
        sideways_m += STEP_S * run.lateral_mps * changes
        time_s += STEP_S
        n_steps += 1
        if n_steps % 100 == 0:
            gaps_m.append(gap_m)
        if closing > 0 >= ego - vehicle or sideways_m >= LANE_WIDTH_M or gap_m <= run.end_gap_m:
            return gaps_m


def _least_s(work: Callable[[], object], *, n_times: int) -> float:
    """Processor time of the fastest of some times."""

    def once() -> float:
        begun_s = time.process_time()
        work()
        return time.process_time() - begun_s

    return min(once() for _ in range(n_times))


def print_scenarios() -> None:
    """All 3,218 runs at 10 Hz, and the same of a plain loop, which is measured on a part of them."""
    every = runs()
    few = every[:: len(every) // N_STEPPED]

    def solved() -> None:
        motion = solve(every)
        motion.at(np.arange(0, motion.end_s.max(), 0.1))

    solved_s = _least_s(solved, n_times=5)
    loop_s = _least_s(lambda: [stepped(run) for run in few], n_times=3) * len(every) / len(few)
    print(f"baselines.scenarios = {1e3 * solved_s:.0f} ms for {len(every):,} runs")
    print(f"baselines.scenarios_over_plain_loop = {loop_s / solved_s:.0f} times as fast")


def print_rendering() -> None:
    """Milliseconds a sequence, of six frames with encoding, and of the two that most methods look at."""
    drawn = split(rng=np.random.default_rng(SEED), n_sequences=N_RENDERED, n_recordings=8)
    for name, n_frames in (("six_frames", 6), ("two_frames", 2)):

        def draw(row: int, n_frames: int = n_frames) -> None:
            clip = render(drawn, anno_id=row, seed=SEED).clip
            for frame in range(n_frames):
                clip.grey(frame)

        # The first sequences also draw the sceneries, once in a process.
        for row in range(40):
            draw(row)
        mean_s = statistics.fmean(_least_s(partial(draw, row), n_times=2) for row in range(N_RENDERED))
        print(f"baselines.render_{name} = {1e3 * mean_s:.1f} ms a sequence")
