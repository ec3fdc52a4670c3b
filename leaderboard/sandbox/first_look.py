"""Warnings about a file that is not submitted yet, for the person who is about to submit it."""

import shutil
import tempfile
import time
from pathlib import Path
from threading import Lock
from typing import IO, Final

import structlog

from evaluator import Manifest, Rejected
from evaluator.predictions import plausibility
from evaluator.problems import FileWarning
from leaderboard.sandbox import child

log = structlog.get_logger(__name__)

MOST_S: Final = 20.0
MEMORY_BYTES: Final = 600_000_000
"""Of address space, most of it that of Python and numpy: a web process has less memory than a worker."""
# One file at a time in a process: a person waits for it, and all others can wait for the person.
_TURN: Final = Lock()


def warnings(source: IO[bytes], *, digest: str, manifest: Manifest) -> list[FileWarning]:
    """Read a file in a child process and warn of its values; empty for a file that a worker will reject.

    Nothing depends on it: where the child fails or is late, the worker's warnings follow the scores.
    """
    if manifest.n_sequences < plausibility.MIN_VALUES or not _TURN.acquire(timeout=MOST_S):
        return []
    try:
        return _warnings(source, digest=digest, manifest=manifest)
    except Rejected:
        return []
    except (child.ChildDied, child.ChildNotReady, child.LeaseLost, OSError) as fault:
        log.warning("no_first_look", digest=digest, reason=f"{type(fault).__name__}: {fault}"[:200])
        return []
    finally:
        _TURN.release()


def _warnings(source: IO[bytes], *, digest: str, manifest: Manifest) -> list[FileWarning]:
    deadline_s = time.monotonic() + MOST_S
    with tempfile.TemporaryDirectory() as folder:
        # In a web process an upload may be in memory alone, and no former manifest is on the disk.
        path = Path(folder) / "manifest.npz"
        manifest.save(path)
        with (Path(folder) / "file").open("w+b") as copy:
            source.seek(0)
            shutil.copyfileobj(source, copy)
            copy.seek(0)
            predictions = child.read_predictions(
                copy,
                digest=digest,
                manifest=manifest,
                manifest_path=path,
                heartbeat=lambda: time.monotonic() < deadline_s,
                heartbeat_s=1.0,
                memory_bytes=MEMORY_BYTES,
                keeps_server=False,
            )
    return plausibility.warnings_of(predictions)
