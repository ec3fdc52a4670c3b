"""The broker as production has it: one account, which runs no program in Redis and changes nothing of it."""

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack

import pytest
import redis
import yaml

import evaluator
from tests import builders
from tests.journeys.people import Visitor
from tests.journeys.production import Site, await_that, end, production_site
from tests.prepared import migrated_database
from tests.services import REPOSITORY, ServiceMissing, free_port, skip_or_fail

pytestmark = [pytest.mark.slow, pytest.mark.services]
PASSWORD = "sesame"
WATCHER = "user watcher on >watching ~* &* +@all\n"
PING = "from celery import current_app; print(current_app.control.inspect(timeout=60, limit=1).ping())"
# Programs in Redis, its settings, its files, the connections and keys of others.
REFUSED = (
    "EVAL return(1) 0",
    "EVALSHA e0e1f9fabfc9d4800c877a703b823ac0578ff8db 0",
    "SCRIPT LOAD return(1)",
    "FUNCTION LIST",
    "FCALL f 0",
    "CONFIG GET dir",
    "CONFIG SET dir /tmp",
    "MODULE LIST",
    "FLUSHALL",
    "KEYS *",
    "RESTORE key 0 x",
    "REPLICAOF 127.0.0.1 1",
    "CLIENT LIST",
    "MONITOR",
    "SHUTDOWN",
    "ACL LIST",
    "SET key value",
)


@pytest.fixture(scope="module")
def port(tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """Redis as compose starts it, and somebody beside who sees everything."""
    directory, port = tmp_path_factory.mktemp("redis"), free_port()
    if shutil.which("redis-server") is None:
        skip_or_fail(ServiceMissing("no Redis server is installed (redis-server was not found)"))
    compose = yaml.safe_load((REPOSITORY / "docker-compose.yml").read_text())
    script = compose["services"]["redis"]["command"][-1].replace("$$", "$")
    rules = directory / "rules.acl"
    rules.write_text((REPOSITORY / "deploy/redis.acl").read_text() + WATCHER)
    script = script.replace("/etc/redis/users.acl", str(rules)).replace("/tmp/", f"{directory}/")
    script = f"{script.rstrip()} --port {port} --bind 127.0.0.1"
    environment = os.environ | {"REDIS_PASSWORD": PASSWORD}
    with (directory / "log").open("wb") as log:
        process = subprocess.Popen(["sh", "-c", script], env=environment, stdout=log, stderr=log)
    try:
        with watcher(port) as client:
            await_that(lambda: answers(client), what="Redis answers")
        yield port
    finally:
        end(process)


def watcher(port: int) -> redis.Redis:
    return redis.Redis(port=port, username="watcher", password="watching", decode_responses=True)


def answers(client: redis.Redis) -> bool:
    try:
        return bool(client.ping())
    except redis.ConnectionError:
        return False


@pytest.fixture(scope="module")
def site(port: int, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    """Web and worker, signed in to Redis as compose signs them in."""
    directory = tmp_path_factory.mktemp("site")
    builders.truth_csv(directory / "truth.csv")
    with ExitStack() as needed:
        try:
            database = needed.enter_context(migrated_database())
        except ServiceMissing as missing:
            skip_or_fail(missing)
        url = f"redis://tsttc:{PASSWORD}@127.0.0.1:{port}/0"
        truth = directory / "truth.csv"
        yield needed.enter_context(
            production_site(directory, postgres_url=database, redis_url=url, truth=truth, split="test")
        )


def test_a_submission_is_scored_through_a_broker_that_runs_no_programs(site: Site, port: int) -> None:
    truth = evaluator.read_truth(site.directory / "truth.csv")
    data = evaluator.write_predictions(manifest=truth.manifest, ttc_s=truth.ttc_s * 1.1)
    visitor = Visitor(site)
    visitor.sign_up(email="ada@example.org", name="Team Ada")
    submission = visitor.submit(split="test", method="Through the broker", data=data)
    address = f"/api/v1/submissions/{submission}"
    state = ""

    def is_decided() -> bool:
        nonlocal state
        state = visitor.get(address).json()["state"]
        return state in {"SCORED", "REJECTED", "SYSTEM_ERROR"}

    await_that(is_decided, what="the file is scored")
    assert state == "SCORED"
    assert "Through the broker" in visitor.text_of("/board/test/?mine=1")
    visitor.close()
    # As the health check of compose asks, over channels of all workers.
    assert "pong" in site.manage("shell", "-v0", "-c", PING)
    with watcher(port) as client:
        await_that(lambda: client.llen("celery") == 0, what="the worker took every message")
        assert [refused["object"] for refused in client.acl_log()] == []


def test_the_account_of_the_application_runs_nothing_in_redis_and_changes_nothing_of_it(port: int) -> None:
    with redis.Redis(port=port, username="tsttc", password=PASSWORD) as client:
        for command in REFUSED:
            with pytest.raises(redis.exceptions.NoPermissionError):
                client.execute_command(*command.split())
        assert client.ping()
    with redis.Redis(port=port) as anybody, pytest.raises(redis.exceptions.AuthenticationError):
        anybody.ping()
