"""Tests run in forks of one process that has collected them: first to see what they run, then with faults.

Start-up, imports and the database are paid once.
"""

import hashlib
import itertools
import math
import multiprocessing
import os
import re
import signal
import time
import traceback
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkProcess
from pathlib import Path
from typing import Any, TypeVar

import coverage
import pytest
from _pytest.runner import runtestprotocol

from tests import kept
from tests.mutants.faults import Fault
from tests.mutants.planting import NotPlantable, plant

T = TypeVar("T")
R = TypeVar("R")
_FORK = multiprocessing.get_context("fork")
# After the tests of a fault have used up their time, the one that runs may end.
GRACE_S = 30.0
# So many times as long as its processor time may a fork take on a busy machine.
MAX_LOAD = 8


@dataclass
class Part:
    """What the tests of one file run."""

    checksum: str  # of the file
    # Tests that passed, with their seconds.
    seconds: dict[str, float] = field(default_factory=dict)
    # By file and line, the tests; the file of the tests stands for all in it, which share what was prepared.
    lines: dict[str, dict[str, list[str]]] = field(default_factory=dict)


class Seen:
    """What the tests of a room run."""

    def __init__(self, parts: Iterable[Part]) -> None:
        self.seconds: dict[str, float] = {}
        self.tests: dict[str, dict[int, set[str]]] = defaultdict(lambda: defaultdict(set))
        for part in parts:
            self.seconds |= part.seconds
            for path, by_line in part.lines.items():
                for line, names in by_line.items():
                    self.tests[path][int(line)].update(names)

    def of_lines(self, path: str, first: int, last: int) -> tuple[set[str], set[str]]:
        """The tests that run one of the lines themselves, and those that share what ran one."""
        runners = set().union(*(self.tests[path][line] for line in range(first, last + 1)))
        own = runners & self.seconds.keys()
        shared = {name for name in self.seconds if _file_of(name) in runners}
        return own, shared - own


@dataclass(frozen=True)
class Outcome:
    """What the tests said to a fault."""

    fault: Fault
    verdict: str  # killed, survived, not plantable
    killer: str = ""
    n_run: int = 0
    n_tests: int = 0
    seconds: float = 0.0


class Runs:
    """The runs of tests, once pytest has collected them."""

    def __init__(self, session: pytest.Session, *, root: Path, jobs: int) -> None:
        self.session = session
        self.root = root
        self.jobs = jobs
        self.items = {item.nodeid: item for item in session.items}
        self._prepare()

    def _prepare(self) -> None:
        """Have the database in this process, by running one test that asks for it."""
        first = next((i for i in self.session.items if "db" in getattr(i, "fixturenames", ())), None)
        if first is not None:
            first.config.hook.pytest_runtest_protocol(item=first, nextitem=self._another(first))
            kept.let_go()

    def see(self, sources: Sequence[Path], known: dict[str, Part]) -> dict[str, Part]:
        """What the tests of each file run of these sources; files that have not changed are `known`."""
        names: dict[str, list[str]] = defaultdict(list)
        for name in self.items:
            names[_file_of(name)].append(name)
        parts = {}
        for file in names:
            checksum = hashlib.sha256((self.root / file).read_bytes()).hexdigest()
            parts[file] = known.get(file, Part(""))
            if parts[file].checksum != checksum:
                parts[file] = Part(checksum)
        # Long files come first.
        missing = sorted((f for f in names if not parts[f].seconds), key=lambda file: -len(names[file]))
        for file, part in _in_forks(missing, lambda f: self._watch(names[f], sources), jobs=self.jobs):
            if part is not None:
                parts[file].seconds, parts[file].lines = part
        return parts

    def _watch(
        self, names: list[str], sources: Sequence[Path]
    ) -> tuple[dict[str, float], dict[str, dict[str, list[str]]]]:
        """Seconds of the tests that passed, and what they run."""
        watcher = coverage.Coverage(
            data_file=None, include=[str(path) for path in sources], config_file=False
        )
        watcher.set_option("run:disable_warnings", ["no-data-collected"])  # many tests run nothing of a room
        shared = _file_of(names[0])

        class Contexts:
            @pytest.hookimpl(wrapper=True, tryfirst=True)
            def pytest_fixture_setup(
                self, fixturedef: pytest.FixtureDef[Any], request: pytest.FixtureRequest
            ) -> Iterator[None]:
                # `_django_db_helper` is where `tests/kept.py` makes what the tests of a file share.
                is_shared = fixturedef.scope != "function" or fixturedef.argname == "_django_db_helper"
                if is_shared:
                    watcher.switch_context(shared)
                try:
                    return (yield)
                finally:
                    if is_shared:
                        watcher.switch_context(current)

        current = shared

        def begin(name: str) -> None:
            nonlocal current
            current = name
            watcher.switch_context(name)

        self.session.config.pluginmanager.register(Contexts())
        watcher.start()
        runs = list(self._run(names, before=begin))
        watcher.stop()
        data = watcher.get_data()
        lines = {
            str(Path(file).relative_to(self.root)): {
                str(line): [name for name in by if name] for line, by in data.contexts_by_lineno(file).items()
            }
            for file in data.measured_files()
        }
        return {name: seconds for name, verdict, seconds in runs if verdict == "passed"}, lines

    def try_out(self, faults: Sequence[Fault], seen: Seen, *, limit_s: float) -> Iterator[Outcome]:
        """Run the tests of each fault, until one fails that passes without the fault or the time is over."""

        def work(fault: Fault) -> Outcome:
            return self._judge(fault, self._covering(fault, seen), seen, limit_s=limit_s)

        for _, outcome in _in_forks(faults, work, jobs=self.jobs):
            if outcome is not None:
                yield outcome

    def _covering(self, fault: Fault, seen: Seen) -> list[str]:
        """Those that run the fault before those that share what ran it; near and quick ones first."""
        own, shared = seen.of_lines(fault.path, fault.first, fault.last)
        if fault.constant:  # it is made when the module is imported, and read where its name stands
            own = set().union(*(seen.of_lines(path, line, line)[0] for path, line in self._uses(fault, seen)))
            shared = seen.seconds.keys() - own
        parts = set(Path(fault.path).with_suffix("").parts)

        def order(name: str) -> tuple[bool, int, float]:
            near = {part.removeprefix("test_") for part in Path(_file_of(name)).with_suffix("").parts}
            return name in shared, -len(parts & near), seen.seconds[name]

        return sorted((own | shared) & self.items.keys(), key=order)

    def _uses(self, fault: Fault, seen: Seen) -> list[tuple[str, int]]:
        name = re.compile(rf"\b{fault.constant}\b")
        return [
            (path, line)
            for path in seen.tests
            for line, text in enumerate((self.root / path).read_text().splitlines(), start=1)
            if name.search(text)
        ]

    def _judge(self, fault: Fault, names: list[str], seen: Seen, *, limit_s: float) -> Outcome:
        """A test that fails with the fault counts if it passes without, after the same tests."""
        started_s = time.monotonic()
        timeout_s = (
            MAX_LOAD * limit_s + GRACE_S + 3 * max((seen.seconds[name] for name in names), default=0.0)
        )
        n_tests = len(names)

        def with_fault(names: list[str]) -> tuple[str, int] | str:
            try:
                plant(fault, root=self.root)
            except NotPlantable as reason:
                return str(reason)
            return self._first_failure(names, limit_s=limit_s)

        while True:
            answer = _in_fork(names, with_fault, timeout_s=timeout_s)
            seconds = time.monotonic() - started_s
            if isinstance(answer, str):
                return Outcome(fault, "not plantable", answer)
            if answer is None:
                return Outcome(fault, "killed", "it has no end, or ends the process", 0, n_tests, seconds)
            killer, n_run = answer
            if not killer:
                return Outcome(fault, "survived", "", n_run, n_tests, seconds)
            if _in_fork(names[:n_run], self._first_failure, timeout_s=None) == ("", n_run):
                return Outcome(fault, "killed", killer, n_run, n_tests, seconds)
            names = [name for name in names if name != killer]

    def _first_failure(self, names: list[str], limit_s: float = math.inf) -> tuple[str, int]:
        """The name of the first test that fails, or nothing, and how many were run before the end."""
        n_run = 0
        for name, verdict, _ in self._run(names):
            n_run += 1
            if verdict == "failed":
                return name, n_run
            # Of the processor: on a busy machine as many tests have their turn.
            if time.process_time() > limit_s:
                break
        return "", n_run

    def _run(
        self, names: Sequence[str], before: Callable[[str], None] = lambda name: None
    ) -> Iterator[tuple[str, str, float]]:
        """Run these tests in this process. Yields name, passed or skipped or failed, and seconds."""
        items = [self.items[name] for name in names]
        for item in items[:1]:
            # The stack of what is set up belongs to another test, from before the fork.
            self.session._setupstate.teardown_exact(item)
        for item, following in itertools.zip_longest(items, items[1:]):
            before(item.nodeid)
            reports = runtestprotocol(item, log=False, nextitem=following or self._another(item))
            verdicts = {report.outcome for report in reports}
            verdict = next((v for v in ("failed", "skipped") if v in verdicts), "passed")
            yield item.nodeid, verdict, sum(report.duration for report in reports)

    def _another(self, item: pytest.Item) -> pytest.Item | None:
        """With a test to come, pytest keeps what belongs to the session: the database."""
        return next((other for other in self.session.items if other.path != item.path), None)


def _file_of(name: str) -> str:
    return name.partition("::")[0]


def _in_fork(task: T, work: Callable[[T], R], *, timeout_s: float | None) -> R | None:
    return next(result for _, result in _in_forks([task], work, jobs=1, timeout_s=timeout_s))


def _in_forks(
    tasks: Sequence[T], work: Callable[[T], R], *, jobs: int, timeout_s: float | None = None
) -> Iterator[tuple[T, R | None]]:
    """Do each task in a fork of this process. None comes of one that ends without a result or has no end."""
    waiting = list(reversed(tasks))
    running: dict[Connection, tuple[T, ForkProcess, float]] = {}
    try:
        while waiting or running:
            while waiting and len(running) < jobs:
                task = waiting.pop()
                ours, theirs = _FORK.Pipe(duplex=False)
                process = _FORK.Process(target=_answer, args=(theirs, work, task))
                process.start()
                theirs.close()
                running[ours] = (task, process, time.monotonic())
            for ready in wait(list(running), timeout=1.0):
                assert isinstance(ready, Connection)
                task, process, _ = running.pop(ready)
                try:
                    result, trouble = ready.recv()
                except EOFError:  # a fault may end the process
                    result, trouble = None, ""
                _end(process)
                if trouble:
                    raise RuntimeError(trouble)
                yield task, result
            for connection, (task, process, started_s) in list(running.items()):
                if timeout_s is not None and time.monotonic() > started_s + timeout_s:
                    del running[connection]
                    _end(process)
                    yield task, None
    finally:
        for _, process, _ in running.values():
            _end(process)


def _answer(answer: Connection, work: Callable[[T], R], task: T) -> None:
    """The life of a fork: its own group of processes, its own folder, and nobody reads what it prints."""
    os.setpgrp()
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(nowhere, stream)
    try:
        answer.send((work(task), ""))
    except Exception:  # noqa: BLE001 - the parent raises it
        answer.send((None, traceback.format_exc()))
    answer.close()
    os.killpg(0, signal.SIGKILL)  # with whatever the tests have left running


def _end(process: ForkProcess) -> None:
    with suppress(ProcessLookupError):
        os.killpg(process.pid or 0, signal.SIGKILL)
    process.join()
