"""When something that the leaderboard stands on fails: what to tell whoever asked, on every door alike.

Neither is the asker's fault, and neither is a reason for a bare 500: both pass, and asking again is safe.
"""

import errno
from dataclasses import dataclass

import structlog
from django.db import InterfaceError, OperationalError

from leaderboard.files import StoreAway

log = structlog.get_logger(__name__)

FULL = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})
POSTGRESQL_DISK_FULL = "53100"


@dataclass(frozen=True)
class Outage:
    """An answer. `status` is HTTP's, `code` is stable, `retry_after_s` is a guess."""

    status: int
    code: str
    title: str
    sentence: str
    retry_after_s: int

    @property
    def headers(self) -> dict[str, str]:
        """What goes with the answer."""
        return {"Retry-After": str(self.retry_after_s)}


DATABASE_AWAY = Outage(
    status=503,
    code="database-unavailable",
    title="The leaderboard is not available",
    sentence="The database does not answer at the moment. If you were sending a file, send it again: the "
    "same bytes are never taken twice.",
    retry_after_s=5,
)
STORE_AWAY = Outage(
    status=503,
    code="store-unavailable",
    title="The file store is not available",
    sentence="The place where files are kept does not answer at the moment, so nothing was taken and nothing "
    "was changed. That is our fault, not the file's; please try again later.",
    retry_after_s=30,
)
STORAGE_FULL = Outage(
    status=507,
    code="storage-full",
    title="There is no room left",
    sentence="There is no room left to keep the file, so it was not taken and nothing was changed. That is "
    "our fault, not the file's; please send it again later.",
    retry_after_s=300,
)


def outage_of(fault: BaseException | None) -> Outage | None:
    """The outage that this fault is a sign of; None if it is something else."""
    outage = None
    if isinstance(fault, OperationalError | InterfaceError):
        # The driver's own exception, which knows PostgreSQL's code.
        is_full = getattr(fault.__cause__, "sqlstate", None) == POSTGRESQL_DISK_FULL
        outage = STORAGE_FULL if is_full else DATABASE_AWAY
    elif isinstance(fault, StoreAway):
        outage = STORE_AWAY
    elif isinstance(fault, OSError) and fault.errno in FULL:
        outage = STORAGE_FULL
    if outage is not None:
        log.error("outage", code=outage.code, reason=f"{type(fault).__name__}: {fault}"[:300])
    return outage
