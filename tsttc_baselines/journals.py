"""The journal of a run: outcomes as they come, so that an interrupted run can continue."""

# A text next to the output: a line that names the run, then a line of JSON per piece of work. A half-written
# line is cut off; another run's journal is overwritten.

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import IO, Any

from tsttc_baselines.outcomes import Outcome


class OutputInUse(RuntimeError):
    """Another run writes the same output."""


class Journal:
    """Outcomes of the run `key`, for one run at a time; fallbacks are estimated again next time."""

    def __init__(self, path: Path, *, key: str) -> None:
        self.path = path
        self.outcomes: list[Outcome] = []
        self.seconds = 0.0
        path.touch()
        self._file: IO[bytes] = path.open("r+b")
        try:
            _lock(self._file)
            end = self._read(key)
            self._file.seek(end)
            self._file.truncate()
            if not end:
                self._write({"run": key})
        except BaseException:
            self._file.close()
            raise

    def _read(self, key: str) -> int:
        """Read what exists; returns the number of bytes in whole lines of this run."""
        end = 0
        for line in self._file:
            entry = _entry(line)
            if entry is None or (end == 0 and entry.get("run") != key):
                break
            end += len(line)
            self.seconds = max(self.seconds, entry.get("seconds", 0.0))
            self.outcomes += [Outcome(row, value) for row, value in entry.get("values", ())]
        return end

    def add(self, outcomes: Sequence[Outcome], *, seconds: float) -> None:
        """Note a piece of work, and the run's time until now."""
        values = [(outcome.row, outcome.scale_ratio) for outcome in outcomes if outcome.reason is None]
        self._write({"values": values, "seconds": seconds})

    def _write(self, entry: dict[str, Any]) -> None:
        self._file.write(json.dumps(entry, separators=(",", ":")).encode() + b"\n")
        self._file.flush()

    def discard(self) -> None:
        self._file.close()
        self.path.unlink(missing_ok=True)

    def __enter__(self) -> Journal:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()


def _lock(file: IO[bytes]) -> None:
    """Lock the file until it is closed, except on Windows; raises `OutputInUse`."""
    if sys.platform == "win32":
        return
    import fcntl  # noqa: PLC0415 -- as above

    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise OutputInUse from None


def _entry(line: bytes) -> dict[str, Any] | None:
    if not line.endswith(b"\n"):
        return None
    try:
        entry = json.loads(line)
    except ValueError:
        return None
    return entry if isinstance(entry, dict) else None
