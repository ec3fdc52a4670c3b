"""The leaderboard with everything it needs, as processes that may be killed one by one."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import httpx2

import evaluator
from tests.chaos.processes import Process
from tests.chaos.services import Postgres, Redis
from tests.chaos.uploads import reader_memory_bytes
from tests.journeys import production
from tests.journeys.production import BIN, GUNICORN, await_that, free_port, get, settings_for
from tests.prepared import static_files

# Seconds. Lease, heartbeat and wall are a tenth of the real ones, so that a run of minutes sees many of them.
PACE = {
    "TSTTC_LEASE_S": "6",
    "TSTTC_HEARTBEAT_S": "2",
    "TSTTC_WALL_S": "30",
    "TSTTC_SWEEP_S": "15",
    "TSTTC_POLL_S": "5",
    "TSTTC_BACKOFF_S": "0.5",
    # One account sends everything.
    "TSTTC_QUOTAS": "0",
}
SPLIT = "test"


class Site:
    """Web, workers, PostgreSQL and Redis of one run."""

    def __init__(self, directory: Path, *, n_workers: int, memory_bytes: int) -> None:
        self.directory = directory
        self.postgres = Postgres(directory)
        self.redis = Redis(directory)
        self.url = f"http://127.0.0.1:{free_port()}"
        self.environment = settings_for(
            directory, url=self.url, postgres_url=self.postgres.url, redis_url=self.redis.url
        )
        self.environment |= {**PACE, "TSTTC_STATIC_ROOT": str(static_files())}
        self.environment["TSTTC_CHILD_MEMORY_BYTES"] = str(memory_bytes)
        self.web = self._process("web", GUNICORN)
        celery = [str(BIN / "celery"), "--app=leaderboard"]
        options = ["--concurrency=2", "--without-gossip", "--without-mingle", "--loglevel=info"]
        self.workers = [
            self._process(f"worker-{i}", [*celery, "worker", f"--hostname=worker-{i}@%h", *options])
            for i in range(n_workers)
        ]

    @property
    def processes(self) -> list[Process]:
        return [self.web, *self.workers]

    def _process(self, name: str, command: Sequence[str]) -> Process:
        return Process(name, command, directory=self.directory, environment=self.environment)

    def manage(self, *arguments: str) -> str:
        here = production.Site(url=self.url, directory=self.directory, environment=self.environment)
        return here.manage(*arguments)

    def answers(self) -> bool:
        """Whether a web process serves at the moment, and the database with it."""
        try:
            return get(f"{self.url}/api/v1/splits").status_code == 200
        except httpx2.TransportError:
            return False


@contextmanager
def running_site(directory: Path, *, truth: evaluator.GroundTruth, n_workers: int) -> Iterator[Site]:
    """A site whose split `test` is open; everything that was started ends with the context."""
    memory_bytes = reader_memory_bytes(truth, directory=directory)
    site = Site(directory, n_workers=n_workers, memory_bytes=memory_bytes)
    with ExitStack() as ends:
        ends.callback(site.postgres.end)
        ends.callback(site.redis.server.ask_to_end)
        for process in site.processes:
            ends.callback(process.kill_if_started)
        site.postgres.start()
        site.redis.start()
        site.postgres.fill()
        table = directory / "truth.csv"
        table.write_bytes(truth.to_csv())
        site.manage("import_truth", SPLIT, str(table))
        for process in site.processes:
            process.start()
        await_that(site.answers, what="the web server answers")
        yield site
