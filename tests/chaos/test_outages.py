"""The services beneath a running site go away: the site says so, or does without."""

import hashlib
import os
import random
import shutil
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import httpx
import numpy as np
import pytest

import evaluator
from tests.chaos.processes import Process
from tests.chaos.site import SPLIT, Site
from tests.chaos.uploads import Clients, Upload, bomb_file
from tests.journeys.production import BIN, PATIENCE_S, await_that, free_port

pytestmark = [pytest.mark.services, pytest.mark.slow]

FINAL = {"SCORED", "REJECTED", "SYSTEM_ERROR", "CANCELLED"}
Post = Callable[..., httpx.Response]


@pytest.fixture(scope="module")
def token(site: Site) -> str:
    return site.manage("create_token", "outages@example.org", "--name", "outages").strip()


@pytest.fixture
def http(site: Site, token: str) -> Iterator[httpx.Client]:
    headers = {"Authorization": f"Bearer {token}"}
    with httpx.Client(base_url=site.url, headers=headers, timeout=PATIENCE_S, trust_env=False) as client:
        yield client


def post(http: httpx.Client, data: bytes, *, method: str = "Foo") -> httpx.Response:
    return http.post(
        "/api/v1/submissions",
        data={"split": SPLIT, "method": method},
        files={"file": ("predictions.json", data, "application/json")},
    )


@pytest.fixture
def new_file(truth: evaluator.GroundTruth) -> Callable[[], bytes]:
    """Makes a file that nobody has sent before."""
    rng = np.random.default_rng()

    def make() -> bytes:
        ttc_s = truth.ttc_s * np.exp(rng.normal(0.0, 0.2, truth.n_sequences))
        return evaluator.write_predictions(manifest=truth.manifest, ttc_s=ttc_s)

    return make


def await_state(http: httpx.Client, answer: httpx.Response) -> str:
    """The final state of a submission that was answered with 201."""
    assert answer.status_code == 201, answer.text
    address = f"/api/v1/submissions/{answer.json()['id']}"
    states: list[str] = []

    def is_final() -> bool:
        states.append(http.get(address).json()["state"])
        return states[-1] in FINAL

    await_that(is_final, what=f"{address} is decided")
    return states[-1]


def n_submissions(site: Site) -> int:
    with site.postgres.connect() as connection:
        row = connection.execute("SELECT count(*) FROM leaderboard_submission").fetchone()
    assert row is not None
    return int(str(row[0]))


# --- the broker ------------------------------------------------------------------------------------------


def test_without_a_broker_files_are_taken_and_scored(
    site: Site, http: httpx.Client, new_file: Callable[[], bytes]
) -> None:
    site.redis.server.kill()
    try:
        assert await_state(http, post(http, new_file())) == "SCORED"
    finally:
        site.redis.start()


def test_with_a_broker_that_hangs_files_are_taken_and_scored(
    site: Site, http: httpx.Client, new_file: Callable[[], bytes]
) -> None:
    site.redis.server.send(signal.SIGSTOP)
    try:
        answer = post(http, new_file())
        assert await_state(http, answer) == "SCORED"
    finally:
        site.redis.server.send(signal.SIGCONT)


def test_flushed_broker_delays_and_loses_nothing(
    site: Site, http: httpx.Client, new_file: Callable[[], bytes]
) -> None:
    site.workers[0].kill()
    answer = post(http, new_file())
    site.redis.client.flushall()
    site.workers[0].start()
    assert await_state(http, answer) == "SCORED"


# --- the database ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("crash", [False, True], ids=["stopped", "crashed"])
def test_without_a_database_the_answer_is_503_on_every_door_and_then_all_is_well(
    site: Site, http: httpx.Client, new_file: Callable[[], bytes], crash: bool
) -> None:
    data = new_file()
    assert http.get("/").status_code == 200
    site.postgres.stop(crash=crash)
    try:
        for _ in range(8):  # more often than there are connections to find dead
            refused = post(http, data)
            assert refused.status_code == 503, refused.text
            assert refused.headers["Content-Type"] == "application/problem+json"
            assert refused.json()["code"] == "database-unavailable"
            page = http.get("/")
            assert page.status_code == 503
            assert "The database does not answer at the moment" in page.text
    finally:
        site.postgres.start()
    assert await_state(http, post(http, data)) == "SCORED"


# --- the worker ------------------------------------------------------------------------------------------


def test_hostile_file_is_given_up_and_the_next_healthy_one_is_scored(
    http: httpx.Client, new_file: Callable[[], bytes]
) -> None:
    bomb = post(http, bomb_file(0))
    healthy = post(http, new_file())
    assert await_state(http, healthy) == "SCORED"
    assert await_state(http, bomb) == "SYSTEM_ERROR"
    told = http.get(f"/api/v1/submissions/{bomb.json()['id']}").json()
    assert told["fault_is_ours"]
    assert told["scores"] is None
    assert await_state(http, post(http, new_file())) == "SCORED"


def test_worker_that_is_asked_to_stop_finishes_what_it_has_in_hand(
    site: Site, http: httpx.Client, new_file: Callable[[], bytes]
) -> None:
    answers = [post(http, new_file()) for _ in range(6)]
    site.workers[0].ask_to_end()
    with site.postgres.connect() as connection:
        [running] = connection.execute(
            "SELECT count(*) FROM leaderboard_evaluation WHERE status = 'RUNNING'"
        ).fetchall()
    assert running == (0,)
    site.workers[0].start()
    assert {await_state(http, answer) for answer in answers} == {"SCORED"}


# --- the web process -------------------------------------------------------------------------------------


def test_killed_web_processes_leave_no_partial_file_and_no_row_without_its_bytes(
    site: Site, token: str, truth: evaluator.GroundTruth, new_file: Callable[[], bytes]
) -> None:
    clients = Clients(url=site.url, token=token, split=SPLIT)
    rng = random.Random(0)
    uploads: list[Upload] = []
    threads: list[threading.Thread] = []
    n_kills = 0
    while n_kills <= 5 or any(thread.is_alive() for thread in threads):
        if not any(thread.is_alive() for thread in threads):
            # Large, so that most kills meet an upload on its way; each byte of the padding is a valid space.
            numbers = range(len(uploads), len(uploads) + 30)
            more = [Upload(f"killed-{i}", new_file() + b" " * 2_000_000, "SCORED") for i in numbers]
            uploads += more
            threads = clients.start(more, n_clients=4, seconds=8)
        # Dead processes interrupt no uploads: one must be at work again before it is killed.
        site.await_web()
        time.sleep(rng.uniform(0.0, 0.5))
        for pid in site.web.children()[:1]:
            with suppress(ProcessLookupError):  # the former one's, which was just buried
                os.kill(pid, signal.SIGKILL)
                n_kills += 1
    assert not clients.refused
    assert len({receipt.submission_id for receipt in clients.receipts}) == len(uploads)
    kept = {path.stem: path for path in (site.directory / "files" / "predictions").rglob("*.json")}
    for digest, path in kept.items():
        assert hashlib.sha256(path.read_bytes()).hexdigest() == digest
    with site.postgres.connect() as connection:
        rows = connection.execute("SELECT digest FROM leaderboard_submission").fetchall()
    assert {str(digest).removeprefix("sha256:") for (digest,) in rows} <= kept.keys()


# --- the disk --------------------------------------------------------------------------------------------


def mounted(folder: Path) -> list[str]:
    """A command's prefix: the folder is a file system of 1 MB, seen by that command alone."""
    script = 'mount -t tmpfs -o size=1m tmpfs "$0" && exec "$@"'
    return ["unshare", "--mount", "sh", "-c", script, str(folder)]


def limited(folder: Path) -> list[str]:
    """A command's prefix: no file that it writes may be larger than 1 MB."""
    return ["prlimit", "--fsize=1000000"]


@contextmanager
def another_web(site: Site, *, prefix: list[str], **environment: str) -> Iterator[str]:
    """The address of a second web server of the site, of one process, with other directories."""
    url = f"http://127.0.0.1:{free_port()}"
    bind = {"TSTTC_WEB_BIND": url.removeprefix("http://"), "WEB_CONCURRENCY": "1"}
    changed = site.environment | environment | bind
    command = [*prefix, str(BIN / "gunicorn"), "--config", "deploy/gunicorn.conf.py"]
    web = Process(
        f"web-{url[-5:]}",
        [*command, "leaderboard.wsgi:application"],
        directory=site.directory,
        environment=changed,
    )
    web.start()
    try:
        await_that(lambda: answers(url), what="the second web server answers")
        yield url
    finally:
        web.kill()


def answers(url: str) -> bool:
    try:
        return httpx.get(f"{url}/healthz", trust_env=False).status_code == 200
    except httpx.TransportError:
        return False


@pytest.mark.parametrize("means", [mounted, limited])
@pytest.mark.parametrize("where", ["TSTTC_FILES_DIR", "TMPDIR"])
def test_full_disk_is_a_507_and_leaves_no_row(
    site: Site,
    token: str,
    new_file: Callable[[], bytes],
    tmp_path: Path,
    where: str,
    means: Callable[[Path], list[str]],
) -> None:
    prefix = means(tmp_path)
    if shutil.which(prefix[0]) is None or (means is mounted and not may_mount(tmp_path)):
        pytest.skip(f"this machine does not allow {prefix[0]}")
    n_before = n_submissions(site)
    too_much = new_file() + b" " * 3_000_000
    with (
        another_web(site, prefix=prefix, **{where: str(tmp_path)}) as url,
        httpx.Client(base_url=url, timeout=PATIENCE_S, trust_env=False) as http,
    ):
        http.headers["Authorization"] = f"Bearer {token}"
        # gunicorn ends a connection whose body was left unread, and does not say so in the answer: a request
        # that follows on the same connection at once may meet the end.
        http.headers["Connection"] = "close"
        refused = post(http, too_much)
        assert refused.status_code == 507, refused.text
        assert refused.headers["Content-Type"] == "application/problem+json"
        assert refused.json()["code"] == "storage-full"
        assert n_submissions(site) == n_before
        assert post(http, new_file()).status_code == 201
        assert n_submissions(site) == n_before + 1


def may_mount(folder: Path) -> bool:
    """Whether this process may have a file system of its own."""
    probe = Process("probe", [*mounted(folder), "true"], directory=folder.parent, environment=os.environ)
    probe.start()
    probe.wait()
    return probe.returncode == 0
