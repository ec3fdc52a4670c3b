"""A site for the benchmarks of the leaderboard, its processes, and the resources that these have used."""

import os
import signal
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path

from tests.journeys.production import BIN, Site, await_that, free_port, running, settings_for
from tests.services import throwaway_database, throwaway_redis

QUICK = "BENCH_QUICK" in os.environ


@contextmanager
def site(**settings: str) -> Iterator[Site]:
    """A migrated production site on PostgreSQL and Redis; in this process Django is set up for it."""
    with (
        throwaway_database() as postgres_url,
        throwaway_redis() as redis_url,
        tempfile.TemporaryDirectory(prefix="bench-") as folder,
    ):
        url = f"http://127.0.0.1:{free_port()}"
        environment = settings_for(Path(folder), url=url, postgres_url=postgres_url, redis_url=redis_url)
        environment |= {"DJANGO_SETTINGS_MODULE": "benchmarks._settings", "TSTTC_LOG_LEVEL": "INFO"}
        made = Site(url=url, directory=Path(folder), environment=environment | settings)
        (made.directory / "mail").mkdir()
        made.manage("migrate", "--no-input", "--verbosity=0")
        made.manage("collectstatic", "--no-input", "--verbosity=0")
        os.environ.update(made.environment | {"TSTTC_LOG_LEVEL": "WARNING"})
        import django  # noqa: PLC0415 - its settings are read from the environment

        django.setup()
        from django.db import connections  # noqa: PLC0415

        try:
            yield made
        finally:
            connections.close_all()


@contextmanager
def worker(made: Site, *, n_processes: int) -> Iterator[int]:
    """A Celery worker once it is ready; yields the number of its main process."""
    command = (str(BIN / "celery"), "--app=leaderboard", "worker", f"--concurrency={n_processes}")
    with running(made, "worker", *command, "--loglevel=info") as process:
        log = made.directory / "worker.log"
        await_that(lambda: b" ready." in log.read_bytes(), what="the worker is ready")
        yield process.pid
        # Asked to end, it would first finish what waits behind submissions.
        os.killpg(process.pid, signal.SIGKILL)


def leave_intervals() -> None:
    """Keep workers from intervals and ranges, which `inference` measures: to them they are of tomorrow."""
    from django.utils import timezone  # noqa: PLC0415 - Django is configured only now

    from leaderboard.models import Edition  # noqa: PLC0415

    Edition.objects.update(inferred_at=timezone.now() + timedelta(days=1))


def children(pid: int) -> list[int]:
    """The processes that this one has started and that still run."""
    lists = Path("/proc", str(pid), "task").glob("*/children")
    return [int(child) for path in lists for child in _text_of(path).split()]


def processor_s(pid: int) -> float:
    """Processor seconds of a process and of all that it has started, those that have ended included."""
    # The fields after the name, which may have spaces in it: its own times, and those of ended children.
    fields = _text_of(Path("/proc", str(pid), "stat")).rpartition(")")[2].split()
    own_s = sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")
    return own_s + sum(map(processor_s, children(pid)))


def memory_mb(pid: int, name: str) -> float:
    """VmRSS, what a process has, or VmHWM, the most that it has had."""
    lines = _text_of(Path("/proc", str(pid), "status")).splitlines()
    return next(int(line.split()[1]) / 1024 for line in lines if line.startswith(f"{name}:"))


def _text_of(path: Path) -> str:
    try:
        return path.read_text()
    except (FileNotFoundError, ProcessLookupError):
        return ""  # it has ended since it was listed
