"""500 clients that wait for their submissions, and what that costs whoever reads the board meanwhile.

gunicorn as in production (two processes), real PostgreSQL; each waiting client asks `?wait=30`, as `tsttc`
does after the answer to its file, and honours Retry-After. Readers ask for the board as a page and as JSON,
as anybody and signed in, one reader of each kind, who pauses after each answer. Measured without the
waiters, with them, and without them again; of the web processes also how many processors they keep busy. At
the end all submissions are cancelled, and it is counted how many clients are told within some seconds: those
with a place at once, those that were turned away when they ask again, within a minute.
"""

import http.client
import json
import os
import select
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import httpx
import numpy as np

from benchmarks.evaluator import figure
from tests import crowd
from tests.journeys.production import (
    BIN,
    REPOSITORY,
    Site,
    await_that,
    free_port,
    running,
    settings_for,
)
from tests.services import ServiceMissing, throwaway_database, throwaway_redis

N_WAITERS = 500
N_ROWS = 100
READ_S = 8.0
TELL_S = 10.0
PAUSE_S = 0.03


def main() -> None:
    """Measure, and print one line per figure."""
    try:
        with (
            tempfile.TemporaryDirectory() as folder,
            throwaway_database() as postgres,
            throwaway_redis() as redis,
        ):
            url = f"http://127.0.0.1:{free_port()}"
            environment = settings_for(Path(folder), url=url, postgres_url=postgres, redis_url=redis)
            site = Site(url=url, directory=Path(folder), environment=environment)
            (site.directory / "mail").mkdir()
            site.manage("migrate", "--no-input", "--verbosity=0")
            site.manage("collectstatic", "--no-input", "--verbosity=0")
            os.environ.update(environment | {"TSTTC_LOG_LEVEL": "WARNING"})
            os.environ["DJANGO_SETTINGS_MODULE"] = "leaderboard.settings"
            _measure(site)
    except ServiceMissing as missing:
        print(f"waiting is not measured: {missing}")


def _measure(site: Site) -> None:
    import django  # noqa: PLC0415 - its settings are read from the environment, which is known only now

    django.setup()
    waiters, reader = _populate(site.directory)
    gunicorn = (str(BIN / "gunicorn"), "--config", "deploy/gunicorn.conf.py", "leaderboard.wsgi:application")
    with running(site, "web", *gunicorn) as web:
        await_that(lambda: _is_up(site.url), what="the web server answers")
        _read(site.url, reader, stop=_for(3))  # everybody's first question costs more
        with _busy("before", web.pid):
            before = _read(site.url, reader, stop=_for(READ_S))
        _print_phase("before", before)
        with _waiting(site, waiters) as clients:
            with _busy("arriving", web.pid):
                arriving = _read(site.url, reader, stop=_has_said(clients))
            _print_phase("arriving", arriving)
            with _busy("waiting", web.pid):
                during = _read(site.url, reader, stop=_for(READ_S))
            _print_phase("waiting", during)
            figure("waiting", N_WAITERS, "database_connections", _connections(), "")
            _cancel()
            _print_counts(clients)
        after = _read(site.url, reader, stop=_for(READ_S))
    unloaded = {kind: [*before[kind], *after[kind]] for kind in before}
    _print_phase("unloaded", unloaded)
    for name, times in (("arriving", arriving), ("waiting", during)):
        figure("waiting", N_WAITERS, f"board_{name}_p99_ratio", _p99_of(times) / _p99_of(unloaded), "x")


@contextmanager
def _busy(phase: str, master: int) -> Iterator[None]:
    """Print how many processors the web processes have used within."""
    began_s, before_s = time.perf_counter(), _used_s(master)
    yield
    busy = (_used_s(master) - before_s) / (time.perf_counter() - began_s)
    figure("waiting", N_WAITERS, f"web_busy_{phase}", busy, "processors")


def _used_s(master: int) -> float:
    """Processor seconds of the processes of a gunicorn, user and system."""
    ticks = 0
    for child in Path(f"/proc/{master}/task/{master}/children").read_text().split():
        fields = Path(f"/proc/{child}/stat").read_text().rpartition(")")[2].split()
        ticks += int(fields[11]) + int(fields[12])
    return ticks / os.sysconf("SC_CLK_TCK")


def _print_phase(name: str, times: "Times") -> None:
    for kind, values in times.items():
        figure("waiting", N_WAITERS, f"{kind}_{name}_p50", float(np.percentile(values, 50)) * 1e3, "ms")
        figure("waiting", N_WAITERS, f"{kind}_{name}_p99", float(np.percentile(values, 99)) * 1e3, "ms")


def _p99_of(times: "Times") -> float:
    """Of all kinds of questions together."""
    return float(np.percentile(np.concatenate(list(times.values())), 99))


def _print_counts(clients: "subprocess.Popen[str]") -> None:
    """What happened to the clients until some seconds after the last submission was cancelled."""
    clients.send_signal(signal.SIGUSR1)
    counts = json.loads(clients.communicate(timeout=TELL_S + 20)[0].splitlines()[-1])
    figure("waiting", N_WAITERS, "turned_away", 100 * counts["n_turned_away"] / counts["n_requests"], "%")
    figure("waiting", N_WAITERS, "failed", counts["n_failed"], "requests")
    figure(
        "waiting",
        N_WAITERS,
        "client_processor",
        1e3 * counts["processor_s"] / counts["n_requests"],
        "ms/request",
    )
    told = 100 * counts["n_told"] / N_WAITERS
    figure("waiting", N_WAITERS, f"told_within_{TELL_S:g}_s", told, "%")


def _is_up(url: str) -> bool:
    try:
        return httpx.get(f"{url}/healthz", trust_env=False).is_success
    except httpx.TransportError:
        return False


def _populate(directory: Path) -> tuple[list[tuple[str, str]], str]:
    """A board of scored methods, and as many submissions that wait: the id of each with its team's token.

    The last token is that of a reader who has no part in it.
    """
    from django.db import transaction  # noqa: PLC0415 - needs Django, which is set up only now
    from django.utils import timezone  # noqa: PLC0415 - the same

    from leaderboard.models import Membership, Submission, Team, User  # noqa: PLC0415
    from leaderboard.people import tokens  # noqa: PLC0415
    from leaderboard.storage import truth_values  # noqa: PLC0415
    from tests import builders  # noqa: PLC0415

    for split, n in (("test", N_ROWS), ("val", N_WAITERS)):
        builders.score_all()
        edition = builders.import_truth(directory, split=split, seed=n)
        truth = truth_values.load(edition.ground_truth_id)
        crowd.join(split_name=split, truth=truth, n=n, n_files=0)
    now = timezone.now()
    token_of = {}
    with transaction.atomic():
        for number, team in enumerate(Team.objects.all()):
            user = User.objects.create_user(f"member{number}@example.org")
            Membership.objects.create(team=team, user=user, is_owner=True)
            token_of[team.pk] = tokens.create(user=user, name="waiting", now=now)
    waiting = Submission.objects.filter(evaluations__status="QUEUED").select_related("method")
    reader = tokens.create(user=User.objects.create_user("reader@example.org"), name="reading", now=now)
    return [(str(row.pk), token_of[row.method.team_id]) for row in waiting], reader


def _cancel() -> None:
    """End what everybody waits for."""
    from leaderboard.models import Submission, User  # noqa: PLC0415
    from leaderboard.scoring import lifecycle  # noqa: PLC0415 - needs Django

    actor = User.objects.get(email="reader@example.org")
    for submission in Submission.objects.filter(evaluations__status="QUEUED"):
        lifecycle.cancel(submission=submission, actor=actor)


def _connections() -> int:
    """How many connections the web processes and this one hold."""
    from django.db import connection  # noqa: PLC0415 - needs Django

    with connection.cursor() as cursor:
        cursor.execute("SELECT count(*) FROM pg_stat_activity WHERE datname = current_database()")
        return int(cursor.fetchone()[0])


# --- readers ---------------------------------------------------------------------------------------------

Times = dict[str, list[float]]


def _read(url: str, token: str, *, stop: Callable[[], bool]) -> Times:
    """Seconds of each answer, by kind of question, until it is time to stop."""
    signed_in = {"Authorization": f"Bearer {token}"}
    kinds: dict[str, tuple[str, dict[str, str]]] = {
        "page": ("/board/test/", {}),
        "json": ("/api/v1/splits/test/board", {}),
        "json_signed_in": ("/api/v1/splits/test/board", signed_in),
    }
    times: Times = {kind: [] for kind in kinds}
    readers = [
        threading.Thread(target=_reader, args=(url, *kinds[kind], times[kind], stop)) for kind in kinds
    ]
    for reader in readers:
        reader.start()
    for reader in readers:
        reader.join()
    return times


def _reader(
    url: str, path: str, headers: dict[str, str], times: list[float], stop: Callable[[], bool]
) -> None:
    connection = http.client.HTTPConnection(urlsplit(url).netloc, timeout=60)
    while not stop():
        started_s = time.perf_counter()
        connection.request("GET", path, headers=headers)
        response = connection.getresponse()
        response.read()
        assert response.status == 200, response.status
        times.append(time.perf_counter() - started_s)
        time.sleep(PAUSE_S)  # a reader reads; this is the load, not something that is waited for


def _for(seconds: float) -> Callable[[], bool]:
    until_s = time.monotonic() + seconds
    return lambda: time.monotonic() > until_s


@contextmanager
def _waiting(site: Site, waiters: list[tuple[str, str]]) -> Iterator["subprocess.Popen[str]"]:
    """The waiting clients, in a process of their own."""
    path = site.directory / "waiters.json"
    path.write_text(json.dumps(waiters))
    command = [sys.executable, "-m", "benchmarks._waiters", site.url, str(path), str(TELL_S)]
    with subprocess.Popen(command, cwd=REPOSITORY, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


def _has_said(process: "subprocess.Popen[str]") -> Callable[[], bool]:
    """Whether it has printed its first line."""
    assert process.stdout is not None
    stdout = process.stdout
    return lambda: bool(select.select([stdout], [], [], 0)[0])


if __name__ == "__main__":
    main()
