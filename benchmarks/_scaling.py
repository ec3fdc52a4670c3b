"""The measurement of `benchmarks/scale_out.py`, run in a process that has the site's settings.

120 submissions of 28,600 sequences each, against made-up ground truth, are stored and queued before any
worker is started, not yet due. Each worker then scores a few others, so that what a process reads and starts
once, the ground truth and the server of its readers, is not counted. Then all become due at once, and the
clock runs, by the database, until the last is decided: no file is sent meanwhile. The workers share the
database, the broker and the files, and nothing else, as those on other machines do.

Here PostgreSQL has the same processors as the workers, and this process, which only asks whether all are
decided. So each line says what every party took of them: where their sum is near the number of processors, no
worker more can be of use on this machine.

What waits behind submissions is left out, as in `rescoring`.
"""

import os
import signal
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from datetime import timedelta
from pathlib import Path
from uuid import UUID

import numpy as np
from django.conf import settings
from django.core.files.base import ContentFile
from django.core.management import call_command
from django.db import connection, connections
from django.db.models import Max, Sum
from django.db.models.functions import Now
from django.utils import timezone

import evaluator
from leaderboard.db import clock
from leaderboard.demo.runs import simulate
from leaderboard.editions import ground_truth
from leaderboard.models import Edition, Evaluation, Status, Submission, User
from leaderboard.ops import broker
from leaderboard.submissions import submissions
from tests.journeys.production import BIN, Site, await_that, running

N_WORKERS = (1, 2, 4)
N_SUBMISSIONS, N_TO_WARM = 120, 6
N_SEQUENCES = 28_600
# To write one takes longer than to score it, so files share their values and differ in the blanks at the end.
N_VALUES = 8
SEED = 20230901
PATIENCE_S = 600.0


def main() -> None:
    """Print one line per number of workers."""
    call_command("migrate", verbosity=0)
    truth = simulate(rng=np.random.default_rng(SEED), n_sequences=N_SEQUENCES)
    table = Path(settings.DATA_DIR) / "truth.csv"
    table.write_bytes(truth.to_csv())
    ground_truth.import_truth(split_name="test", path=table, now=timezone.now())
    # Intervals are another benchmark: to the workers, they were computed at a time that is yet to come.
    Edition.objects.update(inferred_at=timezone.now() + timedelta(days=1))
    contents = contents_of(truth)
    try:
        for n in N_WORKERS:
            warm_ids = queue_for_later(contents, name=f"to warm {n}", n=N_TO_WARM * n)
            ids = queue_for_later(contents, name=f"for {n}", n=N_SUBMISSIONS)
            name = f"scale_out_{n}_{'worker' if n == 1 else 'workers'}"
            # What else the machine is doing, without which the rates cannot be read.
            print(f"{name}_load_before = {os.getloadavg()[0]:.1f} processes", flush=True)
            with workers(n) as processes:
                rate(warm_ids)
                before_s = used_by_party(processes)
                per_s = rate(ids)
                used_s = {party: now_s - before_s[party] for party, now_s in used_by_party(processes).items()}
            print(f"{name} = {per_s:.2f} submissions/s", flush=True)
            for party, seconds in used_s.items():
                print(f"{name}_{party} = {seconds / len(ids):.4f} s/submission", flush=True)
            busy = sum(used_s.values()) / len(ids) * per_s
            print(f"{name}_busy = {busy:.2f} of {os.cpu_count()} processors", flush=True)
    finally:
        connections.close_all()


def used_by_party(workers: Sequence[int]) -> dict[str, float]:
    """Processor seconds until now; the workers are children of this process, and not counted with it."""
    return {
        "processor": sum(map(processor_s, workers)),
        "postgres": sum(map(processor_s, database_server())),
        "client": time.process_time(),
    }


def contents_of(truth: evaluator.GroundTruth) -> list[bytes]:
    """A few prediction files."""
    rng = np.random.default_rng(SEED)
    noise = rng.lognormal(0, 0.15, (N_VALUES, truth.n_sequences))
    return [evaluator.write_predictions(manifest=truth.manifest, ttc_s=truth.ttc_s * row) for row in noise]


def queue_for_later(contents: Sequence[bytes], *, name: str, n: int) -> list[UUID]:
    """Send different files while nobody works, none of them due yet; returns their evaluations."""
    user, _ = User.objects.get_or_create(email="scale-out@example.org")
    n_before = Submission.objects.count()
    for i in range(n_before, n_before + n):
        data = contents[i % len(contents)] + b" " * (i // len(contents))
        submissions.submit(
            user=user,
            split_name="test",
            method_name=name,
            upload=ContentFile(data, name=f"{i}.json"),
            via="API",
            now=timezone.now(),
        )
    queued = Evaluation.objects.filter(submission__method__name=name)
    queued.update(due_at=timezone.now() + timedelta(days=1))
    return list(queued.values_list("pk", flat=True))


def rate(ids: Sequence[UUID]) -> float:
    """Let them all become due, wait for the last, and return how many were scored per second."""
    rows = Evaluation.objects.filter(pk__in=ids)
    began_at = clock.database_now()
    rows.update(due_at=Now())
    for _ in ids:
        broker.nudge()
    undecided = rows.filter(status__in=[Status.QUEUED, Status.RUNNING])
    await_that(lambda: not undecided.exists(), what="all are decided", patience_s=PATIENCE_S)
    found = rows.aggregate(last=Max("finished_at"), n_attempts=Sum("attempt"))
    assert rows.filter(status=Status.SCORED).count() == len(ids)
    assert found["n_attempts"] == len(ids), "each was claimed once"
    return len(ids) / float((found["last"] - began_at).total_seconds())


@contextmanager
def workers(n: int) -> Iterator[list[int]]:
    """So many worker processes, all of them up, by their numbers; ended with the context."""
    site = Site(
        url="", directory=Path(settings.DATA_DIR), environment=os.environ | {"TSTTC_LOG_LEVEL": "INFO"}
    )
    command = (str(BIN / "celery"), "--app=leaderboard", "worker", "--concurrency=1")
    names = [f"worker-{n}-{i}" for i in range(n)]
    with ExitStack() as started:
        begun = [
            started.enter_context(
                running(site, name, *command, f"--hostname={name}@%h", "--without-gossip", "--without-mingle")
            )
            for name in names
        ]
        logs = [site.directory / f"{name}.log" for name in names]
        await_that(lambda: all(b" ready." in path.read_bytes() for path in logs), what="the workers are up")
        # Asked to end, each would take 20 s: it has a task in hand, if only to look whether anything waits.
        for worker in begun:
            started.callback(os.killpg, worker.pid, signal.SIGKILL)
        yield [worker.pid for worker in begun]


def database_server() -> list[int]:
    """The process that all of PostgreSQL's are children of; none where it runs on another machine."""
    with connection.cursor() as cursor:
        cursor.execute("SELECT pg_backend_pid()")
        (backend,) = cursor.fetchone()
    folder = Path("/proc", str(backend))
    if not folder.exists() or not (folder / "comm").read_text().startswith("postgres"):
        return []
    return [int((folder / "stat").read_text().rpartition(")")[2].split()[1])]


def processor_s(process: int) -> float:
    """Processor seconds of a process and all that it has started, those that have ended included."""
    folder = Path("/proc", str(process))
    # The fields after the name, which may have spaces in it; times of its own, and of children that ended.
    stat = _text_of(folder / "stat")
    if not stat:
        return 0.0  # It has ended since it was listed; its parent has its time from now on.
    fields = stat.rpartition(")")[2].split()
    own_s = sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")
    # Each thread has children of its own: the one that polls starts another server of readers.
    lists = (folder / "task").glob("*/children")
    children = [child for path in lists for child in _text_of(path).split()]
    return own_s + sum(processor_s(int(child)) for child in children)


def _text_of(path: Path) -> str:
    """What the kernel says of a process or thread; nothing of one that has ended since."""
    try:
        return path.read_text()
    except (FileNotFoundError, ProcessLookupError):
        return ""
