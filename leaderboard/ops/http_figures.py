"""How the site answers: requests by route and class of status, and how long they took.

Each process counts its own. Processes of one gunicorn share a directory, `PROMETHEUS_MULTIPROC_DIR`, which
`deploy/gunicorn.conf.py` makes, so that a scrape of any of them has the sum.
"""

import os
from typing import Final

from prometheus_client import CollectorRegistry, Counter, Histogram, disable_created_metrics
from prometheus_client.multiprocess import MultiProcessCollector

SHARED: Final = "PROMETHEUS_MULTIPROC_DIR"
BUCKETS_S: Final = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0)
# A figure for the moment at which each other began would double them, and nothing here asks for it.
disable_created_metrics()
_OWN: Final = CollectorRegistry()
_REQUESTS: Final = Counter(
    "tsttc_http_requests",
    "Answers of the web processes on this machine since they were started.",
    ["method", "route", "status"],
    registry=_OWN,
)
_SECONDS: Final = Histogram(
    "tsttc_http_request_seconds",
    "From the request to the answer; what waits on purpose for a submission is among it.",
    ["route"],
    buckets=BUCKETS_S,
    registry=_OWN,
)
_METHODS: Final = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})


def count(*, method: str, route: str, status: int, took_s: float) -> None:
    """Count one answer. `route` is a name out of few, never an address that somebody typed."""
    method = method if method in _METHODS else "other"
    _REQUESTS.labels(method, route, f"{status // 100}xx").inc()
    _SECONDS.labels(route).observe(took_s)


def registry() -> CollectorRegistry:
    """The figures of this process, or of all that share its directory."""
    if not os.environ.get(SHARED):
        return _OWN
    together = CollectorRegistry()
    MultiProcessCollector(together)
    return together
