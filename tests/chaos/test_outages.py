"""The services beneath a running site go away: the site says so, or does without."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx2
import numpy as np
import pytest

import evaluator
from tests.chaos.site import SPLIT, Site
from tests.journeys import production
from tests.journeys.production import GUNICORN, TIMEOUT_S, await_that, free_port

pytestmark = [pytest.mark.services, pytest.mark.slow]

FINAL = {"SCORED", "REJECTED", "SYSTEM_ERROR", "CANCELLED"}
Post = Callable[..., httpx2.Response]


@pytest.fixture(scope="module")
def token(site: Site) -> str:
    return site.manage("create_token", "outages@example.org", "--name", "outages").strip()


@pytest.fixture
def http(site: Site, token: str) -> Iterator[httpx2.Client]:
    headers = {"Authorization": f"Bearer {token}"}
    with httpx2.Client(base_url=site.url, headers=headers, timeout=TIMEOUT_S, trust_env=False) as client:
        yield client


def post(http: httpx2.Client, data: bytes, *, method: str = "Foo") -> httpx2.Response:
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


def await_state(http: httpx2.Client, answer: httpx2.Response) -> str:
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
    site: Site, http: httpx2.Client, new_file: Callable[[], bytes]
) -> None:
    site.redis.server.kill()
    try:
        assert await_state(http, post(http, new_file())) == "SCORED"
    finally:
        site.redis.start()


def test_with_a_broker_that_hangs_files_are_taken_and_scored(
    site: Site, http: httpx2.Client, new_file: Callable[[], bytes]
) -> None:
    site.redis.server.send(signal.SIGSTOP)
    try:
        answer = post(http, new_file())
        assert await_state(http, answer) == "SCORED"
    finally:
        site.redis.server.send(signal.SIGCONT)


# --- the database ----------------------------------------------------------------------------------------


def test_without_a_database_the_answer_is_503_on_every_door_and_then_all_is_well(
    site: Site, http: httpx2.Client, new_file: Callable[[], bytes]
) -> None:
    data = new_file()
    assert http.get("/").status_code == 200
    site.postgres.stop(crash=True)
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


def test_worker_that_is_asked_to_stop_finishes_what_it_has_in_hand(
    site: Site, http: httpx2.Client, new_file: Callable[[], bytes]
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


# --- the disk --------------------------------------------------------------------------------------------


@contextmanager
def another_web(site: Site, **environment: str) -> Iterator[str]:
    """The address of a second web server of the site, of one process, that writes no file over 1 MB."""
    url = f"http://127.0.0.1:{free_port()}"
    bind = {"TSTTC_WEB_BIND": url.removeprefix("http://"), "WEB_CONCURRENCY": "1"}
    other = production.Site(url, site.directory, site.environment | environment | bind)
    with production.web_process(other, f"web-{url[-5:]}", command=("prlimit", "--fsize=1000000", *GUNICORN)):
        yield url


@pytest.mark.parametrize("where", ["TSTTC_FILES_DIR", "TMPDIR"])
def test_full_disk_is_a_507_and_leaves_no_row(
    site: Site, token: str, new_file: Callable[[], bytes], tmp_path: Path, where: str
) -> None:
    n_before = n_submissions(site)
    too_much = new_file() + b" " * 3_000_000
    with (
        another_web(site, **{where: str(tmp_path)}) as url,
        httpx2.Client(base_url=url, timeout=TIMEOUT_S, trust_env=False) as http,
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
