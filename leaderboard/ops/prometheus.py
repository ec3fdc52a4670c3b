"""Figures for Prometheus, read from the database at each scrape, so they are the same from every process.

Figures of HTTP are a process's own; processes of one gunicorn share `PROMETHEUS_MULTIPROC_DIR`, made by
`deploy/gunicorn.conf.py`.
"""

import math
import os
from collections.abc import Iterable, Iterator, Mapping
from datetime import datetime, timedelta
from functools import partial
from typing import Any, Final

from django.db.models import Count, F, Min, Sum
from django.db.models.functions import Now
from django.utils import timezone
from prometheus_client import CollectorRegistry, Counter, Histogram, disable_created_metrics, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.multiprocess import MultiProcessCollector
from prometheus_client.registry import Collector

from leaderboard.models import AuditEvent, Evaluation, Fault, Mail, Status, SweepBeat
from leaderboard.ops import backup_runs, faults, health

PRIORITIES: Final = {Evaluation.PRIORITY_LIVE: "live", Evaluation.PRIORITY_RESCORE: "rescore"}


def exposition() -> bytes:
    """Return all figures in Prometheus' text format. Raises the database's error."""
    ours = CollectorRegistry(auto_describe=False)
    ours.register(DatabaseCollector())
    return generate_latest(ours) + generate_latest(registry())


class DatabaseCollector(Collector):
    def describe(self) -> Iterable[Metric]:
        # Registering must not ask the database.
        return []

    def collect(self) -> Iterator[Metric]:
        yield from _queue(list(_by_status()))
        yield _gauge(
            "tsttc_last_sweep_age_seconds",
            "Time since the queue was last looked after; +Inf if it never was.",
            {(): _or(health.sweep_age_s(), math.inf)},
        )
        yield from _cleaning()
        yield from _sealing()
        yield from _mails()
        yield from _lasting(now=timezone.now())
        yield from _store()
        yield from _backups(now=timezone.now())
        yield _gauge(
            "tsttc_broker_up", "1 if the broker answers, else 0.", {(): float(health.broker().is_ok)}
        )


# --- the queue and the states ---------------------------------------------------------------------------


def _by_status() -> Iterable[Mapping[str, Any]]:
    return (
        Evaluation.objects.order_by()
        .values("status", "priority")
        .annotate(
            n=Count("pk"),
            n_attempts=Sum("attempt"),
            oldest_age=Now() - Min("queued_at"),
        )
    )


def _queue(rows: list[Mapping[str, Any]]) -> Iterator[Metric]:
    queued = [row for row in rows if row["status"] == Status.QUEUED]
    n_by_status = {status.value: sum(r["n"] for r in rows if r["status"] == status) for status in Status}
    yield _gauge(
        "tsttc_queue_depth",
        "Evaluations that wait for a worker.",
        {
            (name,): sum(row["n"] for row in queued if row["priority"] == priority)
            for priority, name in PRIORITIES.items()
        },
        labels=["priority"],
    )
    yield _gauge(
        "tsttc_queue_oldest_age_seconds",
        "How long the oldest of them has waited since it was queued; 0 if none waits.",
        {(): max((row["oldest_age"].total_seconds() for row in queued), default=0.0)},
    )
    yield _gauge("tsttc_running", "Evaluations that a worker holds.", {(): n_by_status[Status.RUNNING]})
    yield _gauge(
        "tsttc_evaluations",
        "Evaluations by state; SYSTEM_ERROR waits for a retry by a maintainer.",
        {(status,): n for status, n in n_by_status.items()},
        labels=["status"],
    )
    yield _counter("tsttc_runs_started", "Claims by workers.", {(): sum(row["n_attempts"] for row in rows)})
    yield _counter(
        "tsttc_runs_finished",
        "Runs that decided their evaluation; what was started beyond these came to nothing or still runs.",
        {(status.lower(),): n_by_status[status] for status in (Status.SCORED, Status.REJECTED)},
        labels=["outcome"],
    )
    n_strikes = {row.subject: row.n_ever for row in Fault.objects.filter(kind=faults.STRIKES)}
    yield _counter(
        "tsttc_strikes",
        "Runs that came to nothing, by kind.",
        {(kind,): n_strikes.get(kind, 0) for kind in ("poison", "infrastructure")},
        labels=["kind"],
    )


def _cleaning() -> Iterator[Metric]:
    beat = SweepBeat.objects.annotate(age=Now() - F("cleaned_at")).first()
    age = beat.age if beat else None
    yield _gauge(
        "tsttc_last_clean_age_seconds",
        "Time since stored files that no submission names were last looked for; +Inf if they never were.",
        {(): _or(None if age is None else age.total_seconds(), math.inf)},
    )


def _mails() -> Iterator[Metric]:
    waiting = Mail.objects.filter(ended_at=None)
    # What a server puts off for its recipient's sake says nothing of the others.
    oldest = waiting.filter(reason="").aggregate(age=Now() - Min("queued_at"))["age"]
    yield _gauge("tsttc_mails_waiting", "Mails that are not sent yet.", {(): waiting.count()})
    yield _gauge(
        "tsttc_mails_put_off",
        "Those of them that the mail server puts off for their recipient's sake.",
        {(): waiting.exclude(reason="").count()},
    )
    yield _gauge(
        "tsttc_mails_oldest_age_seconds",
        "How long the oldest of the others waits; 0 if none does.",
        {(): oldest.total_seconds() if oldest else 0.0},
    )
    ended = Mail.objects.filter(ended_at__gte=Now() - timedelta(days=1))
    yield _gauge(
        "tsttc_mails_ended_last_day",
        "Mails of the outbox that were sent in the last 24 hours, and those that were refused or discarded.",
        {
            ("sent",): ended.filter(is_sent=True).count(),
            ("unsent",): ended.filter(is_sent=False).count(),
        },
        labels=["outcome"],
    )


def _sealing() -> Iterator[Metric]:
    unsealed = AuditEvent.objects.unsealed()
    yield _gauge("tsttc_audit_unsealed", "Audit events that are in no chain yet.", {(): unsealed.n_events})
    yield _gauge(
        "tsttc_audit_unsealed_age_seconds",
        "How long the oldest of them is there; 0 if there is none.",
        {(): unsealed.oldest_age_s},
    )


# --- faults that last -----------------------------------------------------------------------------------


def _lasting(*, now: datetime) -> Iterator[Metric]:
    n_ever = dict(Fault.objects.order_by().values_list("kind").annotate(Sum("n_ever")))
    present = dict.fromkeys(faults.KINDS, 0.0)
    for row in faults.present(now=now):
        if row.kind not in faults.STATISTICS or row.n_times >= faults.MIN_TIMES:
            began_at = row.began_at or now
            present[row.kind] = max(present[row.kind], (now - began_at).total_seconds())
    yield _counter(
        "tsttc_faults",
        "Failures of the file store, of uploads, of the mail server and of statistics, since the beginning.",
        {(kind,): n_ever.get(kind, 0) for kind in faults.KINDS},
        labels=["kind"],
    )
    yield _gauge(
        "tsttc_fault_age_seconds",
        "How long the fault lasts; 0 if there is none.",
        {(kind,): age_s for kind, age_s in present.items()},
        labels=["kind"],
    )


def _store() -> Iterator[Metric]:
    free_bytes = health.free_bytes()
    yield _gauge(
        "tsttc_store_free_bytes",
        "Room of the file store as a worker last found it; NaN if unknown, as for a bucket.",
        {(): _or(free_bytes, math.nan)},
    )


def _backups(*, now: datetime) -> Iterator[Metric]:
    good = backup_runs.last_good()
    ended_at = good.finished_at if good else None
    yield _gauge(
        "tsttc_last_backup_age_seconds",
        "Time since the last good backup ended; NaN if there is none.",
        {(): math.nan if ended_at is None else (now - ended_at).total_seconds()},
    )
    yield _gauge(
        "tsttc_backups_failed",
        "Backups since the last good one that were not good.",
        {(): backup_runs.failed_since_good(now=now).count()},
    )
    yield _gauge(
        "tsttc_backup_files_lost",
        "Files that the last good backup lacks since they are lost for good, as a maintainer has said.",
        {(): good.n_lost if good else 0},
    )


# --- Prometheus' words ----------------------------------------------------------------------------------


def _family(
    kind: type[GaugeMetricFamily] | type[CounterMetricFamily],
    name: str,
    documentation: str,
    values: dict[tuple[str, ...], float],
    *,
    labels: Iterable[str] = (),
) -> Metric:
    family = kind(name, documentation, labels=list(labels))
    for given, value in values.items():
        family.add_metric(list(given), value)
    return family


_gauge, _counter = partial(_family, GaugeMetricFamily), partial(_family, CounterMetricFamily)


def _or(value: float | None, otherwise: float) -> float:
    return otherwise if value is None else value


# --- how the web processes answer -------------------------------------------------------------------------

SHARED: Final = "PROMETHEUS_MULTIPROC_DIR"
ANSWER_BUCKETS_S: Final = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0)
# A figure for the moment at which each other began would double them, and nothing here asks for it.
disable_created_metrics()
_OWN: Final = CollectorRegistry()
_REQUESTS: Final = Counter(
    "tsttc_http_requests",
    "Answers of the web processes on this machine since they were started.",
    ["method", "route", "status"],
    registry=_OWN,
)
# Without labels: a figure that appears with its first error never rises, and no alarm sees it.
_SERVER_ERRORS: Final = Counter(
    "tsttc_http_server_errors",
    "Answers 5xx of the web processes on this machine since they were started.",
    registry=_OWN,
)
SLOW_S: Final = 1.0
_SLOW_BOARDS: Final = Counter(
    "tsttc_http_slow_boards",
    "Pages of boards that took over a second, of the web processes on this machine since they were started.",
    registry=_OWN,
)
_SECONDS: Final = Histogram(
    "tsttc_http_request_seconds",
    "From the request to the answer; what waits on purpose for a submission is among it.",
    ["route"],
    buckets=ANSWER_BUCKETS_S,
    registry=_OWN,
)
_METHODS: Final = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})


def count(*, method: str, route: str, status: int, took_s: float) -> None:
    """Count one answer. `route` is one of a few names, never an address from a request."""
    method = method if method in _METHODS else "other"
    _REQUESTS.labels(method, route, f"{status // 100}xx").inc()
    _SECONDS.labels(route).observe(took_s)
    if status >= 500:
        _SERVER_ERRORS.inc()
    if route == "board" and took_s > SLOW_S:
        _SLOW_BOARDS.inc()


def registry() -> CollectorRegistry:
    """Return the figures of this process, or of all that share its directory."""
    if not os.environ.get(SHARED):
        return _OWN
    together = CollectorRegistry()
    MultiProcessCollector(together)
    return together
