"""Monitoring: liveness, readiness and Prometheus metrics."""

import ipaddress
import secrets
from collections.abc import Callable

import structlog
from django.conf import settings
from django.core.cache import caches
from django.db import Error as DatabaseProblem
from django.http import HttpRequest, HttpResponse, JsonResponse
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_safe
from prometheus_client import CONTENT_TYPE_LATEST

from leaderboard.ops import health, prometheus

log = structlog.get_logger(__name__)

# A proxy adds at least one of these; a client cannot take them away again.
FORWARDED = (
    "HTTP_FORWARDED",
    "HTTP_VIA",
    "HTTP_X_FORWARDED_FOR",
    "HTTP_X_FORWARDED_HOST",
    "HTTP_X_FORWARDED_PROTO",
    "HTTP_X_REAL_IP",
)

# A second: frequent probes cost no more than one.
KEPT_S = 1


@never_cache
@require_safe
def healthz(request: HttpRequest) -> HttpResponse:
    return JsonResponse({"status": "alive"})


@never_cache
@require_safe
def readyz(request: HttpRequest) -> HttpResponse:
    """Tell a load balancer whether the database answers."""
    return _probe_response(lambda: (health.database(),), well="ready")


@never_cache
@require_safe
def healthy(request: HttpRequest) -> HttpResponse:
    """Check database, broker, sweep and its findings; 503 if one fails that needs a person."""
    return _probe_response(health.checks, well="healthy")


@never_cache
@require_safe
def exposition(request: HttpRequest) -> HttpResponse:
    if not may_read_metrics(request):
        return _sentence("Metrics are for the operator's monitoring.", status=403)
    try:
        return HttpResponse(prometheus.exposition(), content_type=CONTENT_TYPE_LATEST)
    except DatabaseProblem as fault:
        log.warning("metrics_unavailable", reason=str(fault)[:200])
        return _sentence("The database does not answer.", status=503)


def _probe_response(ask: Callable[[], tuple[health.Check, ...]], *, well: str) -> JsonResponse:
    checks = caches["views"].get_or_set(f"probe:{well}", ask, KEPT_S) or ()
    is_well = all(check.is_ok for check in checks if check.is_vital)
    return JsonResponse(
        {
            "status": well if is_well else f"not {well}",
            "checks": {check.name: {"ok": check.is_ok, "detail": check.detail} for check in checks},
        },
        status=200 if is_well else 503,
    )


def _sentence(text: str, *, status: int) -> HttpResponse:
    return HttpResponse(f"{text}\n", status=status, content_type="text/plain; charset=utf-8")


def may_read_metrics(request: HttpRequest) -> bool:
    # Without a token, only direct connections from a listed network may.
    if settings.METRICS_TOKEN:
        sent = request.headers.get("Authorization", "").removeprefix("Bearer ").encode()
        return secrets.compare_digest(sent, settings.METRICS_TOKEN.encode())
    if any(header in request.META for header in FORWARDED):
        return False
    try:
        address = ipaddress.ip_address(request.META.get("REMOTE_ADDR", ""))
    except ValueError:
        return False
    return any(address in network for network in settings.METRICS_NETWORKS)
