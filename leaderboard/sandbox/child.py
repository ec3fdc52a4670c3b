"""Untrusted bytes are parsed in a limited child process, without credentials, files or sockets.

If it dies after it began to read, the file is to blame. Answers that no file could give count as its death.
"""

import json
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import IO, Any, Final, get_args

import numpy as np
import structlog
from django.conf import settings

from evaluator import Manifest, Predictions, Rejected, system_calls
from evaluator.limits import EXIT_OUT_OF_MEMORY, READY
from evaluator.predictions.documents import Unit
from evaluator.predictions.values import allowed
from evaluator.truth.ground_truth import KeyKind
from leaderboard.sandbox import fork_server
from leaderboard.sandbox.fork_server import Answer

log = structlog.get_logger(__name__)

# Besides TSTTC_CHILD_CPU_S a reader has a second for so many sequences: three times what the slowest legal
# file takes, a table of 1,000,000 scale ratios by natural keys, 14 s on a busy machine.
SEQUENCES_PER_CPU_S = 25_000
MAX_WORDS_BYTES: Final = 1_000_000
"""What a child may write beside the values; the longest list of problems has a tenth."""


class ChildDied(Exception):
    """The child ended without an answer while it read the file: out of memory or time, or a crash."""


class ChildOutOfTime(ChildDied):
    """The child used up its processor time, as it would in any other run."""


class ChildNotReady(Exception):
    """The child could not begin, or lost its parent: the file is not to blame."""


class LeaseLost(Exception):
    """The lease was lost while the child ran; the child has been ended."""


def read_predictions(
    source: IO[bytes],
    *,
    digest: str,
    manifest: Manifest,
    manifest_path: Path,
    heartbeat: Callable[[], bool],
    heartbeat_s: float,
    memory_bytes: int | None = None,
    keeps_server: bool = True,
) -> Predictions:
    """Parse and align the prediction file with this digest in a child process.

    `keeps_server` leaves a process to each thread, which makes the next child quickly. Ends the child when
    `heartbeat`, called every `heartbeat_s` seconds, returns False. Raises `evaluator.Rejected`, `ChildDied`,
    `ChildNotReady`, `LeaseLost`; `OSError` if no child could be started.
    """
    _say_what_is_missing()
    request = {
        "manifest": str(manifest_path),
        "memory_bytes": memory_bytes or settings.CHILD_MEMORY_BYTES,
        "cpu_s": (cpu_s := settings.CHILD_CPU_S + manifest.n_sequences // SEQUENCES_PER_CPU_S),
    }
    read = _forked if fork_server.AVAILABLE and keeps_server else _spawned
    max_bytes = MAX_WORDS_BYTES + 8 * manifest.n_sequences
    try:
        reply = read(source, request, max_bytes=max_bytes, heartbeat=heartbeat, heartbeat_s=heartbeat_s)
    except fork_server.AnswerTooLarge:
        raise ChildDied(f"reading the file gave an answer of more than {max_bytes:,} bytes") from None
    if not reply.output.startswith(READY):
        raise ChildNotReady(f"the reading process did not start: {_cause(reply.returncode, reply.complaint)}")
    if reply.returncode == -signal.SIGXCPU:
        raise ChildOutOfTime(f"reading the file took more than {cpu_s} s of processor time")
    if reply.returncode != 0:
        raise ChildDied(f"reading the file {_cause(reply.returncode, reply.complaint)}")
    return _decoded(reply.output[len(READY) :], manifest=manifest, digest=digest)


@cache
def _say_what_is_missing() -> None:
    why = system_calls.why_unavailable()
    if why is not None:
        log.warning("readers_without_a_filter_of_system_calls", reason=why)


def _forked(
    source: IO[bytes],
    request: dict[str, object],
    *,
    max_bytes: int,
    heartbeat: Callable[[], bool],
    heartbeat_s: float,
) -> Answer:
    """Read with a forked child; replace once a server that has ended since the last file."""
    for _ in range(2):
        server = fork_server.server_of_this_thread(python_path=settings.BASE_DIR)
        is_new = not server.has_served
        try:
            return server.read(
                source,
                request=request,
                max_bytes=max_bytes,
                heartbeat=heartbeat,
                heartbeat_s=heartbeat_s,
            )
        except fork_server.Interrupted:
            raise LeaseLost("the run reached its time limit or was taken away") from None
        except fork_server.NotStarted as fault:
            raise ChildNotReady(f"the reading process did not start: {fault}") from fault
        except fork_server.ServerEnded as fault:
            if is_new or fault.began:
                break
    raise ChildNotReady("the process that starts reading processes ended")


def _spawned(
    source: IO[bytes],
    request: dict[str, object],
    *,
    max_bytes: int,
    heartbeat: Callable[[], bool],
    heartbeat_s: float,
) -> Answer:
    """Read with a new process, where `fork` cannot be trusted."""
    command = [sys.executable, "-m", "evaluator.predictions.reader", *map(str, request.values())]
    child = subprocess.Popen(  # noqa: S603 - our own interpreter and module, nothing of the file
        command,
        stdin=source,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=fork_server.environment(python_path=settings.BASE_DIR),
        close_fds=True,
    )
    with child, ThreadPoolExecutor(2) as readers:
        try:
            parts = [readers.submit(_at_most, pipe, max_bytes) for pipe in (child.stdout, child.stderr)]
            _await_end(child, heartbeat=heartbeat, heartbeat_s=heartbeat_s)
        finally:
            child.kill()
        return Answer(child.returncode, *(part.result() for part in parts))


def _at_most(pipe: IO[bytes] | None, max_bytes: int) -> bytes:
    """Read the pipe to its end. Closes it and raises `AnswerTooLarge` above `max_bytes`."""
    if pipe is None:
        raise RuntimeError("the reading process was started without pipes")
    with pipe:
        data = pipe.read(max_bytes + 1)
    if len(data) > max_bytes:
        raise fork_server.AnswerTooLarge
    return data


def _await_end(
    child: "subprocess.Popen[bytes]", *, heartbeat: Callable[[], bool], heartbeat_s: float
) -> None:
    while True:
        try:
            child.wait(timeout=heartbeat_s)
        except subprocess.TimeoutExpired:
            if not heartbeat():
                raise LeaseLost("the run reached its time limit or was taken away") from None
        else:
            return


def _cause(returncode: int, complaint: bytes) -> str:
    if returncode == EXIT_OUT_OF_MEMORY:
        return f"needed more than {settings.CHILD_MEMORY_BYTES // 1_000_000} MB of memory"
    if returncode < 0:
        return f"ended with signal {-returncode}"
    last_line = complaint[-2000:].decode(errors="replace").strip().rpartition("\n")[2]
    return f"ended with exit code {returncode}: {last_line[:200]}"


def _decoded(answer: bytes, *, manifest: Manifest, digest: str) -> Predictions:
    """Decode the child's answer. Raises `evaluator.Rejected`, or `ChildDied` if it makes no sense."""
    line, _, body = answer.partition(b"\n")
    header = _header(line)
    if header.get("verdict") == "rejected":
        raise _rejection(header)
    unit: Any = header.get("unit")
    keys: Any = header.get("keys")
    if header.get("verdict") != "good" or unit not in get_args(Unit) or keys not in get_args(KeyKind):
        raise ChildDied("reading the file gave an answer of another form")
    if header.get("digest") != digest:
        # The store has other bytes under this name, or the child lies: neither is kept as this file's.
        raise ChildDied(f"reading the file gave another digest than {digest}")
    if len(body) != 8 * manifest.n_sequences:
        raise ChildDied(f"reading the file gave {len(body)} bytes where {manifest.n_sequences} values belong")
    ttc_s = np.frombuffer(body, dtype="<f8")
    if not allowed(ttc_s, unit="ttc").all():
        raise ChildDied("reading the file gave a value that no file may have")
    return Predictions(
        manifest=manifest,
        ttc_s=ttc_s,
        digest=digest,
        unit=unit,
        keys=keys,
        enveloped=header.get("enveloped") is True,
    )


def _header(line: bytes) -> Mapping[str, Any]:
    try:
        header = json.loads(line) if len(line) <= MAX_WORDS_BYTES else None
    except (ValueError, RecursionError):
        header = None
    if not isinstance(header, dict):
        raise ChildDied("reading the file gave no answer")
    return header


def _rejection(header: Mapping[str, Any]) -> Rejected:
    try:
        return Rejected.from_dict(header)
    except ValueError as fault:
        raise ChildDied(f"reading the file gave a rejection of another form: {fault}") from None
