"""Health: database and broker answer, sweeps run. Each check is bounded in time, and none raises."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import timedelta
from typing import Any

import structlog
from django.conf import settings
from django.db import Error as DatabaseProblem
from django.db import connections
from django.db.models import F
from django.db.models.functions import Now
from django.db.utils import load_backend
from kombu import Connection
from kombu.exceptions import KombuError

from leaderboard.models import AuditEvent, Installation, SweepBeat

log = structlog.get_logger(__name__)

CHECK_TIMEOUT_S = 2
"""How long one check may take. PostgreSQL's client knows no shorter time for connecting."""
MAX_SWEEP_AGE_S = 60.0
MAX_UNSEALED_AGE_S = 120.0
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
    """Check database, sweep and broker, within about three times `CHECK_TIMEOUT_S`."""
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
    except DatabaseProblem as fault:
        log.warning("database_not_ready", reason=str(fault)[:200])
        return (
            Check("database", is_ok=False, detail="does not answer"),
            *(
                Check(name, is_ok=False, detail="unknown: the database does not answer")
                for name in ("sweep", "ground truth", "audit log", "file store owner")
            ),
        )
    return (
        Check("database", is_ok=True, detail=_answered(started_s)),
        _sweep(age_s),
        _ground_truth(n_without),
        _audit(unsealed.oldest_age_s),
        _store_owner(is_of_other),
    )


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
