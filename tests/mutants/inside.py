"""What `python -m tests.mutants` does with the tests of a room, once pytest has collected them: a plugin."""

import importlib
import json
import os
import random
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from tests.mutants import allowing, faults
from tests.mutants.running import Outcome, Part, Runs, Seen


def pytest_runtestloop(session: pytest.Session) -> bool:
    """Instead of the tests themselves."""
    if session.testsfailed:
        raise session.Interrupted("the tests cannot be collected")
    options = json.loads(os.environ["TSTTC_MUTANTS"])
    started_s = time.monotonic()
    root = Path(options["root"])
    runs = Runs(session, root=root, jobs=options["jobs"])
    sources = sorted(path for name in options["sources"] for path in _python_files(root / name))
    _import_all(sources, root)
    seen = _seen(runs, sources, Path(options["seen"]))
    _say(
        f"{len(seen.seconds)} of {len(session.items)} tests pass, after {time.monotonic() - started_s:.0f} s"
    )
    for name in sorted(runs.items.keys() - seen.seconds.keys()):
        _say(f"skipped or failed without a fault: {name}")
    every = [fault for path in sources for fault in faults.of_file(str(path.relative_to(root)), root)]
    chosen = _choose(every, options)
    _say(f"{len(chosen)} of {len(every)} faults of {options['room']}, seed {options['seed']}")
    _report(runs.try_out(chosen, seen, limit_s=options["seconds"]), options)
    _say(f"after {time.monotonic() - started_s:.0f} s")
    return True


def _import_all(sources: list[Path], root: Path) -> None:
    """What a test imports only while it runs has no function yet in which a fault could be planted."""
    for path in sources:
        names = path.relative_to(root).with_suffix("").parts
        with suppress(ImportError):  # an extra that is not installed
            importlib.import_module(".".join(name for name in names if name != "__init__"))


def _seen(runs: Runs, sources: list[Path], kept: Path) -> Seen:
    known = json.loads(kept.read_text()) if kept.exists() else {}
    parts = runs.see(sources, {file: Part(**part) for file, part in known.items()})
    kept.parent.mkdir(parents=True, exist_ok=True)
    kept.write_text(json.dumps({file: asdict(part) for file, part in parts.items()}))
    return Seen(parts.values())


def _python_files(path: Path) -> list[Path]:
    return list(path.rglob("*.py")) if path.is_dir() else [path]


def _choose(every: list[faults.Fault], options: dict[str, Any]) -> list[faults.Fault]:
    if options["at"]:
        path, _, line = options["at"].partition(":")
        return [fault for fault in every if fault.path == path and line in {"", str(fault.line)}]
    return random.Random(options["seed"]).sample(every, min(options["number"], len(every)))


def _report(outcomes: Iterator[Outcome], options: dict[str, Any]) -> None:
    allowed = allowing.read(Path(options["allowed"]))
    counts: Counter[str] = Counter()
    for outcome in outcomes:
        verdict, why = outcome.verdict, outcome.killer or f"{outcome.n_run} of {outcome.n_tests} tests"
        reason = allowing.reason_for(outcome.fault, allowed, Path(options["root"]))
        if verdict == "survived" and reason is not None:
            verdict, why = "allowed", reason
        counts[verdict] += 1
        _say(f"{verdict:9} {outcome.fault}  ({why}; {outcome.seconds:.0f} s)")
    n_judged = counts["killed"] + counts["survived"]
    text = ", ".join(f"{n} {verdict}" for verdict, n in counts.most_common())
    _say(f"{text}: {counts['killed']} of {n_judged} noticed, {counts['killed'] / max(n_judged, 1):.0%}")


def _say(text: str) -> None:
    # In spite of pytest, which keeps what is written.
    sys.__stdout__.write(f"{text}\n")
    sys.__stdout__.flush()
