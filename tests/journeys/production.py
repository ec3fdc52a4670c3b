"""The leaderboard as it runs in production, started by a test: web and worker as processes of their own."""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

import httpx2

from tests.prepared import static_files
from tests.services import environment_of_its_own, free_port
from tests.signals import default_signals

REPOSITORY = Path(__file__).resolve().parents[2]
BIN = Path(sys.executable).parent
# For what must come: a busy machine is no fault, so only a hung one ends the wait.
TIMEOUT_S = 180.0
POLL_S = 0.05


class NeverHappened(AssertionError):
    """What was waited for did not happen in time."""


def await_that(condition: Callable[[], bool], *, what: str, timeout_s: float = TIMEOUT_S) -> None:
    """Return as soon as the condition holds; it is asked from outside, so there is no event to wait for."""
    deadline_s = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() > deadline_s:
            raise NeverHappened(f"{what}: not within {timeout_s:g} s")
        time.sleep(POLL_S)


def get(url: str, **headers: str) -> httpx2.Response:
    """The answer at an address, within `TIMEOUT_S`; no proxy is asked on the way."""
    return httpx2.get(url, headers=headers, timeout=TIMEOUT_S, trust_env=False)


@dataclass(frozen=True)
class Site:
    url: str
    directory: Path
    environment: dict[str, str]
    processes: dict[str, subprocess.Popen[bytes]] = field(default_factory=dict)

    def manage(self, *arguments: str) -> str:
        """Run a management command, as a maintainer would; returns what it printed."""
        done = subprocess.run(
            [sys.executable, "manage.py", *arguments],
            cwd=REPOSITORY,
            env=self.environment,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    @property
    def mails(self) -> list[str]:
        """Every mail sent so far, oldest first."""
        files = sorted((self.directory / "mail").glob("*.log"), key=lambda path: path.stat().st_mtime_ns)
        return [path.read_text() for path in files]


def settings_for(directory: Path, *, url: str, postgres_url: str, redis_url: str) -> dict[str, str]:
    """The environment of a production process that keeps its files below `directory`."""
    return environment_of_its_own() | {
        "TSTTC_PROFILE": "production",
        "TSTTC_HTTPS": "0",  # there is no proxy with a certificate in front
        "TSTTC_SECRET_KEY": "a-key-of-this-journey-alone-" + "0123456789" * 3,
        "TSTTC_RECEIPT_KEY": "A" * 43,
        "TSTTC_ALLOWED_HOSTS": "127.0.0.1",
        "TSTTC_SITE_URL": url,
        "TSTTC_DATABASE_URL": postgres_url,
        "TSTTC_BROKER_URL": redis_url,
        "TSTTC_DATA_DIR": str(directory),
        "TSTTC_STATIC_ROOT": str(directory / "static"),
        "TSTTC_EMAIL_URL": f"filemail:///{directory / 'mail'}",
        "TSTTC_QUOTAS": "0",  # one person sends in a minute what a team sends in a year
        "TSTTC_THROTTLES": "0",
        "TSTTC_WEB_BIND": url.removeprefix("http://"),
        "WEB_CONCURRENCY": "2",
        "OPENBLAS_NUM_THREADS": "1",
        "REMAP_SIGTERM": "SIGQUIT",
    }


def guard() -> list[str]:
    """A prefix to a command: the kernel ends it with this run, however that ends, where it can.

    It must be started from a thread that lives as long as the run.
    """
    setpriv = shutil.which("setpriv")
    return [setpriv, "--pdeathsig=KILL", "--"] if setpriv else []


def start(site: Site, name: str, *command: str) -> subprocess.Popen[bytes]:
    """A process of the site, in a session of its own."""
    with (site.directory / f"{name}.log").open("wb") as log, default_signals():
        site.processes[name] = subprocess.Popen(
            [*guard(), *command],
            cwd=REPOSITORY,
            env=site.environment,
            stdout=log,
            stderr=log,
            stdin=subprocess.DEVNULL,
            start_new_session=True,
        )
    return site.processes[name]


def end(process: subprocess.Popen[bytes]) -> None:
    """Ask it to finish, and make it if it does not."""
    process.terminate()
    with suppress(subprocess.TimeoutExpired):
        process.wait(timeout=TIMEOUT_S)
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


@contextmanager
def running(site: Site, name: str, *command: str) -> Iterator[subprocess.Popen[bytes]]:
    """A process of the site while the context lasts."""
    process = start(site, name, *command)
    try:
        yield process
    finally:
        end(process)


GUNICORN = (str(BIN / "gunicorn"), "--config", "deploy/gunicorn.conf.py", "leaderboard.wsgi:application")


@contextmanager
def web_process(
    site: Site, name: str = "web", command: Sequence[str] = GUNICORN
) -> Iterator[subprocess.Popen[bytes]]:
    """The web server of a site, once it answers."""
    with running(site, name, *command) as process:
        await_that(lambda: _answers(site, name), what="the web server answers")
        yield process


def _answers(site: Site, name: str) -> bool:
    assert site.processes[name].poll() is None, (site.directory / f"{name}.log").read_text()
    try:
        return get(f"{site.url}/api/v1/splits").status_code == 200
    except httpx2.TransportError:
        return False


@contextmanager
def production_site(
    directory: Path, *, postgres_url: str, redis_url: str, truth: Path, split: str
) -> Iterator[Site]:
    """On a database with all tables: import the ground truth, start web and worker, and end them."""
    url = f"http://127.0.0.1:{free_port()}"
    environment = settings_for(directory, url=url, postgres_url=postgres_url, redis_url=redis_url)
    environment |= {"TSTTC_STATIC_ROOT": str(static_files())}
    site = Site(url=url, directory=directory, environment=environment)
    (directory / "mail").mkdir()
    site.manage("import_truth", split, str(truth))
    celery = str(BIN / "celery")
    worker = ("worker", "--concurrency=2", "--without-gossip", "--without-mingle", "--loglevel=info")
    with ExitStack() as processes:
        processes.enter_context(running(site, "worker", celery, "--app=leaderboard", *worker))
        processes.enter_context(web_process(site))
        yield site
