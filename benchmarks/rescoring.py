"""The cost of a correction: 1,000 submissions of 28,600 sequences scored again and stored.

PostgreSQL, Redis, and a Celery worker with two processes. The clock runs from the call that opens the
edition, which reads and checks the new ground truth, until the last submission is scored in the database.
Beside it the plain Python loop of `benchmarks.evaluator`, measured on twenty of the submissions before each
round, and multiplied. Figures are medians of the rounds; memory is what a worker process has at its peak
beyond what it had before.
"""

import random
import time
from pathlib import Path
from statistics import median

import numpy as np

import evaluator
from benchmarks._site import QUICK, children, leave_intervals, memory_mb, processor_s, site, worker
from benchmarks.evaluator import plain_loop, true_values
from evaluator.truth.csv_tables import Table
from tests import crowd
from tests.journeys.production import await_that

N = 50 if QUICK else 1_000
N_IN_THE_LOOP = 5 if QUICK else 20
N_ROUNDS = 1 if QUICK else 3
REST_S = 0.5


def main() -> None:
    """Print one line per figure, `name = value unit`."""
    with site() as made:
        from leaderboard.demo.runs import simulate  # noqa: PLC0415 - Django is configured only now

        truth = simulate(rng=np.random.default_rng(1))
        score_first(truth, made.directory, n=N)
        leave_intervals()
        contents = [crowd.contents(truth, number) for number in range(N_IN_THE_LOOP)]
        loops_s, rounds_s, extra_mb = [], [], []
        with worker(made, n_processes=2) as pid:
            for number in range(N_ROUNDS):
                loops_s.append(loop_s(contents, truth))
                await_rest(pid)
                before = {child: at_rest_mb(child) for child in children(pid)}
                new = perturbed(truth, seed=10_000 + number)
                rounds_s.append(correct(new, made.directory))
                extra_mb += [memory_mb(child, "VmHWM") - mb for child, mb in before.items()]
                check(truth, new)
        ratios = [N * loop / taken for loop, taken in zip(loops_s, rounds_s, strict=True)]
        print(f"rescoring.open_to_stored = {median(rounds_s):.2f} s for {N:,} submissions")
        print(f"rescoring.over_plain_loop = {median(ratios):.1f} x the plain loop")
        print(f"rescoring.memory = {max(extra_mb):.0f} MB per worker process")


def score_first(truth: evaluator.GroundTruth, directory: Path, *, n: int) -> None:
    """The split's first edition, in which `n` submissions are scored."""
    from django.utils import timezone  # noqa: PLC0415

    from leaderboard.editions import ground_truth  # noqa: PLC0415
    from leaderboard.queue import worker as scoring  # noqa: PLC0415

    ground_truth.import_truth(split_name="test", path=written(truth, directory), now=timezone.now())
    crowd.join(split_name="test", truth=truth, n=n, n_files=0)
    while scoring.run_next(rng=random.Random(0)):
        pass


def correct(truth: evaluator.GroundTruth, directory: Path) -> float:
    """Open an edition with this ground truth, and wait until all are scored; seconds of both."""
    from django.utils import timezone  # noqa: PLC0415

    from leaderboard.editions import corrections  # noqa: PLC0415
    from leaderboard.models import Evaluation, Status  # noqa: PLC0415
    from leaderboard.storage import truth_values  # noqa: PLC0415

    path = written(truth, directory)
    # The command that opens an edition begins in a new process, which has read nothing yet.
    truth_values.load.cache_clear()
    started_s = time.perf_counter()
    edition = corrections.open_edition(split_name="test", path=path, now=timezone.now(), actor=None)
    scored = Evaluation.objects.filter(edition=edition, status=Status.SCORED)
    await_that(lambda: scored.count() == N, what="all are scored", patience_s=300)
    taken_s = time.perf_counter() - started_s
    leave_intervals()
    return taken_s


def check(truth: evaluator.GroundTruth, new: evaluator.GroundTruth) -> None:
    """The database has the plain loop's numbers for the first submission."""
    from leaderboard.boards.rows import flat_scores  # noqa: PLC0415
    from leaderboard.models import Evaluation  # noqa: PLC0415

    expected = plain_loop(crowd.contents(truth, 0), true_values(new))
    mine = Evaluation.objects.filter(submission__method__name=crowd.method_name(0))
    evaluation = mine.latest("edition__number")
    for name, value in flat_scores(evaluation).items():
        metric, _, ttc_range = name.partition("_")
        mid, rte = expected[ttc_range or "overall"]
        decimals = evaluation.edition.decimals
        assert value == evaluator.rounded(mid if metric == "mid" else rte, decimals=decimals), name


def perturbed(truth: evaluator.GroundTruth, *, seed: int) -> evaluator.GroundTruth:
    """The same sequences; a tenth of the recordings has times to contact that are a few per cent longer."""
    rng = np.random.default_rng(seed)
    manifest, table = truth.manifest, truth.to_table()
    is_changed = rng.random(manifest.n_recordings) < 0.1
    factors = np.where(is_changed[manifest.recording_index], rng.uniform(1.01, 1.05), 1.0)
    keys = {name: getattr(table, name) for name in ("anno_id", "bag_stamp", "cam_id", "ts_ns", "track_id")}
    return evaluator.GroundTruth.from_table(Table(**keys, ttc_s=(truth.ttc_s * factors).tolist()))


def written(truth: evaluator.GroundTruth, directory: Path) -> Path:
    """The ground truth as a table."""
    path = directory / f"{truth.digest[-8:]}.csv"
    path.write_bytes(truth.to_csv())
    return path


def await_rest(pid: int) -> None:
    """Wait until the worker has done what waited behind the correction before this one."""
    before_s = -1.0
    while (used_s := processor_s(pid)) > before_s + 0.1 * REST_S:
        before_s = used_s
        time.sleep(REST_S)


def at_rest_mb(pid: int) -> float:
    """The memory of a process in MB; its peak is counted from here on."""
    Path(f"/proc/{pid}/clear_refs").write_text("5", encoding="ascii")
    return memory_mb(pid, "VmRSS")


def loop_s(contents: list[bytes], truth: evaluator.GroundTruth) -> float:
    """Seconds of the plain loop for one file, the mean over all."""
    true_s = true_values(truth)
    started_s = time.perf_counter()
    for data in contents:
        plain_loop(data, true_s)
    return (time.perf_counter() - started_s) / len(contents)
