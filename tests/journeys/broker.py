"""Redis as compose starts it, and a client that sees all commands."""

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import redis
import yaml

from tests.journeys.production import await_that, end
from tests.services import REPOSITORY, ServiceMissing, free_port, skip_or_fail

PASSWORD = "sesame"
WATCHER = "user watcher on >watching ~* &* +@all\n"


@dataclass(frozen=True)
class Broker:
    """A running one."""

    port: int

    @property
    def url(self) -> str:
        """For web and workers."""
        return f"redis://tsttc:{PASSWORD}@127.0.0.1:{self.port}/0"

    def client(self, user: str | None, password: str | None) -> "redis.Redis":
        """A connection of an account of it."""
        return redis.Redis(port=self.port, username=user, password=password, decode_responses=True)

    def watcher(self) -> "redis.Redis":
        """A connection with all rights."""
        return self.client("watcher", "watching")


@contextmanager
def broker_of_compose(directory: Path) -> Iterator[Broker]:
    """Started by the script and with the rules of docker-compose.yml."""
    if shutil.which("redis-server") is None:
        skip_or_fail(ServiceMissing("no Redis server is installed (redis-server was not found)"))
    compose = yaml.safe_load((REPOSITORY / "docker-compose.yml").read_text())
    script = compose["services"]["redis"]["command"][-1].replace("$$", "$")
    rules = directory / "rules.acl"
    rules.write_text((REPOSITORY / "deploy/redis.acl").read_text() + WATCHER)
    broker = Broker(free_port())
    script = script.replace("/etc/redis/users.acl", str(rules)).replace("/tmp/", f"{directory}/")
    script = f"{script.rstrip()} --port {broker.port} --bind 127.0.0.1"
    environment = os.environ | {"REDIS_PASSWORD": PASSWORD}
    with (directory / "log").open("wb") as log:
        process = subprocess.Popen(["sh", "-c", script], env=environment, stdout=log, stderr=log)
    try:
        await_that(lambda: _answers(broker), what="Redis answers")
        yield broker
    finally:
        end(process)


def _answers(broker: Broker) -> bool:
    try:
        with broker.watcher() as client:
            return bool(client.ping())
    except redis.ConnectionError:
        return False
