"""What intervals and ranges cost a worker of a real board: 28,600 sequences in 700 recordings, PostgreSQL.

`all` is a board of which nothing is inferred yet, `one_more` the same after one submission more, `one_less`
after one that left, `private` after one that nobody else sees, `pause` the longest that a live submission has
to wait for any of these, and `look` what it costs to see that nothing is to do. Processor time of the worker,
with OpenBLAS on one core; the database's own comes on top.
`python -m benchmarks.inference [N_ENTRIES …]`.
"""

import os

os.environ["OPENBLAS_NUM_THREADS"] = "1"

import itertools
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from datetime import timedelta
from pathlib import Path

import numpy as np

from benchmarks.evaluator import figure
from tests.services import ServiceMissing, throwaway_database

SIZES = (200, 1_000)


def main() -> None:
    """Measure each size in a process and a database of its own."""
    for n in map(int, sys.argv[1:] or SIZES):
        try:
            with tempfile.TemporaryDirectory() as folder, throwaway_database() as postgres:
                environment = os.environ | {
                    "TSTTC_DATABASE_URL": postgres,
                    "TSTTC_DATA_DIR": folder,
                    "TSTTC_LOG_LEVEL": "ERROR",
                }
                command = [sys.executable, "-c", f"from benchmarks import inference as i; i.measure({n})"]
                subprocess.run(command, env=environment, cwd=Path(__file__).parents[1], check=True)
        except ServiceMissing as missing:
            print(f"inference is not measured: {missing}")
            return


def measure(n: int) -> None:
    """In a fresh process whose environment names an empty database: print the figures of n entries."""
    os.environ.setdefault("DJANGO_SETTINGS_MODULE", "leaderboard.settings")
    import django  # noqa: PLC0415 - its settings are read from the environment

    django.setup()
    from django.core.management import call_command  # noqa: PLC0415
    from django.utils import timezone  # noqa: PLC0415

    from benchmarks._correction import open_split  # noqa: PLC0415
    from leaderboard.demo.runs import simulate  # noqa: PLC0415
    from leaderboard.models import Comparison, Method, Score, Submission, Visibility  # noqa: PLC0415
    from leaderboard.scoring import analyses, comparisons, confidence, sandbox  # noqa: PLC0415
    from leaderboard.storage import truth_values  # noqa: PLC0415

    call_command("migrate", "--no-input", "--verbosity=0")
    truth = simulate(rng=np.random.default_rng(1))
    with tempfile.TemporaryDirectory() as folder:
        edition = open_split(split="test", truth=truth, n=n, directory=Path(folder))
    held = truth_values.readable_digests()
    pauses: list[float] = []
    rests = (hours * timedelta(hours=1) for hours in itertools.count(1))

    def infer() -> object:
        # After its rest, which a large board takes between two of these.
        now = timezone.now() + next(rests)
        (stale,) = confidence.stale(now=now, held=held)
        moments = [time.process_time()]
        is_written = confidence.infer(stale, now=now, between=lambda: moments.append(time.process_time()))
        pauses.append(float(np.diff([*moments, time.process_time()]).max()))
        return is_written

    last = Submission.objects.order_by("pk").last()
    assert last is not None
    Submission.objects.filter(pk=last.pk).update(withdrawn_at=timezone.now())
    figure("inference", n, "all", _took_s(infer), "s")
    Submission.objects.filter(pk=last.pk).update(withdrawn_at=None)
    figure("inference", n, "one_more", _took_s(infer), "s")
    Method.objects.filter(pk=last.method_id).update(visibility=Visibility.PRIVATE)
    figure("inference", n, "one_less", _took_s(infer), "s")
    Submission.objects.filter(pk=last.pk).update(withdrawn_at=timezone.now())
    infer()
    Submission.objects.filter(pk=last.pk).update(withdrawn_at=None)
    Score.objects.filter(evaluation__submission=last).update(low=None, high=None)
    figure("inference", n, "private", _took_s(infer), "s")
    figure("inference", n, "pause", max(pauses), "s")
    assert not list(confidence.stale(now=timezone.now() + next(rests), held=held))
    looks = [
        _took_s(lambda: list(confidence.stale(now=timezone.now() + next(rests), held=held)))
        for _ in range(10)
    ]
    figure("inference", n, "look", min(looks) * 1e3, "ms")
    first, second = edition.evaluations.order_by("pk")[:2]
    rows = [Comparison.objects.create(edition=edition, first=first, second=second)]
    figure(
        "inference",
        n,
        "comparison",
        _took_s(lambda: comparisons.compute(rows[0], now=timezone.now())) * 1e3,
        "ms",
    )
    values = sandbox.of(first.submission.sent_file, edition)
    closer = _took_s(lambda: analyses.content_of(values, truth, rules=edition.rules))
    figure("inference", n, "analysis", closer * 1e3, "ms")


def _took_s(action: Callable[[], object]) -> float:
    started_s = time.process_time()
    action()
    return time.process_time() - started_s


if __name__ == "__main__":
    main()
