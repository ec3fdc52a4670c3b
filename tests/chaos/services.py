"""A PostgreSQL cluster and a Redis of a chaos run's own, on ports that were free, to be stopped at will."""

import os
import shutil
import signal
import subprocess
import tempfile
from pathlib import Path

import psycopg
import redis

from tests.chaos.processes import Process
from tests.journeys.production import await_that, free_port
from tests.prepared import dump
from tests.services import ServiceMissing


def postgres_folder() -> Path:
    """Where the newest PostgreSQL's programs are. Raises `ServiceMissing`."""
    folders = sorted(Path("/usr/lib/postgresql").glob("*/bin"), key=lambda path: float(path.parent.name))
    on_path = shutil.which("initdb")
    if folders:
        return folders[-1]
    if on_path:
        return Path(on_path).parent
    raise ServiceMissing("no PostgreSQL server is installed (initdb was not found)")


def redis_program() -> str:
    """The Redis server's program. Raises `ServiceMissing`."""
    program = shutil.which("redis-server")
    if not program:
        raise ServiceMissing("no Redis server is installed (redis-server was not found)")
    return program


class Postgres:
    """A cluster in a temporary folder, removed at the end. It flushes to the disk as in production."""

    def __init__(self, directory: Path) -> None:
        programs = postgres_folder()
        # PostgreSQL refuses to run as root; the folder is then its user's, and not below a private one.
        user = "postgres" if os.geteuid() == 0 else None
        self.port = free_port()
        self._folder = Path(tempfile.mkdtemp(prefix="tsttc-chaos-"))
        data = self._folder / "data"
        if user:
            shutil.chown(self._folder, user, user)
        environment = {name: value for name, value in os.environ.items() if not name.startswith("PG")}
        options = {
            "listen_addresses": "127.0.0.1",
            "unix_socket_directories": "",
            "log_min_messages": "warning",
        }
        command = [str(programs / "postgres"), "-D", str(data), "-p", str(self.port)]
        for name, value in options.items():
            command += ["-c", f"{name}={value}"]
        subprocess.run(
            [
                programs / "initdb",
                "-D",
                data,
                "-U",
                "postgres",
                "-A",
                "trust",
                "-E",
                "UTF8",
                "--locale=C.UTF-8",
            ],
            user=user,
            cwd=self._folder,
            check=True,
            stdout=subprocess.DEVNULL,
        )
        self._server = Process("postgres", command, directory=directory, environment=environment, user=user)

    @property
    def url(self) -> str:
        """Of the database that the site uses."""
        return f"postgres://postgres@127.0.0.1:{self.port}/postgres"

    def connect(self) -> "psycopg.Connection[tuple[object, ...]]":
        """A connection past the site."""
        return psycopg.connect(self.url, autocommit=True, connect_timeout=60)

    def start(self) -> None:
        self._server.start()
        await_that(self._answers, what="PostgreSQL answers")

    def fill(self) -> None:
        """Make all tables. Raises `ServiceMissing`."""
        command = [
            "psql",
            "--quiet",
            "--set=ON_ERROR_STOP=1",
            "--output=/dev/null",
            "--file",
            dump(),
            self.url,
        ]
        subprocess.run(command, check=True)

    def stop(self, *, crash: bool = False) -> None:
        """Break all connections and end it; with `crash`, as if it had died, writing nothing down."""
        os.kill(self._server.pid, signal.SIGQUIT if crash else signal.SIGINT)
        self._server.wait()

    def end(self) -> None:
        """Stop it for good and remove its folder."""
        if self._server.is_alive:
            self.stop()
        shutil.rmtree(self._folder, ignore_errors=True)

    def _answers(self) -> bool:
        try:
            self.connect().close()
        except psycopg.OperationalError:
            if not self._server.is_alive:
                # The last one's processes were still about.
                self._server.start()
            return False
        return True


class Redis:
    """A broker that remembers nothing over a restart."""

    def __init__(self, directory: Path) -> None:
        self.port = free_port()
        command = [redis_program(), "--port", str(self.port), "--bind", "127.0.0.1", "--save", ""]
        command += ["--appendonly", "no", "--dir", str(directory)]
        self.server = Process("redis", command, directory=directory, environment=os.environ)
        self.client = redis.Redis(port=self.port, socket_timeout=60, socket_connect_timeout=60)

    @property
    def url(self) -> str:
        """For Celery."""
        return f"redis://127.0.0.1:{self.port}/0"

    def start(self) -> None:
        self.server.start()
        await_that(self._answers, what="Redis answers")

    def _answers(self) -> bool:
        try:
            return bool(self.client.ping())
        except redis.RedisError:
            return False
