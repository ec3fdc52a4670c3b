"""The cost of intervals and rank ranges for a worker: boards of 28,600 sequences in 700 recordings.

Processor time of a worker that has just begun, for a board of which nothing is inferred yet; PostgreSQL's
comes on top. OpenBLAS has one core.
"""

import subprocess
import sys
import time

import numpy as np

from benchmarks import rescoring
from benchmarks._site import QUICK, site

SIZES = (20,) if QUICK else (200, 1_000)


def main() -> None:
    """Print one line per figure, `name = value unit`."""
    for n in SIZES:
        measure(n)


def measure(n: int) -> None:
    """Score n submissions in a site of their own, then infer."""
    # A process of its own, since Django is set up once in each.
    command = f"from benchmarks import inference; inference.infer({n})"
    subprocess.run([sys.executable, "-c", command], check=True)


def infer(n: int) -> None:
    """In a fresh process: print the figure of n entries."""
    with site() as made:
        from django.utils import timezone  # noqa: PLC0415 - Django is configured only now

        from leaderboard.demo.runs import simulate  # noqa: PLC0415
        from leaderboard.statistics import confidence  # noqa: PLC0415
        from leaderboard.storage import truth_values  # noqa: PLC0415

        rescoring.score_first(simulate(rng=np.random.default_rng(1)), made.directory, n=n)
        readable = truth_values.readable_digests()
        (stale,) = confidence.stale(now=timezone.now(), readable_truths=readable)
        started_s = time.process_time()
        assert confidence.infer(stale, now=timezone.now())
        print(f"inference.{n} = {time.process_time() - started_s:.2f} s of a worker", flush=True)
