"""A correction while people read and a worker dies: nobody sees anything but a whole board.

Real processes (gunicorn, two Celery workers), a PostgreSQL and a Redis of their own. What every submission
must show in each edition is computed here, by the evaluator alone, so that every number of every answer can
be held against the edition that the answer names.
"""

import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Any

import httpx2
import numpy as np
import pytest

import evaluator
from leaderboard.demo.runs import simulate
from tests import crowd
from tests.chaos.services import postgres_folder, redis_program
from tests.chaos.site import SPLIT, Site, running_site
from tests.journeys.production import REPOSITORY, TIMEOUT_S, await_that
from tests.services import ServiceMissing, skip_or_fail

pytestmark = [pytest.mark.services, pytest.mark.slow]

N_SUBMISSIONS = 300
N_READERS = 4
PUBLISH = f"editions.publish(Edition.objects.get(split={SPLIT!r}, number=2))"
ROLL_BACK = "editions.roll_back()"
BOARD = f"/api/v1/splits/{SPLIT}/board"

Scores = dict[str, float | None]
Expected = Mapping[int, Mapping[str, Scores]]  # edition number → method → the ten numbers


@pytest.fixture(scope="module")
def truth() -> evaluator.GroundTruth:
    return simulate(rng=np.random.default_rng(11), n_sequences=400, n_recordings=25)


@pytest.fixture(scope="module")
def corrected(truth: evaluator.GroundTruth) -> evaluator.GroundTruth:
    """The same sequences; those of every third recording have a longer time to contact."""
    is_changed = truth.manifest.recording_index % 3 == 0
    table = truth.to_table()
    table.ttc_s = np.where(is_changed, truth.ttc_s * 1.1, truth.ttc_s).tolist()
    return evaluator.GroundTruth.from_table(table)


@pytest.fixture(scope="module")
def expected(truth: evaluator.GroundTruth, corrected: evaluator.GroundTruth) -> Expected:
    """What every submission must show, in edition 1 and in edition 2."""
    return {
        number: {
            crowd.method_name(i): crowd.published_scores(truth, i, against=against)
            for i in range(N_SUBMISSIONS)
        }
        for number, against in ((1, truth), (2, corrected))
    }


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory, truth: evaluator.GroundTruth) -> Iterator[Site]:
    """A site with two workers, on whose board all submissions stand."""
    try:
        postgres_folder()
        redis_program()
    except ServiceMissing as missing:
        skip_or_fail(missing)
    with running_site(tmp_path_factory.mktemp("site"), truth=truth, n_workers=2) as running:
        subprocess.run(
            [sys.executable, "-m", "tests.crowd", SPLIT, str(N_SUBMISSIONS)],
            cwd=REPOSITORY,
            env=running.environment,
            check=True,
        )
        await_that(lambda: n_undecided(running) == 0, what="everything is scored in the first edition")
        yield running


def ask(site: Site, question: str) -> int:
    with site.postgres.connect() as connection:
        [row] = connection.execute(question).fetchall()  # type: ignore[call-overload]  # a fixed text
        return int(str(row[0]))


def n_undecided(site: Site) -> int:
    return ask(site, "SELECT count(*) FROM leaderboard_evaluation WHERE status NOT IN ('SCORED', 'REJECTED')")


@dataclass(frozen=True)
class Answer:
    """One answer of the board: when it was asked for and was there, and what it said."""

    reader: int
    asked_s: float
    came_s: float
    edition: int
    methods: frozenset[str]
    faults: tuple[str, ...]


class Readers:
    """People who ask for the board again and again, each as soon as the last answer has come."""

    def __init__(self, site: Site, expected: Expected) -> None:
        self.answers: list[Answer] = []
        self.failures: list[str] = []
        self._site = site
        self._expected = expected
        self._stopping = threading.Event()
        self._threads = [threading.Thread(target=self._read, args=(i,)) for i in range(N_READERS)]

    def __enter__(self) -> "Readers":
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stopping.set()
        for thread in self._threads:
            thread.join()

    def await_answers(self, n: int, *, asked_after_s: float) -> None:
        """Until every reader has had `n` answers to what it asked after that moment."""

        def have_come() -> bool:
            assert not self.failures, self.failures
            late = [answer.reader for answer in self.answers.copy() if answer.asked_s >= asked_after_s]
            return all(late.count(reader) >= n for reader in range(N_READERS))

        await_that(have_come, what=f"every reader has {n} more answers")

    def _read(self, reader: int) -> None:
        with httpx2.Client(base_url=self._site.url, timeout=TIMEOUT_S, trust_env=False) as http:
            while not self._stopping.is_set():
                asked_s = time.monotonic()
                response = http.get(BOARD)
                came_s = time.monotonic()
                if response.status_code != 200:
                    self.failures.append(f"{response.status_code}: {response.text[:200]}")
                    return
                answer = Answer(reader, asked_s, came_s, 0, frozenset(), ())
                self.answers.append(self._judged(answer, response.json()))

    def _judged(self, answer: Answer, board: dict[str, Any]) -> Answer:
        """Every number of the answer, held against those of the edition that it names."""
        shown = {e["method"]: e["scores"] for e in board["entries"] if e["kind"] == "submission"}
        right = self._expected[board["edition"]]
        faults = [
            f"edition {board['edition']}, {method}: {scores}, expected {right.get(method)}"
            for method, scores in shown.items()
            if scores != right.get(method)
        ]
        return replace(answer, edition=board["edition"], methods=frozenset(shown), faults=tuple(faults[:3]))


def timed(act: Callable[[], object]) -> tuple[float, float]:
    began_s = time.monotonic()
    act()
    return began_s, time.monotonic()


def went_back(answers: Sequence[Answer], *, to: int) -> list[tuple[Answer, Answer]]:
    """Pairs of an answer of edition `to`, and a later question that was answered with another edition."""
    first = min((answer for answer in answers if answer.edition == to), key=lambda a: a.came_s)
    return [(first, a) for a in answers if a.edition != to and a.asked_s >= first.came_s]


def test_readers_see_whole_boards_only_and_nothing_is_doubled(
    site: Site, corrected: evaluator.GroundTruth, expected: Expected
) -> None:
    # A number of the wrong edition would show: no submission has the same ten in both.
    assert all(expected[1][method] != expected[2][method] for method in expected[1])
    path = site.directory / "corrected.csv"
    path.write_bytes(corrected.to_csv())

    with Readers(site, expected) as readers:
        readers.await_answers(1, asked_after_s=0)
        for worker in site.workers:
            worker.send(signal.SIGSTOP)
        site.manage("open_edition", SPLIT, "--truth", str(path))
        for worker in site.workers:
            worker.send(signal.SIGCONT)
        await_that(lambda: n_undecided(site) < N_SUBMISSIONS, what="the first are scored anew")
        site.workers[0].kill()
        n_left = n_undecided(site)
        site.workers[0].start()  # as its supervisor does
        readers.await_answers(2, asked_after_s=time.monotonic())
        await_that(lambda: n_undecided(site) == 0, what="everything is decided in both editions")
        before = httpx2.get(site.url + BOARD, trust_env=False, timeout=TIMEOUT_S).content

        forward = timed(lambda: correct(site, PUBLISH))
        readers.await_answers(3, asked_after_s=forward[1])
        back = timed(lambda: correct(site, ROLL_BACK))
        readers.await_answers(3, asked_after_s=back[1])
        after = httpx2.get(site.url + BOARD, trust_env=False, timeout=TIMEOUT_S).content

    assert n_left > 0, "the worker was killed when all was done"
    assert readers.failures == []
    assert_whole_and_in_order(readers.answers, forward=forward, back=back)
    assert after == before
    assert_nothing_doubled(site)


def correct(site: Site, verb: str) -> None:
    site.manage(
        "shell", "-v0", "-c", f"from leaderboard.models import Edition; from tests import editions; {verb}"
    )


def assert_whole_and_in_order(
    answers: Sequence[Answer], *, forward: tuple[float, float], back: tuple[float, float]
) -> None:
    assert [fault for answer in answers for fault in answer.faults] == []
    everybody = {crowd.method_name(i) for i in range(N_SUBMISSIONS)}
    assert [sorted(everybody - answer.methods)[:3] for answer in answers if everybody - answer.methods] == []
    for reader in range(N_READERS):
        own = [answer.edition for answer in answers if answer.reader == reader]
        assert [edition for edition, _ in groupby(own)] == [1, 2, 1]
    assert went_back([answer for answer in answers if answer.asked_s < back[0]], to=2) == []
    assert went_back([answer for answer in answers if answer.asked_s >= forward[1]], to=1) == []
    assert {a.edition for a in answers if a.came_s <= forward[0] or a.asked_s >= back[1]} == {1}
    assert {a.edition for a in answers if a.asked_s >= forward[1] and a.came_s <= back[0]} == {2}


def assert_nothing_doubled(site: Site) -> None:
    """Every submission has one evaluation in each edition, decided once, with ten numbers."""
    n = N_SUBMISSIONS
    evaluations = "FROM leaderboard_evaluation e"
    assert ask(site, f"SELECT count(*) {evaluations} WHERE status = 'SCORED'") == 2 * n
    assert ask(site, f"SELECT count(DISTINCT (submission_id, edition_id)) {evaluations}") == 2 * n
    assert ask(site, "SELECT count(*) FROM leaderboard_score") == 2 * n * len(evaluator.SCORE_NAMES)
    decisions = "FROM leaderboard_auditevent WHERE verb = 'scored'"
    assert ask(site, f"SELECT count(*) {decisions}") == ask(
        site, f"SELECT count(DISTINCT noun_id) {decisions}"
    )
    assert ask(site, f"SELECT count(*) {decisions}") == 2 * n
