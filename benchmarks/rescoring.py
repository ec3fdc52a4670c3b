"""What a correction costs: 1,000 submissions of 28,600 sequences scored anew and stored.

Real PostgreSQL, real Redis, and a Celery worker with two processes, as in production. The clock runs from the
call that opens the edition, which reads and checks the new ground truth, to the moment at which the last
submission is decided in the database. What workers make behind submissions, as intervals, cards and analyses,
is not measured here. `extra_memory` is what a worker process has at the peak of a correction beyond what it
had before. `processor` is the time of the workers and of this process, which opens the edition, without
PostgreSQL's; it can be compared even where the machine does something else.

Beside it the dataset's own way over the same work: the plain Python loop of `benchmarks.evaluator` from the
file to the means, measured on twenty of the submissions before each round, and multiplied. Figures are
medians of the rounds.
"""

import os
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

import numpy as np

import evaluator
from benchmarks.evaluator import figure, plain_loop
from leaderboard.demo.runs import simulate
from tests import crowd
from tests.journeys.production import BIN, Site, await_that, running, settings_for
from tests.services import ServiceMissing, throwaway_database, throwaway_redis

if TYPE_CHECKING:
    from benchmarks._correction import Corrected

SIZES = {"test": 1_000, "val": 100}  # submissions of each split
N_IN_THE_LOOP = 20
N_ROUNDS = 3
N_PROCESSES = 2


def main() -> None:
    """Measure, and print one line per figure."""
    try:
        with (
            tempfile.TemporaryDirectory() as folder,
            throwaway_database() as postgres,
            throwaway_redis() as redis,
        ):
            url = "http://127.0.0.1:9"  # nothing is served here
            environment = settings_for(Path(folder), url=url, postgres_url=postgres, redis_url=redis)
            site = Site(url=url, directory=Path(folder), environment=environment)
            site.manage("migrate", "--no-input", "--verbosity=0")
            os.environ.update(environment | {"TSTTC_LOG_LEVEL": "WARNING"})
            _measure(site)
    except ServiceMissing as missing:
        print(f"rescoring is not measured: {missing}")


def _measure(site: Site) -> None:
    import django  # noqa: PLC0415 - its settings are read from the environment, which is known only now

    django.setup()
    from django.db import connection  # noqa: PLC0415

    from benchmarks import _correction  # noqa: PLC0415 - needs Django

    # A ground truth belongs to one split, so each has values of its own; the sequences are the same.
    truth = simulate(rng=np.random.default_rng(1))
    truths = {split: _correction.perturbed(truth, seed=n) for split, n in SIZES.items()}
    for split, n in SIZES.items():
        _correction.open_split(split=split, truth=truths[split], n=n, directory=site.directory)
    rounds: dict[str, list[Corrected]] = {split: [] for split in SIZES}
    contents = [crowd.contents(truths["test"], number) for number in range(N_IN_THE_LOOP)]
    loops_s, extra_mb = [], []
    _correction.leave_what_waits_behind()
    with _worker(site) as pids:
        for number in range(N_ROUNDS):
            loops_s.append(_loop_s(contents, truth))
            for split, own in truths.items():
                new = _correction.perturbed(own, seed=10_000 + number)
                before = [_at_rest(pid) for pid in pids]
                corrected = _correction.correct(split=split, truth=new, directory=site.directory, pids=pids)
                extra_mb += [_memory_mb(pid, "VmHWM") - mb for pid, mb in zip(pids, before, strict=True)]
                rounds[split].append(corrected)
    _correction.check(rounds["test"][-1], first=truths["test"], n=N_IN_THE_LOOP)
    for split, n in SIZES.items():
        new = _correction.perturbed(truths[split], seed=20_000)
        shares = _correction.shares(split=split, truth=new, directory=site.directory)
        _tell(n, rounds[split], loops_s, shares)
    connection.close()
    figure("rescoring", SIZES["test"], "plain_loop", median(loops_s) * 1e3, "ms/submission")
    figure("rescoring", SIZES["test"], "extra_memory_per_worker", max(extra_mb), "MB")
    print(f"rescoring_speedup_1000 = {_speedup(SIZES['test'], rounds['test'], loops_s):.3g} x")


def _tell(n: int, rounds: "Sequence[Corrected]", loops_s: Sequence[float], shares: dict[str, float]) -> None:
    figure("rescoring", n, "open_to_stored", median(one.total_s for one in rounds), "s")
    figure("rescoring", n, "opening", median(one.open_s for one in rounds), "s")
    figure("rescoring", n, "processor", min(one.processor_s for one in rounds) / n * 1e3, "ms/submission")
    figure("rescoring", n, "rate", median(n / one.total_s for one in rounds), "submissions/s")
    figure("rescoring", n, "speedup_over_plain_loop", _speedup(n, rounds, loops_s), "x")
    for part, share in shares.items():
        figure("rescoring", n, f"share_{part}", 100 * share, "%")


def _speedup(n: int, rounds: "Sequence[Corrected]", loops_s: Sequence[float]) -> float:
    """Each round against the loop that ran just before it, since the machine may be busier later."""
    return median(n * loop_s / one.total_s for one, loop_s in zip(rounds, loops_s, strict=True))


@contextmanager
def _worker(site: Site) -> Iterator[list[int]]:
    """A worker as in production; the numbers of its processes."""
    command = (str(BIN / "celery"), "--app=leaderboard", "worker", f"--concurrency={N_PROCESSES}")
    with running(site, "worker", *command, "--without-gossip", "--without-mingle", "--loglevel=info") as main:
        log = site.directory / "worker.log"
        await_that(lambda: "ready" in log.read_text(), what="the worker is ready")
        children = Path(f"/proc/{main.pid}/task/{main.pid}/children")
        yield [int(pid) for pid in children.read_text().split()]


def _at_rest(pid: int) -> float:
    """The memory of a process in MB; its peak is counted from here on."""
    Path(f"/proc/{pid}/clear_refs").write_text("5", encoding="ascii")
    return _memory_mb(pid, "VmRSS")


def _memory_mb(pid: int, name: str) -> float:
    for line in Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith(f"{name}:"):
            return int(line.split()[1]) / 1024
    raise LookupError(f"process {pid} tells no {name}")


def _loop_s(contents: Sequence[bytes], truth: evaluator.GroundTruth) -> float:
    """Seconds of the plain loop for one file, the mean over all."""
    true_s = dict(zip(truth.manifest.anno_id.tolist(), truth.ttc_s.tolist(), strict=True))
    started_s = time.perf_counter()
    for data in contents:
        plain_loop(data, true_s)
    return (time.perf_counter() - started_s) / len(contents)


if __name__ == "__main__":
    main()
