"""The leaderboard as `make demo` runs it, small: SQLite, one web process, one worker."""

import os
import signal
import sqlite3
import sys
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path

import httpx2
import numpy as np

import evaluator
from leaderboard.demo.runs import simulate
from tests.journeys.production import BIN, TIMEOUT_S, Site, end, free_port, start, web_process
from tests.prepared import put_sqlite, static_files

PASSWORD = "kestrel-altimeter-9"
DATABASE = "leaderboard.sqlite3"
# Parts of pages, for a page that is open.
PARTS = ("/state/", "/progress/")
WEB = (sys.executable, "-m", "waitress")
WORKER = (
    *(str(BIN / "celery"), "--app=leaderboard", "worker", "--pool=solo"),
    *("--without-gossip", "--without-mingle", "--without-heartbeat", "--loglevel=info"),
)


def environment(directory: Path, *, url: str, **settings: str) -> dict[str, str]:
    """What the processes read: everything of theirs lies below `directory`, and `settings` besides."""
    inherited = {name: value for name, value in os.environ.items() if not name.startswith("TSTTC_")}
    return inherited | {
        "TSTTC_DATA_DIR": str(directory),
        "TSTTC_STATIC_ROOT": str(static_files()),
        "TSTTC_SITE_URL": url,
        "OPENBLAS_NUM_THREADS": "1",
        **settings,
    }


@contextmanager
def web_alone(directory: Path, **settings: str) -> Iterator[Site]:
    """A migrated site with its web process; nothing is scored until `worker` works."""
    url = f"http://127.0.0.1:{free_port()}"
    site = Site(url=url, directory=directory, environment=environment(directory, url=url, **settings))
    put_sqlite(directory / DATABASE)
    listen = f"--listen={url.removeprefix('http://')}"
    with web_process(site, command=(*WEB, listen, "leaderboard.wsgi:application")), ExitStack() as ends:
        ends.callback(_end_worker, site)
        yield site


@contextmanager
def worker(site: Site) -> Iterator[None]:
    """Let the site's worker score what is queued and what comes, and pause it at the end: a start is slow."""
    if "worker" in site.processes:
        os.killpg(site.processes["worker"].pid, signal.SIGCONT)
    else:
        start(site, "worker", *WORKER)
    try:
        yield
    finally:
        # While this process has the lock of the database, the worker that is stopped has it not.
        with closing(sqlite3.connect(site.directory / DATABASE, timeout=TIMEOUT_S)) as database:
            database.execute("BEGIN IMMEDIATE")
            os.killpg(site.processes["worker"].pid, signal.SIGSTOP)


def _end_worker(site: Site) -> None:
    if "worker" in site.processes:
        os.killpg(site.processes["worker"].pid, signal.SIGCONT)
        end(site.processes["worker"])


def open_split(site: Site, split: str) -> evaluator.GroundTruth:
    """Give a split made-up ground truth: 1,200 sequences in 40 recordings."""
    simulated = simulate(rng=np.random.default_rng([*split.encode()]), n_sequences=1_200, n_recordings=40)
    table = site.directory / f"{split}.csv"
    # No two splits may share a sequence: the site refuses the second.
    table.write_bytes(simulated.to_csv().replace(b"sim-", f"sim-{split}-".encode()))
    truth = evaluator.read_truth(table)
    site.manage("import_truth", split, str(table))
    return truth


def predictions(truth: evaluator.GroundTruth, *, factor: float) -> bytes:
    """A valid file: the truth times a factor."""
    return evaluator.write_predictions(manifest=truth.manifest, ttc_s=truth.ttc_s * factor)


def answered_with_pages(site: Site, candidates: Iterable[str], *, cookies: dict[str, str]) -> list[str]:
    """The addresses that answer with a page to a visitor with these cookies."""
    with httpx2.Client(base_url=site.url, timeout=TIMEOUT_S, trust_env=False, cookies=cookies) as client:
        answers = {address: client.get(address) for address in candidates if not address.endswith(PARTS)}
    return [
        address
        for address, answer in answers.items()
        if answer.status_code == 200 and answer.headers["content-type"].startswith("text/html")
    ]
