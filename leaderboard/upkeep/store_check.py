"""Check the file store: write, read and remove a small file, and ask how much room is left.

A directory that is not mounted can be written to as well, so the store must have a manifest of the site.
"""

import shutil
import socket
from datetime import datetime, timedelta
from pathlib import Path
from typing import Final

import structlog
from django.core.files.base import ContentFile
from django.core.files.storage import FileSystemStorage

from leaderboard.models import GroundTruth, SweepBeat
from leaderboard.ops import faults
from leaderboard.storage import files

log = structlog.get_logger(__name__)

EVERY_S: Final = 60.0
# Beside the prediction files, so that it needs the rights that they need; no digest has this name.
PROBE: Final = "predictions/probe"
MAX_MANIFESTS: Final = 5
# Machines with workers take turns by chance. One that has not complained for so long is well, or gone.
SILENT: Final = timedelta(minutes=10)
_CONTENT: Final = b"This file shows that the file store can be written to.\n"


def check(*, now: datetime) -> None:
    """Note whether files can be stored, and the room that is left. Raises the database's error.

    A machine whose workers can store files says nothing of another one, which may lack the mount.
    """
    machine = socket.gethostname()
    free_bytes: int | None = None
    try:
        free_bytes = _free_bytes()
        _try()
    except OSError as fault:
        reason = f"{type(fault).__name__}: {fault}"
        if faults.note(faults.STORE, subject=machine, reason=reason, now=now):
            log.error("store_cannot_be_written", reason=reason[:500])
    else:
        faults.clear(faults.STORE, subject=machine)
        for silent in faults.present([faults.STORE], now=now).filter(last_at__lte=now - SILENT):
            faults.clear(faults.STORE, subject=silent.subject)
    SweepBeat.objects.update(store_checked_at=now, store_free_bytes=free_bytes)


def _try() -> None:
    store = files.store()
    digests = GroundTruth.objects.order_by("pk").values_list("manifest_digest", flat=True)[:MAX_MANIFESTS]
    names = [files.manifest_name(digest) for digest in digests]
    # One may be lost; not to have any is to be another store.
    if names and not any(store.exists(name) for name in names):
        raise OSError("the file store has no manifest of this site; is another directory or bucket mounted?")
    store.save(PROBE, ContentFile(_CONTENT))
    with files.open_named(PROBE) as kept:
        read = kept.read()
    store.delete(PROBE)
    if read != _CONTENT:
        raise OSError("the file store returned other bytes than were stored")


def _free_bytes() -> int | None:
    """Return the room of a local store; None of a bucket, which does not tell."""
    store = files.store()
    if not isinstance(store, FileSystemStorage):
        return None
    folder = Path(store.location)
    while not folder.exists():
        folder = folder.parent
    return shutil.disk_usage(folder).free
