"""What the project exists for, on the real thing: a prediction file in, a ranked board out.

Real processes (gunicorn, a Celery worker), a real PostgreSQL and a real Redis; the people use forms
and the programs use tokens. Meanwhile an operator sees probes, figures, and logs that follow a submission.
"""

import json
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import psycopg
import pytest
import redis

import evaluator
from tests.journeys.broker import PASSWORD as PASSWORD_OF_REDIS
from tests.journeys.broker import Broker
from tests.journeys.people import PASSWORD, Program, Visitor
from tests.journeys.production import REPOSITORY, Site, await_that, free_port, get
from tests.prepared import migrated_database
from tests.security import canaries
from tests.security.crawler import crawl

pytestmark = [pytest.mark.services, pytest.mark.slow]

FACTORS = "SELECT user_id, type, data, created_at FROM mfa_authenticator ORDER BY id"
People = Callable[[Site], Visitor]
Programs = Callable[[Site, str], Program]


def predictions(truth: evaluator.GroundTruth, *, factor: float) -> bytes:
    """A file whose every time to contact is wrong by the same factor."""
    return evaluator.write_predictions(manifest=truth.manifest, ttc_s=truth.ttc_s * factor)


def offline(data: bytes, truth: evaluator.GroundTruth) -> dict[str, float | None]:
    """The ten published numbers as the evaluator alone gives them."""
    report = evaluator.evaluate(evaluator.read_predictions(data, manifest=truth.manifest), truth)
    scores = {}
    for name in evaluator.SCORE_NAMES:
        metric, _, range_name = name.partition("_")
        scores[name] = evaluator.rounded(getattr(report.scores[range_name or "overall"], metric), decimals=1)
    return scores


def test_a_person_signs_up_uploads_is_scored_and_sees_the_rank(
    site: Site, people: People, programs: Programs, truth: evaluator.GroundTruth
) -> None:
    data = predictions(truth, factor=1.01)
    ada = people(site)
    ada.sign_up(email="ada@example.org", name="Team Ada")

    submission = ada.submit(split="test", method="Counting frames", data=data, description="Frame by frame.")
    program = programs(site, "ada@example.org")
    outcome = program.outcome(submission)

    assert outcome["state"] == "SCORED"
    assert outcome["scores"] == offline(data, truth)
    assert "Counting frames" not in people(site).text_of("/board/test/")
    ada.show(submission)
    entries = program.board("test")
    mine = next(entry for entry in entries if entry["method"] == "Counting frames")
    assert (mine["rank"], mine["team"], mine["kind"]) == (1, "Team Ada", "submission")
    assert mine["scores"] == outcome["scores"]
    # The rows printed in the paper stand below it, in the order of their own numbers.
    published = [entry for entry in entries if entry["kind"] == "published"]
    assert [entry["rank"] for entry in published] == sorted(entry["rank"] for entry in published)
    assert len(published) == 5
    assert published[0]["rank"] == 2
    page = people(site).text_of("/board/test/")
    assert "Counting frames" in page
    assert f"{outcome['scores']['mid']:.1f}" in page


def test_a_file_with_faults_is_rejected_with_their_list_and_the_next_good_one_is_scored(
    site: Site, people: People, programs: Programs, truth: evaluator.GroundTruth
) -> None:
    grace = people(site)
    grace.sign_up(email="grace@example.org", name="Team Grace")
    program = programs(site, "grace@example.org")
    before = program.board("test")

    rejected = grace.submit(split="test", method="Nanoseconds", data=b'{"0": 1.5, "1": NaN, "2": "three"}')
    outcome = program.outcome(rejected)

    assert outcome["state"] == "REJECTED"
    assert outcome["scores"] is None
    assert {"nan", "not-a-number", "missing-keys"} <= {problem["code"] for problem in outcome["problems"]}
    page = grace.text_of(f"/submissions/{rejected}/")
    assert all(problem["message"] in page for problem in outcome["problems"])
    assert program.board("test") == before

    data = predictions(truth, factor=0.9)
    accepted = program.submit(split="test", method="Nanoseconds", data=data)
    assert program.outcome(accepted)["scores"] == offline(data, truth)


def test_the_check_that_containers_use_finds_the_web_process_alive(site: Site) -> None:
    command = [sys.executable, "deploy/healthcheck.py"]
    alive = subprocess.run(command, cwd=REPOSITORY, env=site.environment, capture_output=True, check=False)
    assert alive.returncode == 0, alive.stderr
    elsewhere = site.environment | {"TSTTC_WEB_BIND": f"127.0.0.1:{free_port()}"}
    dead = subprocess.run(command, cwd=REPOSITORY, env=elsewhere, capture_output=True, check=False)
    assert dead.returncode == 1


# --- what an operator sees ---------------------------------------------------------------------------------


def lines(site: Site, name: str) -> list[dict[str, Any]]:
    """A process's log as far as it is written.

    A line that is no JSON fails the test, but for Celery's greeting at a terminal.
    """
    text = (site.directory / f"{name}.log").read_text().rpartition("\n")[0].splitlines()
    return [json.loads(line) for line in text if name == "web" or line.startswith("{")]


def log_line(site: Site, name: str, event: str, submission: str) -> dict[str, Any]:
    """Wait for the one log line of a process about this event of a submission."""
    matches: list[dict[str, Any]] = []

    def is_written() -> bool:
        matches[:] = [line for line in lines(site, name) if line.get("submission_id") == submission]
        matches[:] = [line for line in matches if line["event"] == event]
        return bool(matches)

    await_that(is_written, what=f"{name} says {event}")
    [line] = matches
    return line


def test_a_submission_can_be_followed_through_every_process_and_nothing_secret_is_written(
    site: Site, people: People, programs: Programs, truth: evaluator.GroundTruth
) -> None:
    eve = people(site)
    eve.sign_up(email="eve@example.org", name="Eve and company")
    eve.get("/accounts/password/reset/key/4-c2hhcmVk-secret/")
    eve.get("/board/test/?sort=-mid&looking=for-something")
    data = predictions(truth, factor=1.07)
    program = programs(site, "eve@example.org")
    submission = program.submit(split="test", method="Followed", data=data)
    assert program.outcome(submission)["state"] == "SCORED"

    queued = log_line(site, "web", "evaluation_queued", submission)
    finished = log_line(site, "worker", "evaluation_finished", submission)
    assert finished["evaluation_id"] == queued["evaluation_id"]
    assert finished["status"] == "SCORED"
    if "task_id" in finished:  # found by the message, and not by the worker's own look
        assert finished["request_id"] == queued["request_id"]

    text = "".join(path.read_text() for path in site.directory.glob("*.log"))
    token = str(program.http.headers["Authorization"]).removeprefix("Bearer ")
    secrets = [token, token[-40:], PASSWORD, "@example.org", "c2hhcmVk-secret", "for-something"]
    assert [secret for secret in secrets if secret in text] == []


def test_no_value_of_the_ground_truth_leaves_the_workers(
    site: Site, broker: Broker, people: People, programs: Programs, truth: evaluator.GroundTruth
) -> None:
    pia = people(site)
    with recorded_traffic(broker) as traffic:
        pia.sign_up(email="pia@example.org", name="Pia")
        good = predictions(truth, factor=1.23)
        sent = [
            pia.submit(split="test", method="Canary", data=data) for data in (good, good[:-400], good + b" ")
        ]
        program = programs(site, "pia@example.org")
        assert {program.outcome(pk)["state"] for pk in sent} == {"SCORED", "REJECTED"}
    board = ["/api/v1/splits/test/board", "/api/v1/splits/test/manifest", "/board/test/"]
    start = [*board, *(f"/submissions/{pk}/" for pk in sent)]
    answers = crawl(lambda path: pia.http.get(path).content, start=start, limit=60)
    database = site.environment["TSTTC_DATABASE_URL"]
    dump = subprocess.run(["pg_dump", database], capture_output=True, check=True).stdout
    kept = canaries.files_below(site.directory, but=site.directory / "ground-truth")
    table = kept.pop("truth.csv")
    haystacks = {**answers, **kept, "dump": dump, "what was sent to Redis": b"".join(traffic)}
    assert b"leaderboard_score" in dump
    assert b"leaderboard.tasks.nudge" in haystacks["what was sent to Redis"]
    assert {"web.log", "worker.log"} <= set(haystacks)
    search = canaries.Search(truth.ttc_s.tolist())
    assert search.in_all(haystacks) == []
    assert search.in_bytes(table, where="the table itself")


@contextmanager
def recorded_traffic(broker: Broker) -> Iterator[list[bytes]]:
    """Record everything that clients send to the broker meanwhile."""
    chunks: list[bytes] = []
    with socket.create_connection(("127.0.0.1", broker.port)) as connection:

        def listen() -> None:
            while chunk := connection.recv(1 << 16):
                chunks.append(chunk)

        connection.sendall(b"AUTH watcher watching\r\nMONITOR\r\n")
        thread = threading.Thread(target=listen, daemon=True)
        thread.start()
        yield chunks
        connection.shutdown(socket.SHUT_RDWR)
        thread.join()


PING = "from celery import current_app; print(current_app.control.inspect(timeout=60, limit=1).ping())"
# Programs in Redis, its settings, its files, the connections and keys of others.
REFUSED = (
    *("EVAL return(1) 0", "EVALSHA e0e1f9fabfc9d4800c877a703b823ac0578ff8db 0", "SCRIPT LOAD return(1)"),
    *("FUNCTION LIST", "FCALL f 0", "CONFIG GET dir", "CONFIG SET dir /tmp", "MODULE LIST", "FLUSHALL"),
    *("KEYS *", "RESTORE key 0 x", "REPLICAOF 127.0.0.1 1", "CLIENT LIST", "MONITOR", "SHUTDOWN"),
    *("ACL LIST", "SET key value"),
)


def test_the_account_of_the_application_can_do_in_redis_what_it_needs_and_nothing_else(
    site: Site, broker: Broker
) -> None:
    # As the health check of compose asks, over channels of all workers.
    assert "pong" in site.manage("shell", "-v0", "-c", PING)
    with broker.watcher() as watcher:
        await_that(lambda: watcher.llen("celery") == 0, what="the worker took every message")
        assert [refused["object"] for refused in watcher.acl_log()] == []
    with broker.client("tsttc", PASSWORD_OF_REDIS) as client:
        for command in REFUSED:
            with pytest.raises(redis.exceptions.NoPermissionError):
                client.execute_command(*command.split())
        assert client.ping()
    with broker.client(None, None) as anybody, pytest.raises(redis.exceptions.AuthenticationError):
        anybody.ping()


def test_a_working_site_says_so_and_a_stranger_reads_no_figures_through_a_proxy(site: Site) -> None:
    assert get(f"{site.url}/healthz").json() == {"status": "alive"}
    # The first sweep comes some seconds after the workers.
    await_that(lambda: get(f"{site.url}/healthy").status_code == 200, what="the site is ready")
    assert "\ntsttc_last_sweep_age_seconds " in get(f"{site.url}/metrics").text
    for header in ("X-Forwarded-For", "Forwarded", "X-Real-IP", "X-Forwarded-Proto"):
        assert get(f"{site.url}/metrics", **{header: "127.0.0.1"}).status_code == 403


def test_a_backup_of_the_running_site_comes_back_byte_for_byte_on_a_fresh_site(
    site: Site, people: People, truth: evaluator.GroundTruth, tmp_path: Path
) -> None:
    folder = tmp_path / "backup"
    gil = people(site)
    gil.sign_up(email="gil@example.org", name="Gil")
    gil.submit(split="test", method="Kept", data=predictions(truth, factor=1.2))
    with psycopg.connect(site.environment["TSTTC_DATABASE_URL"]) as database:
        database.execute(
            "INSERT INTO mfa_authenticator (user_id, type, data, created_at) SELECT id, 'totp', "
            """'{"secret": "%s"}', now() FROM leaderboard_user WHERE email = 'gil@example.org'""" % ("A" * 32)
        )
        factors = database.execute(FACTORS).fetchall()
    assert len(factors) == 1
    assert " 1 board;" in site.manage("backup", str(folder))
    kept = json.loads((folder / "backup.json").read_text())
    files = site.directory / "files"
    sent = {path.relative_to(files).as_posix() for path in files.glob("predictions/**/*.json")}
    assert sent
    assert {name for name in kept["files"] if name.startswith("predictions/")} == sent
    assert kept["faults"] == {}
    with migrated_database() as url:
        target = {"TSTTC_DATABASE_URL": url, "TSTTC_DATA_DIR": str(tmp_path / "new")}
        output = replace(site, environment=site.environment | target).manage("restore", str(folder))
        with psycopg.connect(url) as database:
            assert database.execute(FACTORS).fetchall() == factors
    # It holds every file, the audit log and each published board against the backup, and fails otherwise.
    assert "1 board is the same byte for byte" in output
    assert "cannot be checked here" not in output
