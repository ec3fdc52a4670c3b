"""Real services for tests: where PostgreSQL, Redis and Chromium are, and what happens where they are not.

A test that needs one asks here. What is reachable is used; what is not skips the test with the reason, or
fails it where `TSTTC_REQUIRE_SERVICES=1` says that this machine is meant to have everything.
"""

import atexit
import os
import secrets
import shutil
import socket
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn
from urllib.parse import urlsplit

import psycopg
import pytest
import redis
from psycopg import sql

POSTGRES_ADMIN_URL = os.environ.get("TSTTC_TEST_DATABASE_URL", "postgres://postgres@127.0.0.1:5432/postgres")
REDIS_URL = os.environ.get("TSTTC_TEST_REDIS_URL", "redis://127.0.0.1:6379/15")
REQUIRED = os.environ.get("TSTTC_REQUIRE_SERVICES", "") == "1"
REPOSITORY = Path(__file__).resolve().parent.parent
# Of a server that is there and busy. One that is not there refuses at once.
TIMEOUT_S = 30

# The mark on a Redis database that a test run has taken; it fades if the run dies.
_MARK = "tsttc-test-run"
_MARK_S = 3600
# The number of the lock that a crowd on PostgreSQL holds.
_CROWD = 20230901

# For tests of several writers at once, which SQLite does not have. Their module imports `connection`.
ON_POSTGRESQL = [
    pytest.mark.services,
    pytest.mark.django_db(transaction=True),
    pytest.mark.skipif("connection.vendor != 'postgresql'", reason="runs with: python -m tests.everything"),
]


class ServiceMissing(RuntimeError):
    """A service that a test needs cannot be reached from here."""


def skip_or_fail(missing: ServiceMissing) -> NoReturn:
    """Skip the test, saying what is missing; fail it where services are required."""
    if REQUIRED:
        pytest.fail(f"{missing} (TSTTC_REQUIRE_SERVICES=1)", pytrace=False)
    pytest.skip(str(missing))


def shown(url: str) -> str:
    """A URL without its password, for messages."""
    parts = urlsplit(url)
    return f"{parts.scheme}://{parts.hostname}:{parts.port}{parts.path}"


def check_postgres() -> None:
    """Raise `ServiceMissing` unless the administrative database answers."""
    try:
        psycopg.connect(POSTGRES_ADMIN_URL, connect_timeout=TIMEOUT_S).close()
    except psycopg.OperationalError as fault:
        reason = str(fault).splitlines()[0]
        raise ServiceMissing(
            f"PostgreSQL at {shown(POSTGRES_ADMIN_URL)} is not reachable: {reason}"
        ) from fault


def is_on_test_server(settings: Mapping[str, Any]) -> bool:
    """Whether these settings of a Django connection lead to the server where databases may be made."""
    server = urlsplit(POSTGRES_ADMIN_URL)
    return (settings["HOST"], str(settings["PORT"])) == (server.hostname, str(server.port))


def database_url(name: str) -> str:
    """The URL of a database of this name on the test server."""
    return urlsplit(POSTGRES_ADMIN_URL)._replace(path=f"/{name}").geturl()


@contextmanager
def throwaway_database() -> Iterator[str]:
    """The URL of an empty PostgreSQL database, dropped at the end even if clients are connected.

    Raises `ServiceMissing`.
    """
    check_postgres()
    name = f"tsttc_test_{secrets.token_hex(6)}"
    with psycopg.connect(POSTGRES_ADMIN_URL, autocommit=True) as admin:
        admin.execute(sql.SQL("CREATE DATABASE {}").format(sql.Identifier(name)))
        try:
            yield database_url(name)
        finally:
            admin.execute(sql.SQL("DROP DATABASE {} WITH (FORCE)").format(sql.Identifier(name)))


@contextmanager
def crowd_on_postgres() -> Iterator[None]:
    """One crowd of connections at a time on the test server, whichever process it belongs to."""
    with psycopg.connect(POSTGRES_ADMIN_URL, autocommit=True) as admin:
        # It is let go with the connection.
        admin.execute("SELECT pg_advisory_lock(%s)", [_CROWD])
        yield


@contextmanager
def throwaway_redis() -> Iterator[str]:
    """The URL of an empty Redis database that no other test run uses; emptied again at the end.

    Looks for one downwards from the number in the configured URL. Raises `ServiceMissing`.
    """
    parts = urlsplit(REDIS_URL)
    highest = int(parts.path.strip("/") or 0)
    for number in range(highest, -1, -1):
        url = parts._replace(path=f"/{number}").geturl()
        with redis.Redis.from_url(url, socket_timeout=TIMEOUT_S, socket_connect_timeout=TIMEOUT_S) as client:
            try:
                is_ours = client.dbsize() == 0 and client.set(_MARK, os.getpid(), nx=True, ex=_MARK_S)
            except redis.RedisError as fault:
                raise ServiceMissing(f"Redis at {shown(REDIS_URL)} is not reachable: {fault}") from fault
            if not is_ours:
                continue
            try:
                yield url
            finally:
                client.flushdb()
            return
    raise ServiceMissing(f"Redis at {shown(REDIS_URL)} has no empty database among 0 … {highest}")


def free_port() -> int:
    """A port on loopback that nothing listens on, and that no other process gets while this one lives.

    Its address is taken here and shared: a server that reuses addresses, as they all do, may listen there.
    """
    reserved = socket.socket()
    reserved.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    reserved.bind(("127.0.0.1", 0))
    atexit.register(reserved.close)
    return int(reserved.getsockname()[1])


def chromium() -> str:
    """The path of a Chromium or Chrome. Raises `ServiceMissing`."""
    for name in (os.environ.get("TSTTC_TEST_CHROMIUM", ""), "chromium", "chromium-browser", "google-chrome"):
        path = shutil.which(name) if name else None
        if path:
            return path
    raise ServiceMissing("no Chromium was found on the PATH (TSTTC_TEST_CHROMIUM names one)")


def environment_of_its_own() -> dict[str, str]:
    """The environment of this process without the variables of this project and of Django."""
    ours = ("TSTTC_", "DJANGO_")
    return {name: value for name, value in os.environ.items() if not name.startswith(ours)}


def shared_data() -> Path | None:
    """The folder of data that may be used in place but not copied here; None where it is absent."""
    for candidate in (os.environ.get("TSTTC_SHARED_DATA", ""), REPOSITORY.parent / "shared" / "data"):
        if candidate and (Path(candidate) / "README.md").is_file():
            return Path(candidate)
    return None
