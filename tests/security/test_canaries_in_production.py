"""The same with real processes: web and worker, PostgreSQL, and a Redis whose traffic is kept."""

import codecs
import socket
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import httpx
import pytest
import redis

import evaluator
from tests.journeys.people import Program, Visitor
from tests.journeys.production import Site, await_that, production_site
from tests.prepared import postgres_url
from tests.security import canaries
from tests.security.canaries import Search
from tests.security.crawler import crawl
from tests.services import redis_url

__all__ = ["postgres_url", "redis_url"]
pytestmark = [pytest.mark.slow, pytest.mark.services]

KEEPER = "keeper@example.org"
PASSWORD = "correct horse battery"


class Tap:
    """Everything that any client says to a Redis server, from now on."""

    def __init__(self, url: str) -> None:
        parts = urlsplit(url)
        self._socket = socket.create_connection((parts.hostname or "127.0.0.1", parts.port or 6379))
        self._chunks: list[bytes] = []
        self._socket.sendall(b"MONITOR\r\n")
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def _listen(self) -> None:
        while chunk := self._socket.recv(1 << 16):
            self._chunks.append(chunk)

    def close(self) -> bytes:
        """What was said, as it was written and with its escapes undone."""
        self._socket.shutdown(socket.SHUT_RDWR)
        self._thread.join()
        self._socket.close()
        # Other tests speak to this server as well: the last line may have been cut.
        raw = b"".join(self._chunks).rpartition(b"\n")[0]
        return raw + codecs.escape_decode(raw)[0]  # type: ignore[attr-defined]  # it has no types


def kept_in(url: str) -> bytes:
    """Every key of a Redis database with all that is under it."""
    with redis.Redis.from_url(url) as client:
        found = [part for key in client.scan_iter(count=1000) for part in (key, client.dump(key) or b"")]
        for key in client.scan_iter(count=1000):
            if client.type(key) == b"list":
                found += client.lrange(key, 0, -1)
    return b"\n".join(found)


@contextmanager
def recorded() -> Iterator[dict[str, bytes]]:
    """The body and the headers of every answer to every httpx client that is made meanwhile."""
    answers: dict[str, bytes] = {}
    plain = httpx.Client.send

    def send(self: httpx.Client, request: httpx.Request, **options: object) -> httpx.Response:
        response = plain(self, request, **options)  # type: ignore[arg-type]  # handed through
        response.read()
        name = f"answer {len(answers)}: {request.method} {request.url.path} {response.status_code}"
        answers[name] = response.content + repr(response.headers).encode()
        return response

    httpx.Client.send = send  # type: ignore[method-assign]  # the library's, so that nobody's answer is missed
    try:
        yield answers
    finally:
        httpx.Client.send = plain  # type: ignore[method-assign]  # as it was


def file_for(truth: evaluator.GroundTruth, factor: float) -> bytes:
    return evaluator.write_predictions(manifest=truth.manifest, ttc_s=truth.ttc_s * factor)


def test_no_value_leaves_the_workers(tmp_path: Path, postgres_url: str, redis_url: str) -> None:
    values = canaries.plant(tmp_path / "truth.csv")
    truth = evaluator.read_truth(tmp_path / "truth.csv")
    canaries.corrected(tmp_path / "truth.csv", to=tmp_path / "corrected.csv")
    directory = tmp_path / "site"
    directory.mkdir()
    tap = Tap(redis_url)
    with (
        recorded() as answers,
        production_site(
            directory,
            postgres_url=postgres_url,
            redis_url=redis_url,
            truth=tmp_path / "truth.csv",
            split="test",
        ) as site,
    ):
        owner = Visitor(site)
        owner.sign_up(email="owner@example.org", name="Owls")
        program = Program(site, email="owner@example.org")
        good = [file_for(truth, factor) for factor in (1.07, 1.21)]
        bad = good[0].replace(b'"9":', b'"9":"', 1)
        sent = [owner.submit(split="test", method=f"M{n}", data=data) for n, data in enumerate((*good, bad))]
        sent.append(program.submit(split="test", method="API", data=good[1]))
        states = {program.outcome(pk)["state"] for pk in sent}
        assert states == {"SCORED", "REJECTED"}
        keeper = _keeper(site)
        site.manage("open_edition", "test", "--truth", str(tmp_path / "corrected.csv"))
        rescoring = "/api/v1/splits/test/editions/2/progress"
        await_that(lambda: _is_done(keeper, rescoring), what="the second edition is scored")
        _look(owner, start=_start(sent), limit=90)
        _look(keeper, start=_start(sent), limit=120)
        keeper.post_form("/maintain/test/editions/2/publish/", {"replaces": "1", "reason": "Labels."})
        _look(owner, start=_start(sent), limit=60)
        kept = kept_in(redis_url)
        for client in (owner, keeper, program):
            client.close()
    dump = subprocess.run(["pg_dump", postgres_url], capture_output=True, check=True).stdout
    haystacks = {
        **answers,
        "pg_dump": dump,
        "what was said to Redis": tap.close(),
        "what Redis kept": kept,
        **canaries.files_below(directory, but=directory / "ground-truth"),
    }
    assert b"leaderboard_score" in dump
    assert b"leaderboard.tasks.nudge" in haystacks["what was said to Redis"]
    assert {"web.log", "worker.log"} <= set(haystacks)
    assert len(answers) > 150
    assert Search(values).in_all(haystacks) == []
    private = canaries.files_below(directory / "ground-truth", but=directory / "nowhere")
    assert Search(values).in_all(private)


def _look(visitor: Visitor, *, start: list[str], limit: int) -> None:
    """Let somebody follow every link that they are shown."""

    def get(path: str) -> bytes:
        return visitor.http.get(path).content

    crawl(get, start=start, limit=limit)


def _start(sent: list[str]) -> list[str]:
    split = "/api/v1/splits/test"
    return [
        *("/", "/board/test/", "/submissions/", "/team/", "/maintain/", "/admin/"),
        *("/api/v1/splits", "/api/v1/schema", f"{split}/board", f"{split}/manifest"),
        *(f"{split}/editions/{n}/{what}" for n in (1, 2) for what in ("board", "preview")),
        *("/maintain/test/editions/2/", "/maintain/audit/events.json"),
        *(f"/submissions/{pk}/" for pk in sent),
    ]


def _keeper(site: Site) -> Visitor:
    """A maintainer, signed in."""
    code = (
        "from leaderboard.models import User; from allauth.account.models import EmailAddress; "
        f"u = User.objects.create_superuser({KEEPER!r}, {PASSWORD!r}); "
        "EmailAddress.objects.create(user=u, email=u.email, primary=True, verified=True)"
    )
    site.manage("shell", "-c", code)
    keeper = Visitor(site)
    keeper.post_form("/accounts/login/", {"login": KEEPER, "password": PASSWORD})
    return keeper


def _is_done(keeper: Visitor, path: str) -> bool:
    answer = keeper.http.get(path)
    assert answer.status_code == 200, answer.text
    return bool(answer.json()["n_done"] == answer.json()["n_total"])
