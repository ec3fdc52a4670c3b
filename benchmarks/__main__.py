"""`python -m benchmarks [NAME …]`: measure the figures of docs/capacity.md, and say which hold.

A benchmark is a module with a function `main()` that prints one line per figure, `name = value unit`. Each
runs in a process of its own, and is ended after ten minutes. A service that is missing is named. With
BENCH_QUICK=1 everything is small, to see that it works; such values say nothing.
"""

import operator
import os
import platform
import re
import subprocess
import sys
import time
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path

NAMES = ("evaluator", "submissions", "rescoring", "board", "inference")
GOALS = {
    "evaluator.by_anno_id": (">=", 9.0),
    "evaluator.by_natural_key": (">=", 7.0),
    "submissions.processor": ("<=", 0.03),
    "submissions.scored_p50": ("<=", 0.1),
    "submissions.submit_wait": ("<=", 1.5),
    "rescoring.over_plain_loop": (">=", 50.0),
    "rescoring.memory": ("<=", 100.0),
    "board.page_of_empty": (">=", 0.5),
    "board.json_of_empty": (">=", 0.5),
    "board.first_reader_200": ("<=", 0.3),
    "board.first_reader_1000": ("<=", 1.5),
    "inference.200": ("<=", 3.0),
    "inference.1000": ("<=", 120.0),
}
LIMIT_S = 600
_LINE = re.compile(r"([a-z][\w.]*) = (\S+)")
_HOLDS = {">=": operator.ge, "<=": operator.le}
_RUN = """
from benchmarks import {name}
from tests.services import ServiceMissing
try:
    {name}.main()
except ServiceMissing as missing:
    print(f"not measured: {{missing}}")
"""


def judged(line: str) -> str:
    """A line that a benchmark printed, with the goal of its figure and whether it holds."""
    match = _LINE.match(line)
    if match is None or match[1] not in GOALS:
        return line
    sign, goal = GOALS[match[1]]
    return f"{line}   (goal {sign} {goal:g}: {'holds' if _HOLDS[sign](float(match[2]), goal) else 'MISSED'})"


def main() -> int:
    """Run them in turn; the exit code is the first that was not 0."""
    names = sys.argv[1:] or list(NAMES)
    if unknown := sorted(set(names) - set(NAMES)):
        sys.exit(f"There is no benchmark {', '.join(unknown)}; expected some of: {', '.join(NAMES)}")
    commit = subprocess.run(
        ["git", "describe", "--always", "--dirty"], capture_output=True, text=True, check=False
    )
    print(f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC, commit {commit.stdout.strip() or 'unknown'}, ", end="")
    print(f"{os.cpu_count()} processors, {platform.system()}, Python {platform.python_version()}")
    codes = [run(name) for name in names]
    return next((code for code in codes if code), 0)


def run(name: str) -> int:
    """Run one benchmark and show its lines as they come; returns its exit code."""
    print(f"\n{name} (load before: {os.getloadavg()[0]:.1f})", flush=True)
    started_s = time.monotonic()
    limited = ("timeout", "--signal=INT", "--kill-after=60", str(LIMIT_S))
    process = subprocess.Popen(
        [*limited, sys.executable, "-u", "-c", _RUN.format(name=name)],
        cwd=Path(__file__).parents[1],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    try:
        for line in process.stdout:
            print(judged(line.rstrip("\n")), flush=True)
    except KeyboardInterrupt:
        # It has heard it too, and ends what it has started.
        with suppress(subprocess.TimeoutExpired):
            process.wait(timeout=60)
        raise
    code = process.wait()
    print(f"{name} took {time.monotonic() - started_s:.0f} s{f', exit code {code}' if code else ''}")
    return code


if __name__ == "__main__":
    sys.exit(main())
