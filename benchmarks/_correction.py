"""Corrections of a made-up ground truth where there are many submissions, for the benchmark `rescoring`.

Import it in a process whose Django is configured.
"""

import random
import time
from collections import defaultdict
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from datetime import timedelta
from functools import wraps
from pathlib import Path
from typing import Any

import numpy as np
from django.utils import timezone

import evaluator
from benchmarks._scaling import processor_s
from benchmarks.evaluator import plain_loop
from evaluator.scoring.scoring import Scorer
from evaluator.truth.csv_tables import Table
from leaderboard.boards.rows import flat_scores
from leaderboard.editions import corrections, ground_truth
from leaderboard.models import Analysis, Edition, Evaluation, Score, Status, Submission
from leaderboard.scoring import lifecycle, worker
from leaderboard.storage import files, truth_values
from tests import crowd

# Each question takes a millisecond of the processors that the workers have.
POLL_S = 0.03
PATIENCE_S = 600.0
REST_S = 0.5


@dataclass(frozen=True)
class Corrected:
    """One correction: how long it took from the call to the last row, and until it was open."""

    edition: Edition
    truth: evaluator.GroundTruth
    open_s: float
    total_s: float
    processor_s: float


def open_split(*, split: str, truth: evaluator.GroundTruth, n: int, directory: Path) -> Edition:
    """The split's first edition, in which `n` submissions have been scored."""
    edition = ground_truth.import_truth(split_name=split, path=_written(truth, directory), now=timezone.now())
    crowd.join(split_name=split, truth=truth, n=n, n_files=0)
    _score_here()
    assert corrections.progress(edition).n_scored == n
    return edition


def perturbed(truth: evaluator.GroundTruth, *, seed: int) -> evaluator.GroundTruth:
    """The same sequences; a tenth of the recordings has times to contact that are a few per cent longer."""
    rng = np.random.default_rng(seed)
    manifest, table = truth.manifest, truth.to_table()
    is_changed = rng.random(manifest.n_recordings) < 0.1
    factors = np.where(is_changed[manifest.recording_index], rng.uniform(1.01, 1.05), 1.0)
    return evaluator.GroundTruth.from_table(
        Table(
            anno_id=table.anno_id,
            bag_stamp=table.bag_stamp,
            cam_id=table.cam_id,
            ts_ns=table.ts_ns,
            track_id=table.track_id,
            ttc_s=(truth.ttc_s * factors).tolist(),
        )
    )


def leave_what_waits_behind() -> None:
    """Keep the workers from what they do behind submissions, which are other benchmarks: to them it was done.

    Intervals, and the analyses of an open split.
    """
    tomorrow = timezone.now() + timedelta(days=1)
    Edition.objects.update(inferred_at=tomorrow)
    scored = Evaluation.objects.filter(
        status=Status.SCORED, analysis=None, edition__published_at__isnull=False
    )
    Analysis.objects.bulk_create(
        [
            Analysis(evaluation_id=pk, content={}, made_at=tomorrow)
            for pk in scored.values_list("pk", flat=True)
        ]
    )


def correct(*, split: str, truth: evaluator.GroundTruth, directory: Path, pids: Sequence[int]) -> Corrected:
    """Open an edition with this ground truth beside the board, and wait until the workers have scored all.

    `pids` are their processes, which are at rest when the clock starts.
    """
    path = _written(truth, directory)
    _await_rest(pids)
    before_s = time.process_time() + sum(map(processor_s, pids))
    # The command that opens an edition begins in a new process, which has read nothing yet.
    truth_values.load.cache_clear()
    started_s = time.perf_counter()
    edition = corrections.open_edition(split_name=split, path=path, now=timezone.now(), actor=None)
    open_s = time.perf_counter() - started_s
    # To ask whether all are decided is no part of it.
    opened_s = time.process_time()
    leave_what_waits_behind()
    undecided = Evaluation.objects.filter(edition=edition, status__in=[Status.QUEUED, Status.RUNNING])
    while undecided.exists():
        if time.perf_counter() - started_s > PATIENCE_S:
            raise TimeoutError(f"{edition} was not scored within {PATIENCE_S:g} s")
        time.sleep(POLL_S)
    total_s = time.perf_counter() - started_s
    used_s = opened_s + sum(map(processor_s, pids)) - before_s
    n = Evaluation.objects.filter(edition=edition, status=Status.SCORED).count()
    assert n == Submission.objects.filter(split=split).count()
    assert Score.objects.filter(evaluation__edition=edition).count() == n * len(evaluator.SCORE_NAMES)
    return Corrected(edition=edition, truth=truth, open_s=open_s, total_s=total_s, processor_s=used_s)


def _await_rest(pids: Sequence[int]) -> None:
    """Wait until the processes have done what waited behind the correction before this one."""
    before_s = -1.0
    while (used_s := sum(map(processor_s, pids))) > before_s:
        before_s = used_s
        time.sleep(REST_S)


def check(corrected: Corrected, *, first: evaluator.GroundTruth, n: int) -> None:
    """The database has the plain loop's numbers for the submissions 0 … n − 1, made from `first`."""
    true_s = dict(zip(corrected.truth.manifest.anno_id.tolist(), corrected.truth.ttc_s.tolist(), strict=True))
    for number in range(n):
        found = Evaluation.objects.get(
            edition=corrected.edition, submission__method__name=crowd.method_name(number)
        )
        expected = plain_loop(crowd.contents(first, number), true_s)
        for name, value in flat_scores(found).items():
            metric, _, interval = name.partition("_")
            mid, rte = expected[interval or "overall"]
            assert value == evaluator.published(
                mid if metric == "mid" else rte, decimals=corrected.edition.decimals
            ), (name, value)


def shares(*, split: str, truth: evaluator.GroundTruth, directory: Path) -> dict[str, float]:
    """Where a worker's time goes, as shares of the whole, measured while this process scores a correction.

    `queue` is claiming, `values` is reading what was kept of the files, `database` is storing the outcomes.
    """
    path = _written(truth, directory)
    corrections.open_edition(split_name=split, path=path, now=timezone.now(), actor=None)
    truth_values.load(truth.digest)
    parts: list[tuple[str, Any, str]] = [
        ("queue", lifecycle, "claim"),
        ("values", files, "load_aligned"),
        ("arithmetic", Scorer, "report"),
        ("arithmetic", worker, "scored"),
        ("database", lifecycle, "finalise_many"),
    ]
    spent_s: defaultdict[str, float] = defaultdict(float)
    with ExitStack() as restored:
        for part, owner, name in parts:
            verb = getattr(owner, name)
            restored.callback(setattr, owner, name, verb)
            setattr(owner, name, _timed(verb, part, spent_s))
        started_s = time.perf_counter()
        _score_here()
        whole_s = time.perf_counter() - started_s
    spent_s["other"] = whole_s - sum(spent_s.values())
    return {part: part_s / whole_s for part, part_s in spent_s.items()}


def _timed(verb: Callable[..., Any], part: str, spent_s: defaultdict[str, float]) -> Callable[..., Any]:
    @wraps(verb)
    def timed(*args: Any, **kwargs: Any) -> Any:
        started_s = time.perf_counter()
        try:
            return verb(*args, **kwargs)
        finally:
            spent_s[part] += time.perf_counter() - started_s

    return timed


def _score_here() -> None:
    while worker.run_next(rng=random.Random(0)):
        pass


def _written(truth: evaluator.GroundTruth, directory: Path) -> Path:
    path = directory / f"{truth.digest[-8:]}.csv"
    path.write_bytes(truth.to_csv())
    return path
