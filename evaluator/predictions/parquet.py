"""Predictions in a Parquet table, as the JSON that the leaderboard takes in its place.

For files of one's own, on one's own machine: the leaderboard reads no Parquet (ADR 73). Needs pyarrow,
`pip install '.[parquet]'`.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from evaluator.problems import Rejected, reject

EXIT_OUT_OF_MEMORY: Final = 77
N_MAGIC_BYTES: Final = 4
_MAGIC: Final = b"PAR1"
_CHILD: Final = "evaluator.predictions.parquet_child"


def is_parquet(data: bytes) -> bool:
    """Whether these bytes begin as a Parquet table does."""
    return data.startswith(_MAGIC)


def as_sent(data: bytes) -> bytes:
    """A prediction file as the leaderboard takes it: a Parquet table as JSON, any other file as it is.

    The same table gives the same bytes. Raises `Rejected` for a table that is damaged, too large or has other
    columns than keys and numbers, `ModuleNotFoundError` where pyarrow is not installed.
    """
    if not is_parquet(data):
        return data
    if find_spec("pyarrow") is None:
        raise ModuleNotFoundError(
            "Parquet tables need pyarrow, which is not installed: pip install pyarrow", name="pyarrow"
        )
    return _answer(*_asked(data))


def _asked(data: bytes) -> tuple[int, bytes, bytes]:
    """Exit code, answer and complaints of the process that reads the table; pyarrow can end its process."""
    environment = {
        "PATH": os.defpath,
        "PYTHONPATH": os.pathsep.join([str(Path(__file__).resolve().parents[2]), *filter(None, sys.path)]),
        "PYTHONDONTWRITEBYTECODE": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "OMP_NUM_THREADS": "1",
        "ARROW_IO_THREADS": "1",
    }
    if "SYSTEMROOT" in os.environ:  # without it Python does not start on Windows
        environment["SYSTEMROOT"] = os.environ["SYSTEMROOT"]
    try:
        child = subprocess.run(  # noqa: S603 - our own interpreter and module, nothing of the file
            [sys.executable, "-P", "-m", _CHILD],
            input=data,
            capture_output=True,
            env=environment,
            check=False,
        )
    except OSError as error:
        message = f"The process that reads the table did not start: {error.strerror}."
        raise reject("unreadable", message) from None
    return child.returncode, child.stdout, child.stderr


def _answer(exit_code: int, answer: bytes, complaints: bytes) -> bytes:
    verdict, _, content = answer.partition(b"\n")
    if exit_code == 0 and verdict == b"good":
        return content
    if exit_code == 0 and verdict == b"rejected":
        raise Rejected.from_dict(json.loads(content))
    expected = "expected an intact Parquet table of predictions"
    if exit_code == EXIT_OUT_OF_MEMORY:
        raise reject("too-large", f"Reading the table takes too much memory; {expected}.")
    words = complaints[-2000:].decode(errors="replace").strip().rpartition("\n")[2][:200]
    how = f"signal {-exit_code}" if exit_code < 0 else f"exit code {exit_code}"
    said = f": {words}" if words else ""
    raise reject("unreadable", f"Reading the table ended its process ({how}{said}); {expected}.")
