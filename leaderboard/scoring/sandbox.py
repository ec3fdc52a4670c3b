"""A submission's values in the order of an edition's ground truth: saved before, or read from the file.

Untrusted bytes are parsed in a limited child process. It has no database credentials and cannot open files
or sockets. If it dies once it has begun to read the file, that is known at once, and known to be the file's
doing: the worker itself lives on.

A file is read with its own manifest, the one that was public when it came. From there its values go sequence
by sequence, by natural keys, to the manifest of the edition. So a correction that numbers the sequences anew
changes nothing, one that removes some leaves the others, and only one that adds some asks for another file.
"""

import json
import signal
import subprocess
import sys
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import IO, Any

import numpy as np
import structlog
from django.conf import settings
from numpy.typing import NDArray

from evaluator import Manifest, Predictions, Problem, Rejected
from evaluator.limits import EXIT_OUT_OF_MEMORY, READY
from evaluator.predictions.revisions import Rows, absent, realigned, rows_in
from leaderboard.models import Edition, SentFile
from leaderboard.scoring import fork_server
from leaderboard.scoring.fork_server import Answer
from leaderboard.storage import files, manifests, truth_values

log = structlog.get_logger(__name__)

# Besides TSTTC_CHILD_CPU_S a reader has a second for so many sequences: three times what the slowest legal
# file takes, a table of 1,000,000 scale ratios by natural keys, 14 s on a busy machine.
SEQUENCES_PER_CPU_S = 25_000


class ChildDied(Exception):
    """The child ended without an answer while it read the file: out of memory or time, or a crash."""


class ChildOutOfTime(ChildDied):
    """The child used up its processor time, as it would in any other run."""


class ChildNotReady(Exception):
    """The child could not begin, or lost the process that had started it: not the file's doing."""


class LeaseLost(Exception):
    """The work was taken away, or its time was up, while the child ran; the child has been ended."""


def read_predictions(
    source: IO[bytes],
    *,
    manifest: Manifest,
    manifest_path: Path,
    heartbeat: Callable[[], bool],
    heartbeat_s: float,
) -> Predictions:
    """Parse and align a prediction file in a child process.

    `heartbeat` is called every `heartbeat_s` seconds while the child works; when it says False the child is
    ended. Raises `evaluator.Rejected` if the file is at fault, `ChildDied`, `ChildNotReady`, or `LeaseLost`;
    `OSError` if no child could be started.
    """
    request = {
        "manifest": str(manifest_path),
        "memory_bytes": settings.CHILD_MEMORY_BYTES,
        "cpu_s": (cpu_s := settings.CHILD_CPU_S + manifest.n_sequences // SEQUENCES_PER_CPU_S),
    }
    read = _forked if fork_server.AVAILABLE else _spawned
    found = read(source, request, heartbeat=heartbeat, heartbeat_s=heartbeat_s)
    if not found.output.startswith(READY):
        raise ChildNotReady(f"the reading process did not start: {_cause(found.returncode, found.complaint)}")
    if found.returncode == -signal.SIGXCPU:
        raise ChildOutOfTime(f"reading the file took more than {cpu_s} s of processor time")
    if found.returncode != 0:
        raise ChildDied(f"reading the file {_cause(found.returncode, found.complaint)}")
    return _decoded(found.output[len(READY) :], manifest=manifest)


def _forked(
    source: IO[bytes], request: dict[str, object], *, heartbeat: Callable[[], bool], heartbeat_s: float
) -> Answer:
    """What a child says that is forked for the file.

    A server that has ended since the last file is replaced, once; one that ends while a child reads takes the
    child with it, and the file is not to blame.
    """
    for _ in range(2):
        server = fork_server.server_of_this_thread(python_path=settings.BASE_DIR)
        is_new = not server.has_served
        try:
            return server.read(source, request=request, heartbeat=heartbeat, heartbeat_s=heartbeat_s)
        except fork_server.Interrupted:
            raise LeaseLost("the run reached its time limit or was taken away") from None
        except fork_server.NotStarted as fault:
            raise ChildNotReady(f"the reading process did not start: {fault}") from fault
        except fork_server.ServerEnded as fault:
            if is_new or fault.began:
                break
    raise ChildNotReady("the process that starts reading processes ended")


def _spawned(
    source: IO[bytes], request: dict[str, object], *, heartbeat: Callable[[], bool], heartbeat_s: float
) -> Answer:
    """What a child says that is started for the file, where there is no `fork` to be trusted."""
    command = [sys.executable, "-m", "evaluator.predictions.sandbox", *map(str, request.values())]
    child = subprocess.Popen(  # noqa: S603 - our own interpreter and module, nothing of the file
        command,
        stdin=source,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=fork_server.environment(python_path=settings.BASE_DIR),
        close_fds=True,
    )
    output, complaint = _answer(child, heartbeat=heartbeat, heartbeat_s=heartbeat_s)
    return Answer(child.returncode, output, complaint)


def _answer(
    child: "subprocess.Popen[bytes]", *, heartbeat: Callable[[], bool], heartbeat_s: float
) -> tuple[bytes, bytes]:
    """What the child writes to output and error, with a heartbeat while it does. Raises `LeaseLost`."""
    try:
        while True:
            try:
                return child.communicate(timeout=heartbeat_s)
            except subprocess.TimeoutExpired:
                if not heartbeat():
                    raise LeaseLost("the run reached its time limit or was taken away") from None
    finally:
        if child.poll() is None:
            child.kill()
            child.communicate()


def _cause(returncode: int, complaint: bytes) -> str:
    """Why the child died, in words."""
    if returncode == EXIT_OUT_OF_MEMORY:
        return f"needed more than {settings.CHILD_MEMORY_BYTES // 1_000_000} MB of memory"
    if returncode < 0:
        return f"ended with signal {-returncode}"
    last_line = complaint[-2000:].decode(errors="replace").strip().rpartition("\n")[2]
    return f"ended with exit code {returncode}: {last_line[:200]}"


def _decoded(answer: bytes, *, manifest: Manifest) -> Predictions:
    """The child's answer as predictions. Raises `evaluator.Rejected`, or `ChildDied` if it makes no sense."""
    line, _, body = answer.partition(b"\n")
    try:
        header: dict[str, Any] = json.loads(line)
    except ValueError as fault:
        raise ChildDied("reading the file gave no answer") from fault
    if header["verdict"] == "rejected":
        problems = tuple(Problem(**problem) for problem in header["problems"])
        raise Rejected(problems, n_problems=header["n_problems"])
    ttc_s = np.frombuffer(body, dtype="<f8")
    if ttc_s.shape != (manifest.n_sequences,):
        raise ChildDied(f"reading the file gave {ttc_s.size} values where {manifest.n_sequences} belong")
    return Predictions(
        manifest=manifest,
        ttc_s=ttc_s,
        digest=header["digest"],
        unit=header["unit"],
        keys=header["keys"],
        enveloped=header["enveloped"],
    )


# --- in the order of the ground truth ---------------------------------------------------------------------


def saved(file: SentFile, edition: Edition) -> Predictions | None:
    """The values that were kept when the file was first read; None if they are not all there.

    Neither the file's bytes nor its own manifest are read, but once for each pair of manifests. Raises
    `evaluator.Rejected` if the edition has sequences that the file's manifest did not have, and `OSError` if
    the private directory or the store does not answer.
    """
    manifest = truth_values.load(edition.ground_truth_id).manifest
    n_sent, places, missing = _places(file.manifest_digest, edition.ground_truth_id)
    if len(missing):
        raise absent(missing, manifest=manifest)
    ascending = files.load_aligned(file, n_sequences=n_sent)
    if ascending is None:
        return None
    ttc_s = ascending if places is None else ascending[places]
    return Predictions(manifest=manifest, ttc_s=ttc_s, digest=file.digest)


@lru_cache(maxsize=16)
def _places(own_digest: str, truth_digest: str) -> tuple[int, Rows | None, Rows]:
    """How many values a file for this manifest has, and where among them, in ascending anno_id, each is.

    (n,) in the order of the ground truth; None where that is the order of the values. And the rows of the
    ground truth that the file's manifest does not have.
    """
    manifest = truth_values.load(truth_digest).manifest
    own = manifest if manifest.digest == own_digest else manifests.load(own_digest)
    rows = rows_in(own, manifest)
    place_of_row: NDArray[np.intp] = np.empty(own.n_sequences, dtype=np.intp)
    place_of_row[own.rows_by_id] = np.arange(own.n_sequences)
    places = place_of_row[rows]
    is_same_order = own.n_sequences == len(places) and bool(np.array_equal(places, np.arange(len(places))))
    return own.n_sequences, None if is_same_order else places, np.flatnonzero(rows < 0)


def read(file: SentFile, edition: Edition, *, heartbeat: Callable[[], bool] = lambda: True) -> Predictions:
    """The values from the bytes of the file, which are kept for the next time.

    Raises `evaluator.Rejected` if the file is at fault or lacks sequences of the edition, `OSError` if the
    store, the disk or the private directory does not answer, and what `sandbox.read_predictions` raises.
    """
    manifest = truth_values.load(edition.ground_truth_id).manifest
    is_own = manifest.digest == file.manifest_digest
    own = manifest if is_own else manifests.load(file.manifest_digest)
    with files.opened_predictions(file.digest) as source:
        predictions = read_predictions(
            source,
            manifest=own,
            manifest_path=(
                truth_values.manifest_path(edition.ground_truth_id)
                if is_own
                else manifests.path(file.manifest_digest)
            ),
            heartbeat=heartbeat,
            heartbeat_s=settings.HEARTBEAT_S,
        )
    try:
        files.save_aligned(predictions)
    except OSError as fault:
        # They only make re-scoring quicker; without them it reads the file again.
        log.warning("values_not_kept", digest=file.digest, reason=f"{type(fault).__name__}: {fault}")
    return predictions if is_own else realigned(predictions, manifest=manifest)


def of(file: SentFile, edition: Edition) -> Predictions:
    """The values as they were kept, or from the file itself. Raises as `read` does."""
    return saved(file, edition) or read(file, edition)
