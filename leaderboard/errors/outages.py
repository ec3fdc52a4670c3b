"""Outages: the words for a database or file store that does not answer, the same on pages and in the API."""

import errno
from dataclasses import dataclass
from typing import Any, Final

import structlog
from django.db import InterfaceError, OperationalError

from leaderboard.ops import downloads
from leaderboard.storage.files import FULL, StoreUnavailable

log = structlog.get_logger(__name__)

MARK: Final = "tsttc.outage"
"""Where a request's `META` has the code of the outage that answered it."""
# What a disk says that is read-only, broken, or of another owner; also that of unfinished uploads.
BROKEN = frozenset({errno.EIO, errno.ESTALE, errno.EROFS, errno.EACCES, errno.EPERM})
POSTGRESQL_DISK_FULL = "53100"


@dataclass(frozen=True)
class Outage:
    """An HTTP answer; `code` is stable, `retry_after_s` is a guess."""

    status: int
    code: str
    title: str
    sentence: str
    retry_after_s: int

    @property
    def headers(self) -> dict[str, str]:
        return {"Retry-After": str(self.retry_after_s)}


DATABASE_AWAY = Outage(
    status=503,
    code="database-unavailable",
    title="The leaderboard is not available",
    sentence="The database does not answer at the moment. Try again in a few minutes. If you were submitting "
    "a file, submit it again then: the same file never counts twice.",
    retry_after_s=5,
)
STORE_AWAY = Outage(
    status=503,
    code="store-unavailable",
    title="The file store is not available",
    sentence="The file store does not answer at the moment. Nothing was stored or changed. This is an error "
    "on our side; please try again later.",
    retry_after_s=30,
)
STORAGE_FULL = Outage(
    status=507,
    code="storage-full",
    title="The file store is full",
    sentence="The file store is full, so the file was not stored. This is an error on our side; please "
    "submit it again later.",
    retry_after_s=300,
)


BUSY = Outage(
    status=503,
    code="site-busy",
    title="Too many files are being sent",
    sentence="The site sends other large files at the moment; please try again in a few seconds.",
    retry_after_s=5,
)


def outage_of(fault: BaseException | None) -> Outage | None:
    """Return the outage that a fault is a sign of, if any."""
    if isinstance(fault, downloads.TooManyDownloads):
        return BUSY
    if isinstance(fault, OperationalError | InterfaceError):
        # The driver's own exception, which knows PostgreSQL's code.
        is_full = getattr(fault.__cause__, "sqlstate", None) == POSTGRESQL_DISK_FULL
        return STORAGE_FULL if is_full else DATABASE_AWAY
    if isinstance(fault, StoreUnavailable):
        return STORE_AWAY
    if isinstance(fault, OSError) and fault.errno in FULL:
        return STORAGE_FULL
    if isinstance(fault, OSError) and fault.errno in BROKEN:
        return STORE_AWAY
    return None


def answered(fault: BaseException | None, *, marks: dict[str, Any]) -> Outage | None:
    """Return the outage that a fault is a sign of; log it, and mark the request that it answers."""
    outage = outage_of(fault)
    if outage is not None:
        marks[MARK] = outage.code
    if outage is BUSY:
        log.warning("too_many_downloads")
    elif outage is not None:
        log.error("outage", code=outage.code, reason=f"{type(fault).__name__}: {fault}"[:300])
    return outage
