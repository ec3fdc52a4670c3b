"""The command that opens an edition, killed in the middle: nothing half-made stays, and it is run again."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import LiteralString

import numpy as np
import psycopg
import pytest

import evaluator
from tests.journeys.production import REPOSITORY, Site, await_that, settings_for
from tests.prepared import migrated_database
from tests.services import ServiceMissing, skip_or_fail, throwaway_redis

pytestmark = [pytest.mark.services, pytest.mark.slow]

N_SUBMISSIONS = 120
# As they are written, and how many ground truths are there when the row is not.
TABLES = {"leaderboard_groundtruth": 1, "leaderboard_edition": 2, "leaderboard_evaluation": 2}
COUNTS = """
SELECT (SELECT count(*) FROM leaderboard_edition), (SELECT count(*) FROM leaderboard_groundtruth),
       count(*), count(DISTINCT submission_id), count(*) FILTER (WHERE status = 'QUEUED')
FROM leaderboard_evaluation e JOIN leaderboard_edition d ON d.id = e.edition_id AND d.number = 2
"""


@pytest.fixture
def site(tmp_path: Path, truth: evaluator.GroundTruth) -> Iterator[Site]:
    """A leaderboard with submissions, on which nobody works at the moment."""
    table = tmp_path / "truth.csv"
    table.write_bytes(truth.to_csv())
    url = "http://127.0.0.1:9"  # nothing is served here
    try:
        with migrated_database() as postgres, throwaway_redis() as redis:
            environment = settings_for(tmp_path, url=url, postgres_url=postgres, redis_url=redis)
            site = Site(url=url, directory=tmp_path, environment=environment)
            site.manage("import_truth", "test", str(table))
            command = [sys.executable, "-m", "tests.crowd", "test", str(N_SUBMISSIONS)]
            subprocess.run(command, cwd=REPOSITORY, env=environment, check=True)
            yield site
    except ServiceMissing as missing:
        skip_or_fail(missing)


@contextmanager
def locked(postgres_url: str, table: str) -> Iterator[None]:
    """Nobody writes to the table meanwhile."""
    with psycopg.connect(postgres_url) as connection:
        connection.execute(f"LOCK TABLE {table} IN SHARE MODE")  # type: ignore[arg-type]  # our own names
        yield
        connection.rollback()


def test_opening_an_edition_is_killed_between_its_rows_and_goes_on_when_it_is_run_again(
    site: Site, truth: evaluator.GroundTruth
) -> None:
    """The row that it waits to write is the one that it never writes; each run goes on from the last one."""
    path = site.directory / "corrected.csv"
    corrected = truth.to_table()
    corrected.ttc_s = np.where(truth.manifest.recording_index == 0, truth.ttc_s * 1.1, truth.ttc_s).tolist()
    path.write_bytes(evaluator.GroundTruth.from_table(corrected).to_csv())
    command = ("open_edition", "test", "--truth", str(path))
    for table, n_truths in TABLES.items():
        killed_before_it_writes(site, table, command)
        assert counts(site) == (1, n_truths, 0, 0, 0), table
    for _ in range(2):
        site.manage(*command)
        assert counts(site) == (2, 2, N_SUBMISSIONS, N_SUBMISSIONS, N_SUBMISSIONS)


def killed_before_it_writes(site: Site, table: str, command: tuple[str, ...]) -> None:
    """Run a management command up to its first row of that table."""

    def waits_for_the_lock() -> bool:
        # Tables have the same number in every copy of one database, and other tests lock theirs meanwhile.
        question = (
            "SELECT count(*) FROM pg_locks JOIN pg_database ON pg_database.oid = pg_locks.database "
            "WHERE NOT granted AND datname = current_database() AND relation = %s::regclass"
        )
        return ask(site, question, table) > 0

    with locked(site.environment["TSTTC_DATABASE_URL"], table):
        opening = subprocess.Popen(
            [sys.executable, "manage.py", *command],
            cwd=REPOSITORY,
            env=site.environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        await_that(waits_for_the_lock, what=f"the command is about to write to {table}")
        os.kill(opening.pid, signal.SIGKILL)
        opening.wait()
    others = "SELECT count(*) - 1 FROM pg_stat_activity WHERE datname = current_database()"
    await_that(lambda: ask(site, others) == 0, what="the database has noticed")


def counts(site: Site) -> tuple[int, ...]:
    with psycopg.connect(site.environment["TSTTC_DATABASE_URL"]) as connection:
        [row] = connection.execute(COUNTS).fetchall()
        return tuple(map(int, row))


def ask(site: Site, question: LiteralString, *parameters: str) -> int:
    """A number from the database."""
    with psycopg.connect(site.environment["TSTTC_DATABASE_URL"]) as connection:
        [[n]] = connection.execute(question, parameters).fetchall()
        return int(n)
