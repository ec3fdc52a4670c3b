"""`python -m leaderboard.demo.make_runs`: make the demo's runs anew, on frames that are rendered on the way.

The estimates are those of the commands in `leaderboard.demo.runs`; the frames go through memory instead of a
folder, and all methods look at a frame while it is there. An interrupted run continues where it was; after a
change of the code, remove the folder `--work` first.
"""

import argparse
import os
import sys
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from baselines.clips import Clip
from baselines.folders import SequenceFolder
from baselines.images import ImageCache
from baselines.methods import get_method
from baselines.outcomes import SequenceEstimator
from baselines.processes import worked_through
from baselines.rendering.clips import Rendered, boxes, render, view_of
from baselines.simulation import Split
from leaderboard.demo.runs import RUNS, SEED, Floats, Run, demo_split

FRAME_GAP = 5
SAVED_EVERY_S = 30.0

Estimates = tuple[int, list[float], list[str | None]]
"""A row, and for each run the scale ratio and the reason of a fallback."""


@dataclass(frozen=True, eq=False)
class RenderedFolder(SequenceFolder):
    """The folder that `tsttc baseline render` would write, in memory: frames are rendered when asked for."""

    split: Split = field(kw_only=True)
    seed: int = field(kw_only=True)
    _latest: dict[int, Rendered] = field(default_factory=dict, kw_only=True)

    @classmethod
    def of(cls, split: Split, *, seed: int, rows: Sequence[int]) -> "RenderedFolder":
        """The folder of a split; only `rows` have boxes."""
        detected = np.full((split.n_sequences, 6, 4), np.nan)
        for row in rows:
            detected[row] = rendered_boxes(split, row, seed=seed)
        return cls(
            path=Path("frames"),
            images=Path("frames") / "images",
            manifest=split.truth.manifest,
            boxes=detected,
            boxes_from="boxes.csv",
            is_normalised=False,
            split=split,
            seed=seed,
        )

    def clip(self, row: int, *, cache: ImageCache, with_images: bool = True) -> Clip:
        """As of a folder."""
        if row not in self._latest:
            self._latest.clear()
            self._latest[row] = render(self.split, anno_id=row, seed=self.seed)
        return self._latest[row].clip

    def size(self, row: int, *, cache: ImageCache) -> tuple[int, int]:
        """As of a folder."""
        shown = self._latest[row].view
        return shown.width, shown.height


def rendered_boxes(split: Split, row: int, *, seed: int) -> Floats:
    """(6, 4): the boxes that `boxes.csv` has."""
    true_boxes, detected = boxes(split, anno_id=row, seed=seed)
    shown = view_of(true_boxes)
    origin, size = np.array([shown.left, shown.top] * 2), [shown.width, shown.height] * 2
    return np.asarray(np.round(np.clip(detected - origin, 0, size), 2))


class AllRuns:
    """Estimates one sequence after another with every run."""

    def __init__(self, *, folder: RenderedFolder, runs: Sequence[Run]) -> None:
        self._estimators = [
            SequenceEstimator(
                folder=folder,
                method=get_method(run.method),
                parameters=get_method(run.method).filled(run.parameters),
                frame_gap=FRAME_GAP,
            )
            for run in runs
        ]

    def __call__(self, row: int) -> Estimates:
        outcomes = [estimator(row) for estimator in self._estimators]
        return row, [outcome.scale_ratio for outcome in outcomes], [outcome.reason for outcome in outcomes]


def make(runs: Sequence[Run], *, work: Path, n_processes: int) -> None:
    """Estimate the whole split with these runs and keep the files; `work` holds what is done so far."""
    split = demo_split()
    work.mkdir(parents=True, exist_ok=True)
    journals = [work / f"{run.name}.npy" for run in runs]
    done = [np.load(path) if path.exists() else np.full(split.n_sequences, np.nan) for path in journals]
    rows = np.flatnonzero(np.isnan(done).any(axis=0)).tolist()
    if len(rows) < split.n_sequences:
        _say(f"{split.n_sequences - len(rows):,} are done in {work}; remove it to begin anew.")
    folder = RenderedFolder.of(split, seed=SEED, rows=rows)
    reasons: Counter[str] = Counter()
    began_s = saved_s = time.monotonic()
    n_done = 0
    for piece in worked_through(partial(AllRuns, folder=folder, runs=runs), rows, n_processes=n_processes):
        for row, scale_ratios, fallbacks in piece:
            for values, scale_ratio in zip(done, scale_ratios, strict=True):
                values[row] = scale_ratio
            reasons.update(reason for reason in fallbacks if reason)
        n_done += len(piece)
        now_s = time.monotonic()
        if now_s - saved_s > SAVED_EVERY_S or n_done == len(rows):
            saved_s = now_s
            for path, values in zip(journals, done, strict=True):
                np.save(path, values)
            per_s = n_done / (now_s - began_s)
            left_min = (len(rows) - n_done) / per_s / 60 if n_done else float("inf")
            _say(f"{n_done:,} of {len(rows):,}, {per_s:.1f}/s, {left_min:.0f} min left")
    for run, values in zip(runs, done, strict=True):
        run.keep(values)
        _say(f"{run.path.name}: {run.command}")
    for path in journals:
        path.unlink()
    _say(f"Fallbacks: {dict(reasons)}")


def _say(text: str) -> None:
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def main() -> None:
    """Read the command line and make the runs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only", nargs="+", choices=[run.name for run in RUNS], help="these runs alone")
    parser.add_argument("--work", type=Path, default=Path("build/demo-runs"), help="what is done so far")
    chosen = parser.parse_args()
    # Each process does its work with one thread; those of the linear algebra would only wait for one another.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    runs = [run for run in RUNS if not chosen.only or run.name in chosen.only]
    try:
        make(runs, work=chosen.work, n_processes=chosen.jobs)
    except KeyboardInterrupt:
        sys.exit("Interrupted; the same command continues.")


if __name__ == "__main__":
    main()
