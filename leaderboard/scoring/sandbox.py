"""Untrusted bytes are parsed in a limited child process; this is its parent's side.

The child has no database credentials and cannot open files or sockets. If it dies once it has begun to read
the file, that is known at once, and known to be the file's doing: the worker itself lives on.
"""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

import numpy as np
from django.conf import settings

from evaluator import Manifest, Predictions, Problem, Rejected
from evaluator.limits import EXIT_OUT_OF_MEMORY, READY


class ChildDied(Exception):
    """The child ended without an answer while it read the file: out of memory or time, or a crash."""


class ChildNotReady(Exception):
    """The child ended before it had read anything of the file: the machine's doing, or the installation's."""


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
    command = [
        sys.executable,
        "-m",
        "evaluator.quarantine",
        str(manifest_path),
        str(settings.CHILD_MEMORY_BYTES),
        str(settings.CHILD_CPU_S),
    ]
    environment = {
        "PATH": os.defpath,
        "PYTHONPATH": str(settings.BASE_DIR),
        "PYTHONDONTWRITEBYTECODE": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }
    child = subprocess.Popen(  # noqa: S603 - our own interpreter and module, nothing of the file
        command, stdin=source, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment, close_fds=True
    )
    answer, complaint = _answer(child, heartbeat=heartbeat, heartbeat_s=heartbeat_s)
    if not answer.startswith(READY):
        raise ChildNotReady(f"the reading process did not start: {_cause(child.returncode, complaint)}")
    if child.returncode != 0:
        raise ChildDied(f"reading the file {_cause(child.returncode, complaint)}")
    return _decoded(answer[len(READY) :], manifest=manifest)


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
