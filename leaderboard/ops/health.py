"""Health: what a person has to look at. Each check is bounded in time, writes nothing, and none raises.

Workers write what they find (`faults`, `SweepBeat`); strangers may read the checks, so they name kinds of
faults, and numbers and reasons are for the metrics and the maintainers' page.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any, Final

import structlog
from django.conf import settings
from django.db import Error as DatabaseProblem
from django.db import connections
from django.db.models import F
from django.db.models.functions import Now
from django.db.utils import load_backend
from django.utils import timezone
from kombu import Connection
from kombu.exceptions import KombuError

from leaderboard.models import AuditEvent, Evaluation, Installation, Mail, Status, SweepBeat
from leaderboard.ops import backup_runs, faults

log = structlog.get_logger(__name__)

CHECK_TIMEOUT_S = 2
"""How long one check may take. PostgreSQL's client knows no shorter time for connecting."""
MAX_SWEEP_AGE_S = 60.0
MAX_UNSEALED_AGE_S = 120.0
MAX_MAIL_AGE: Final = timedelta(hours=1)
# An upload that the site refused is of interest until one is accepted, or until nobody has tried for so long.
MAX_REFUSAL_AGE: Final = timedelta(hours=1)
# A submission that waits so long, and files that nobody has looked through for so long, need a person.
MAX_QUEUE_AGE: Final = timedelta(minutes=10)
MAX_CLEAN_AGE: Final = timedelta(days=1)
# So many refused mails in a day are some mistyped addresses; more, and most of all, are a fault.
MAX_REFUSED_MAILS: Final = 5
# Room for so many of the largest prediction files; at 20 files a day some days.
MIN_FREE_FILES: Final = 100
PROBE = "probe"


@dataclass(frozen=True)
class Check:
    """The result of a check. `detail` names no host and no account: strangers may read it."""

    name: str
    is_ok: bool
    detail: str
    is_vital: bool = True  # without it the site cannot do its work


def record_sweep(*, n_out_of_reach: int = 0) -> None:
    """Save the time of a sweep, and how much its worker could not read."""
    SweepBeat.objects.bulk_create(
        [SweepBeat(id=SweepBeat.THE_ONE, swept_at=Now(), n_out_of_reach=n_out_of_reach)],
        update_conflicts=True,
        unique_fields=["id"],
        update_fields=["swept_at", "n_out_of_reach"],
    )


def sweep_age_s(*, using: str = "default") -> float | None:
    """Return the seconds since the last sweep, by the database's clock."""
    age: timedelta | None = (
        SweepBeat.objects.using(using)
        .annotate(age=Now() - F("swept_at"))
        .values_list("age", flat=True)
        .first()
    )
    return None if age is None else age.total_seconds()


def has_recent_sweep() -> bool:
    """Say whether a worker swept within `MAX_SWEEP_AGE_S`."""
    age_s = sweep_age_s()
    return age_s is not None and age_s <= MAX_SWEEP_AGE_S


def checks() -> tuple[Check, ...]:
    """Check everything, within about three times `CHECK_TIMEOUT_S`."""
    return (*_database(), broker())


def database() -> Check:
    """Check a new connection to the database."""
    started_s = time.monotonic()
    try:
        with _own_connection() as alias, connections[alias].cursor() as cursor:
            cursor.execute("SELECT 1")
    except DatabaseProblem as fault:
        log.warning("database_not_ready", reason=str(fault)[:200])
        return Check("database", is_ok=False, detail="does not answer")
    return Check("database", is_ok=True, detail=_answered(started_s))


def n_out_of_reach(*, using: str = "default") -> int:
    """Return how much waited, at the last sweep, for a ground truth that its worker cannot read."""
    return SweepBeat.objects.using(using).values_list("n_out_of_reach", flat=True).first() or 0


def _database() -> tuple[Check, ...]:
    started_s = time.monotonic()
    try:
        with _own_connection() as alias:
            age_s = sweep_age_s(using=alias)
            n_without = n_out_of_reach(using=alias)
            unsealed = AuditEvent.objects.using(alias).unsealed()
            is_of_other = Installation.objects.using(alias).exclude(store_is_of="").exists()
            lasting = _lasting(now=timezone.now(), using=alias)
    except DatabaseProblem as fault:
        log.warning("database_not_ready", reason=str(fault)[:200])
        return (
            Check("database", is_ok=False, detail="does not answer"),
            *(
                Check(name, is_ok=False, detail="unknown: the database does not answer")
                for name in ("sweep", "ground truth", "audit log", "file store owner", *LASTING)
            ),
        )
    return (
        Check("database", is_ok=True, detail=_answered(started_s)),
        _sweep(age_s),
        _ground_truth(n_without),
        _audit(unsealed.oldest_age_s),
        _store_owner(is_of_other),
        *lasting,
    )


LASTING: Final = (
    *("file store", "free space", "uploads", "statistics", "backup", "mail"),
    *("refused mails", "queue", "system errors", "cleaning"),
)


def _lasting(*, now: datetime, using: str) -> tuple[Check, ...]:
    """Check what workers, web processes and backups have written down."""
    return (
        _well("file store", is_ok=can_store(now=now, using=using), fault="files cannot be stored"),
        _well(
            "free space",
            is_ok=has_room(free_bytes(using=using)),
            fault="the file store has little room",
            is_vital=False,
        ),
        _well(
            "uploads",
            is_ok=not refuses_uploads(now=now, using=using),
            fault="an upload was refused because of an error of the site",
        ),
        _well(
            "statistics",
            is_ok=not failing_statistics(now=now, using=using),
            fault="intervals, comparisons or analyses fail again and again",
        ),
        _backup(now=now, using=using),
        _well(
            "mail",
            is_ok=not mails_wait(now=now, using=using),
            fault="mails wait for the mail server, or it takes none",
        ),
        _well(
            "refused mails",
            is_ok=not mails_are_refused(now=now, using=using),
            fault="the mail server refuses most mails",
            is_vital=False,
        ),
        *_work(now=now, using=using),
    )


def _backup(*, now: datetime, using: str) -> Check:
    if backup_runs.is_overdue(now=now, using=using):
        return Check("backup", is_ok=False, detail="the last good backup is old")
    has_failed = backup_runs.failed_since_good(now=now, using=using).exists()
    return _well("backup", is_ok=not has_failed, fault="the last backup is not good", is_vital=False)


def _work(*, now: datetime, using: str) -> tuple[Check, ...]:
    """Check what workers have to do, or could not do."""
    evaluations = Evaluation.objects.using(using)
    waiting = evaluations.filter(status=Status.QUEUED, queued_at__lt=now - MAX_QUEUE_AGE)
    return (
        _well(
            "queue",
            is_ok=not waiting.exists(),
            fault="a submission waits for over ten minutes",
            is_vital=False,
        ),
        _well(
            "system errors",
            is_ok=not evaluations.filter(status=Status.SYSTEM_ERROR).exists(),
            fault="an evaluation that failed waits for a retry by a maintainer",
            is_vital=False,
        ),
        _well(
            "cleaning",
            is_ok=is_cleaned(now=now, using=using),
            fault="unused files are not removed",
            is_vital=False,
        ),
    )


def _well(name: str, *, is_ok: bool, fault: str, is_vital: bool = True) -> Check:
    return Check(name, is_ok=is_ok, detail="no fault known" if is_ok else fault, is_vital=is_vital)


def can_store(*, now: datetime, using: str = "default") -> bool:
    """Say whether the last check of the file store could write; True before the first one."""
    return not faults.present([faults.STORE], now=now, using=using).exists()


def free_bytes(*, using: str = "default") -> int | None:
    """Return the room of the file store as a worker last found it; None if unknown."""
    return SweepBeat.objects.using(using).values_list("store_free_bytes", flat=True).first()


def min_free_bytes() -> int:
    return MIN_FREE_FILES * settings.MAX_PREDICTIONS_BYTES


def has_room(n_bytes: int | None) -> bool:
    """Say whether so much room is enough for some days."""
    return n_bytes is None or n_bytes >= min_free_bytes()


def refuses_uploads(*, now: datetime, using: str = "default") -> bool:
    """Say whether the site refused an upload within `MAX_REFUSAL_AGE`, and has accepted none since."""
    refused = faults.present([faults.UPLOADS], now=now, using=using)
    return refused.filter(last_at__gte=now - MAX_REFUSAL_AGE).exists()


def failing_statistics(*, now: datetime, using: str = "default") -> list[str]:
    """Return the kinds of statistics that fail again and again."""
    rows = faults.present(faults.STATISTICS, now=now, min_times=faults.MIN_TIMES, using=using)
    return sorted(set(rows.values_list("kind", flat=True)))


def mails_wait(*, now: datetime, using: str = "default") -> bool:
    """Say whether mails wait longer than `MAX_MAIL_AGE` for the mail server, which is away or refuses all."""
    if not settings.SENDS_MAIL:
        return False
    long_ago = now - MAX_MAIL_AGE
    waiting = Mail.objects.using(using).filter(ended_at=None)
    # One that the server does not take has a reason of its own, which may be the reason of all.
    takes_nothing = faults.present([faults.MAIL], now=now, using=using).filter(began_at__lt=long_ago)
    return waiting.filter(reason="", queued_at__lt=long_ago).exists() or (
        waiting.exists() and takes_nothing.exists()
    )


def mails_are_refused(*, now: datetime, using: str = "default") -> bool:
    """Say whether more mails were refused or given up in the last day than sent, and more than a few."""
    ended = Mail.objects.using(using).filter(ended_at__gte=now - timedelta(days=1))
    n_sent = ended.filter(is_sent=True).count()
    return ended.filter(is_sent=False).count() > max(n_sent, MAX_REFUSED_MAILS)


def is_cleaned(*, now: datetime, using: str = "default") -> bool:
    """Say whether a worker has looked for unused files within `MAX_CLEAN_AGE`; True before the first try."""
    beat = SweepBeat.objects.using(using).first()
    if beat is None or beat.cleaned_at is None:
        return beat is None or beat.clean_begun_at is None
    return beat.cleaned_at >= now - MAX_CLEAN_AGE


def _ground_truth(n_without: int) -> Check:
    # It does not say how much waits: strangers may read it.
    detail = (
        "a worker cannot read the ground truth of an evaluation that waits"
        if n_without
        else "the workers can read the ground truth of all evaluations that wait"
    )
    return Check("ground truth", is_ok=not n_without, detail=detail)


def _audit(age_s: float) -> Check:
    # An event that was committed late is older than it looks.
    if not age_s:
        return Check("audit log", is_ok=True, detail="sealed", is_vital=False)
    detail = f"an event waits to be sealed for {age_s:.0f} s, expected less than {MAX_UNSEALED_AGE_S:.0f} s"
    return Check("audit log", is_ok=age_s < MAX_UNSEALED_AGE_S, detail=detail, is_vital=False)


def _store_owner(is_of_other: bool) -> Check:
    # After a restore; see `leaderboard.storage.ownership`.
    detail = (
        "the file store belongs to another site, so unused files stay; expected claim_store"
        if is_of_other
        else "the file store belongs to this site, as far as it has looked"
    )
    return Check("file store owner", is_ok=not is_of_other, detail=detail, is_vital=False)


def _sweep(age_s: float | None) -> Check:
    if age_s is None:
        return Check("sweep", is_ok=False, detail="there was none yet")
    detail = f"the last was {age_s:.0f} s ago, expected less than {MAX_SWEEP_AGE_S:.0f} s"
    return Check("sweep", is_ok=age_s < MAX_SWEEP_AGE_S, detail=detail)


def broker() -> Check:
    """Check a new connection to the broker."""
    started_s = time.monotonic()
    options: dict[str, Any] = {
        **settings.CELERY_BROKER_TRANSPORT_OPTIONS,
        "socket_timeout": CHECK_TIMEOUT_S,
        "socket_connect_timeout": CHECK_TIMEOUT_S,
        "retry_on_timeout": False,
        "max_retries": 0,
    }
    try:
        with Connection(
            settings.CELERY_BROKER_URL, connect_timeout=CHECK_TIMEOUT_S, transport_options=options
        ) as connection:
            connection.default_channel  # noqa: B018 - asking for it makes kombu speak to the server
    except (KombuError, OSError) as fault:
        log.warning("broker_not_ready", reason=str(fault)[:200])
        return Check("broker", is_ok=False, detail="does not answer")
    return Check("broker", is_ok=True, detail=_answered(started_s))


def _answered(started_s: float) -> str:
    return f"answered in {(time.monotonic() - started_s) * 1000:.0f} ms"


@contextmanager
def _own_connection() -> Iterator[str]:
    """Yield the alias of a new connection: the request's own may wait for a server that does not answer."""
    configured: dict[str, Any] = {**connections.settings["default"]}
    configured["OPTIONS"] = {**configured.get("OPTIONS", {}), **_limits(configured["ENGINE"])}
    probe = load_backend(configured["ENGINE"]).DatabaseWrapper(configured, PROBE)
    connections[PROBE] = probe
    try:
        yield PROBE
    finally:
        del connections[PROBE]
        if probe.connection is not None:
            probe.connection.close()


def _limits(engine: str) -> dict[str, Any]:
    if "postgresql" not in engine:
        return {"timeout": CHECK_TIMEOUT_S, "init_command": ""}
    milliseconds = CHECK_TIMEOUT_S * 1000
    return {
        "connect_timeout": CHECK_TIMEOUT_S,
        "tcp_user_timeout": milliseconds,
        "options": f"-c statement_timeout={milliseconds} -c lock_timeout={milliseconds}",
    }
