"""The worker: claim an evaluation, read its file in the sandbox, score it, write the outcome."""

import hashlib
import random
import time
import uuid
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import TypeVar

import structlog
from django.conf import settings
from django.db import DataError, IntegrityError, InterfaceError, OperationalError, connection

from evaluator import Rejected, Report, rounded
from evaluator.predictions.plausibility import warnings_of
from evaluator.problems import FileWarning
from evaluator.scoring.results import RecordingSums
from evaluator.scoring.scores import Scorer
from leaderboard.models import Edition, Evaluation, SentFile, Status
from leaderboard.queue import lifecycle
from leaderboard.queue.lifecycle import Lease, LostRace, RunResult, Strike
from leaderboard.sandbox import child, file_values, former_keys
from leaderboard.statistics import disclosure, recording_sums
from leaderboard.storage import truth_values

log = structlog.get_logger(__name__)

T = TypeVar("T")


class TruthDamaged(Exception):
    """The private directory has other values than were imported under this digest."""


# The store, the disk, the private directory or the child's start failed: another try may well succeed.
OUR_FAULTS = (OSError, child.ChildNotReady, TruthDamaged)
# The child died of the file, or our own code failed on it, or the database refused what came of it. Tried
# again in case the machine was to blame, but not often: it would end the same way. Not again where the child
# used up its processor time, which does not depend on what else the machine does.
FAULTS_OF_THE_FILE = (
    child.ChildDied,
    child.LeaseLost,
    ArithmeticError,
    AssertionError,
    AttributeError,
    DataError,
    IntegrityError,
    LookupError,
    MemoryError,
    RuntimeError,
    TypeError,
    ValueError,
)
PAUSES_S = (0.2, 0.4, 0.8, 1.6, 3.2, 5.0, 5.0)
MAX_STORED_PROBLEMS = 100


def run_next(*, rng: random.Random) -> bool:
    """Claim and decide the most urgent submission, or a batch of a re-scoring. False: nothing waits."""
    claimed_s = time.monotonic()
    leases = _claimed()
    if not leases:
        return False
    first = _retry_on_disconnect(lambda: _evaluations(leases[:1]))[0]
    if first.priority == Evaluation.PRIORITY_RESCORE:
        leases = rescore(leases, edition=first.edition)
    waiting = deque(leases)
    while waiting:
        lease = waiting.popleft()
        known = first if lease.evaluation_id == first.pk else None
        run(lease, rng=rng, waiting=waiting, evaluation=known)
        if time.monotonic() - claimed_s > settings.LEASE_S / 2:
            _release(waiting)
    return True


def _claimed() -> list[Lease]:
    # Asked first where a claim is a write even of no row, for which SQLite lets nobody else write.
    if connection.vendor == "sqlite" and not Evaluation.objects.due().exists():
        return []
    return lifecycle.claim(
        lease_s=settings.LEASE_S,
        wall_s=settings.WALL_S,
        in_batches=True,
        readable_truths=truth_values.readable_digests(),
    )


def _release(waiting: deque[Lease]) -> None:
    # A lease of a batch would run out before it is begun.
    if waiting:
        lifecycle.release(tuple(waiting))
        waiting.clear()


def _evaluations(leases: Sequence[Lease]) -> list[Evaluation]:
    ids = [lease.evaluation_id for lease in leases]
    by_id = Evaluation.objects.select_related(
        "submission", "edition__ground_truth", "edition__split"
    ).in_bulk(ids)
    return [by_id[pk] for pk in ids]


def rescore(leases: Sequence[Lease], *, edition: Edition) -> list[Lease]:
    """Score a batch of an edition from the values that were kept when their files were first read.

    Returns the leases whose file must be read again: without such values, or rejected by the protocol.
    """
    sent, warned = _retry_on_disconnect(lambda: _sent(leases, edition))
    try:
        scorer = _scorer(edition)
    except (OSError, TruthDamaged):
        return list(leases)
    outcomes: list[tuple[Lease, RunResult]] = []
    sums: list[tuple[SentFile, RecordingSums | None]] = []
    rest: list[Lease] = []
    for lease in leases:
        file = sent[lease.evaluation_id]
        try:
            predictions = file_values.saved(file, edition)
        except Rejected as rejected:
            # For want of sequences that the file cannot have, which needs no word of the file.
            outcomes.append((lease, rejection(rejected)))
            continue
        except OSError:
            predictions = None
        try:
            if predictions is not None:
                report = scorer.report(predictions, keep_bags=True)
                sums.append((file, report.bags))
                warnings = warned.get(lease.evaluation_id)
                if warnings is None:
                    warnings = warnings_of(predictions)
                outcomes.append((lease, scored(report, edition=edition, warnings=warnings)))
                continue
        except (Rejected, *FAULTS_OF_THE_FILE) as fault:
            # Worded, or struck, when it is read again from the file, alone.
            log.info("not_rescored_in_the_batch", evaluation_id=str(lease.evaluation_id), reason=str(fault))
        rest.append(lease)
    if outcomes:
        _retry_on_disconnect(lambda: lifecycle.finalise_many(outcomes))
    # The board waits for the outcomes, and nobody for the sums: what is missing of them is made anew.
    for file, bags in sums:
        recording_sums.save(edition, file=file, bags=bags)
    log.info("rescored", edition=str(edition), n_scored=len(outcomes), n_to_read=len(rest))
    return rest


def _sent(
    leases: Sequence[Lease], edition: Edition
) -> tuple[dict[uuid.UUID, SentFile], dict[uuid.UUID, list[FileWarning]]]:
    """Return the files of these evaluations, and known warnings: to find them takes longer than to score."""
    evaluation_of: dict[uuid.UUID, uuid.UUID] = {}
    sent: dict[uuid.UUID, SentFile] = {}
    rows = Evaluation.objects.filter(pk__in=[lease.evaluation_id for lease in leases])
    for pk, submission, *digests in rows.values_list(
        "pk", "submission", "submission__digest", "submission__manifest_digest"
    ):
        evaluation_of[submission], sent[pk] = pk, SentFile(*digests)
    before = Evaluation.objects.filter(
        submission__in=evaluation_of,
        status=Status.SCORED,
        edition__ground_truth__manifest_digest=edition.ground_truth.manifest_digest,
    )
    warned = {
        evaluation_of[submission]: [FileWarning(**warning) for warning in warnings]
        for submission, warnings in before.values_list("submission", "report__warnings")
    }
    return sent, warned


def run(
    lease: Lease,
    *,
    rng: random.Random,
    waiting: deque[Lease] | None = None,
    evaluation: Evaluation | None = None,
) -> None:
    """Decide one claimed evaluation; the lease always ends: decided, given back, or lost.

    `waiting` are further leases, handed back if this run takes long. `evaluation` is the row, if it was read
    after the claim. Raises only the loss of the database; the lease then runs out.
    """
    waiting = deque() if waiting is None else waiting
    if evaluation is None:
        evaluation = _retry_on_disconnect(lambda: _evaluations([lease]))[0]
    started_s = time.monotonic()
    # Every line from here on says what it is about, also those of modules that know of no submission.
    with structlog.contextvars.bound_contextvars(
        submission_id=str(evaluation.submission_id),
        evaluation_id=str(lease.evaluation_id),
        attempt=lease.attempt,
    ):
        try:
            outcome = _outcome(
                evaluation,
                heartbeat=Heartbeat(
                    lease, waiting=waiting, lease_s=settings.LEASE_S, wall_s=settings.WALL_S
                ).beat,
            )
            _retry_on_disconnect(lambda: lifecycle.finalise(lease, outcome))
        except LostRace as race:
            log.warning("evaluation_lost", reason=str(race))
        except OUR_FAULTS as fault:
            _fail_attempt(lease, strike=Strike.INFRASTRUCTURE, reason=_in_words(fault), rng=rng)
        except FAULTS_OF_THE_FILE as fault:
            log.warning("evaluation_failed", exc_info=fault)
            is_last = isinstance(fault, child.ChildOutOfTime)
            _fail_attempt(lease, strike=Strike.POISON, reason=_in_words(fault), rng=rng, is_last=is_last)
        else:
            log.info(
                "evaluation_finished",
                status=outcome.status.value,
                duration_s=round(time.monotonic() - started_s, 3),
            )


class Heartbeat:
    """The heartbeat of one run; a lost database is no reason to stop."""

    def __init__(self, lease: Lease, *, waiting: deque[Lease], lease_s: float, wall_s: float) -> None:
        self._lease = lease
        self._waiting = waiting
        self._lease_s = lease_s
        self._ends_s = time.monotonic() + wall_s

    def beat(self) -> bool:
        """Renew the lease. False once another worker has the work, or its time is up."""
        if time.monotonic() >= self._ends_s:
            return False
        try:
            _release(self._waiting)
            return lifecycle.heartbeat(self._lease, lease_s=self._lease_s)
        except (OperationalError, InterfaceError) as fault:
            log.warning("heartbeat_not_sent", reason=str(fault)[:200])
            connection.close()
            return True


def _outcome(evaluation: Evaluation, *, heartbeat: Callable[[], bool]) -> RunResult:
    edition, file = evaluation.edition, evaluation.submission.sent_file
    scorer = _scorer(edition)
    try:
        predictions = file_values.read(file, edition, heartbeat=heartbeat)
        report = scorer.report(predictions, keep_bags=True)
    except Rejected as rejected:
        return rejection(former_keys.explained(rejected, file=file, edition=edition, heartbeat=heartbeat))
    recording_sums.save(edition, file=file, bags=report.bags)
    return scored(report, edition=edition, warnings=warnings_of(predictions))


def _scorer(edition: Edition) -> Scorer:
    try:
        return recording_sums.scorer(edition.ground_truth_id, edition.protocol)
    except Rejected as fault:
        raise TruthDamaged(f"the ground truth {edition.ground_truth_id} cannot be used: {fault}") from fault


def _in_words(fault: Exception) -> str:
    # Our own exceptions are sentences already; a library's needs its name.
    ours = (child.ChildDied, child.ChildNotReady, child.LeaseLost, TruthDamaged)
    return str(fault) if isinstance(fault, ours) else f"{type(fault).__name__}: {fault}"


def scored(report: Report, *, edition: Edition, warnings: Sequence[FileWarning] = ()) -> RunResult:
    """Round a report as its edition publishes it: values, counts, and nothing finer.

    `warnings` come from file and manifest alone: others would tell of hidden values. Of hidden values, no
    metric is kept that would tell more of them, whatever the database says of split and protocol.
    """
    is_hidden = disclosure.is_hidden(edition)
    allowed = {metric.name for metric in disclosure.HIDDEN_METRICS}
    values = {}
    for ttc_range, scores in report.scores.items():
        for metric, value in scores.means.items():
            shown = rounded(value, decimals=edition.decimals)
            is_kept = not is_hidden or metric in allowed
            if shown is not None and is_kept:
                values[metric, ttc_range] = shown
    return RunResult(
        status=Status.SCORED,
        scores=values,
        report={
            "protocol": report.protocol,
            "n_sequences": report.n_sequences,
            "n_out_of_range": report.n_out_of_range,
            "truncated": dict(report.truncated),
            "counts": {ttc_range: scores.count for ttc_range, scores in report.scores.items()},
            "warnings": [asdict(warning) for warning in warnings],
        },
        report_digest=f"sha256:{hashlib.sha256(report.to_json().encode()).hexdigest()}",
    )


def rejection(rejected: Rejected) -> RunResult:
    """Make the outcome for a file that is at fault."""
    problems = [
        {"code": problem.code, "message": problem.message, "where": problem.where}
        for problem in rejected.problems[:MAX_STORED_PROBLEMS]
    ]
    return RunResult(status=Status.REJECTED, scores={}, problems=problems, n_problems=rejected.n_problems)


def _fail_attempt(
    lease: Lease, *, strike: Strike, reason: str, rng: random.Random, is_last: bool = False
) -> None:
    try:
        _retry_on_disconnect(
            lambda: lifecycle.fail_attempt(lease, strike=strike, reason=reason, rng=rng, is_last=is_last)
        )
    except LostRace as race:
        log.warning("evaluation_lost", evaluation_id=str(lease.evaluation_id), reason=str(race))


def _retry_on_disconnect(ask: Callable[[], T]) -> T:
    """Query the database, again after a lost connection: queries and compare-and-set may be repeated."""
    for pause_s in PAUSES_S:
        try:
            return ask()
        except (OperationalError, InterfaceError) as fault:
            log.warning("database_unreachable", reason=str(fault)[:200])
            connection.close()
            # The server is restarting: there is no event to wait for, only its port to try again.
            time.sleep(pause_s)
    return ask()
