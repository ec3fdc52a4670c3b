"""`python -m benchmarks [NAME …]`: run every benchmark of this folder, or those named.

A benchmark is a module with a function `main()` that measures and prints one line per figure, `name = value
unit`. Each runs in a process of its own, so that none measures what another left in memory, and is ended
after its time: all together take fourteen minutes at most. What is missing, a service, a program or a package
registry, is named, and is no error.

Every benchmark: the figures become `benchmarks/report.md`, after each benchmark anew, and from there come the
figures in `docs/`. Of those named they are only printed, unless `--keep` puts them into the report of before.
"""

import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path

from benchmarks import _report
from benchmarks._report import FOLDER, Measured

# Seconds for each. Those first without which a report says little.
LIMITS_S = {
    "board": 90,
    "board_large": 70,
    "whole_path": 60,
    "scale_out": 120,
    "inference": 60,
    "rescoring": 90,
    "evaluator": 65,
    "cli": 45,
    "uncertainty": 30,
    "baselines": 110,
}
# Others say nothing about the site, and take their time: they run when they are asked for.
ON_REQUEST_S = 600
_RUN = """
from benchmarks import {name}
from tests.services import ServiceMissing
try:
    {name}.main()
except ServiceMissing as missing:
    print(f"not measured: {{missing}}")
except KeyboardInterrupt:
    raise SystemExit(130) from None
"""


def main() -> int:
    """Run them in turn; the exit code is the first that was not 0."""
    keep = "--keep" in sys.argv[1:]
    chosen = [name for name in sys.argv[1:] if name != "--keep"]
    others = sorted(path.stem for path in FOLDER.glob("*.py") if not path.stem.startswith("_"))
    limits_s = LIMITS_S | {name: ON_REQUEST_S for name in others if name not in LIMITS_S}
    unknown = sorted(set(chosen) - set(limits_s))
    if unknown:
        sys.exit(f"There is no benchmark {', '.join(unknown)}; expected some of: {', '.join(limits_s)}")
    former = _former() if keep else {}
    codes, parts = [], dict(former)
    for name in chosen or LIMITS_S:
        code, measured = run(name, limit_s=limits_s[name])
        codes.append(code)
        parts[name] = measured.text()
        if keep or not chosen:
            _report.REPORT.write_text(_report.text(parts[each] for each in limits_s if each in parts))
            _report.renew()
    return next((code for code in codes if code), 0)


def run(name: str, *, limit_s: float) -> tuple[int, Measured]:
    """One benchmark, its lines shown as they come; after its time it is ended with all that it began."""
    measured = Measured(name, datetime.now(UTC), os.getloadavg()[0])
    began_s = time.monotonic()
    process = subprocess.Popen(
        [sys.executable, "-u", "-c", _RUN.format(name=name)],
        cwd=FOLDER.parent,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    over = threading.Event()

    def end() -> None:
        over.set()
        _end(process)

    timer = threading.Timer(limit_s, end)
    timer.start()
    assert process.stdout is not None
    try:
        for line in process.stdout:
            print(line, end="", flush=True)
            measured.hear(line.rstrip("\n"))
        code = process.wait()
    except KeyboardInterrupt:
        _end(process)
        raise
    finally:
        timer.cancel()
    measured.took_s = time.monotonic() - began_s
    if over.is_set():
        measured.notes.append(f"Ended after {limit_s:g} s; what it had measured until then is kept.")
    elif code:
        measured.notes.append(f"Failed with exit code {code}.")
    return (0 if over.is_set() else code), measured


def _end(process: "subprocess.Popen[str]") -> None:
    """As with Ctrl-C, so that it drops its databases and ends what it started; then by force."""
    # A worker has a group of its own, and its processes outlive it; whose they were is known only now.
    groups = {process.pid, *_groups(process.pid)} - {os.getpgrp()}
    with suppress(ProcessLookupError):
        process.send_signal(signal.SIGINT)
        with suppress(subprocess.TimeoutExpired):
            process.wait(timeout=15)
    for group in groups:
        with suppress(ProcessLookupError):
            os.killpg(group, signal.SIGKILL)


def _groups(pid: int) -> set[int]:
    """The process groups of all that this process has begun, and of what those have."""
    found: set[int] = set()
    for path in Path("/proc", str(pid), "task").glob("*/children"):
        # What has ended meanwhile needs no end.
        with suppress(OSError):
            for child in map(int, path.read_text().split()):
                found |= {os.getpgid(child), *_groups(child)}
    return found


def _former() -> dict[str, str]:
    """The parts of the report that there is, by benchmark."""
    found = _report.REPORT.read_text().split("\n## ")[1:] if _report.REPORT.exists() else []
    return {part.partition("\n")[0]: "## " + part.rstrip("\n") + "\n" for part in found}


if __name__ == "__main__":
    sys.exit(main())
