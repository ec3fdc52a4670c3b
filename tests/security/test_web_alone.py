"""A real web process that has no ground truth: everything works, whatever is sent, and it does not grow."""

import json
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import httpx2
import pytest

import evaluator
from tests import builders
from tests.journeys.production import TIMEOUT_S, Site, free_port, web_process
from tests.prepared import put_sqlite, static_files
from tests.security.crawler import crawl
from tests.security.hostile_files import corpus
from tests.security.hostile_names import NAMES
from tests.services import environment_of_its_own

pytestmark = pytest.mark.slow
MAX_GROWTH_MB = 64
# Every third in the suite, which other tests send all of.
NAMES_SENT = NAMES if os.environ.get("TSTTC_SECURITY_WHOLE") == "1" else NAMES[::3]
SET_UP = """
import json, sys
from django.core.management import call_command
from django.utils import timezone
call_command("import_truth", "test", {truth!r}, stdout=sys.stderr)
from leaderboard.models import User
from leaderboard.people import teams, tokens
user = User.objects.create_user("owner@example.org", "correct horse", name="Owls")
teams.team_of(user=user)
print(json.dumps(tokens.create(user=user, name="CI", now=timezone.now())))
"""


@dataclass(frozen=True)
class Alone:
    """The site, with the number of its one web process, and a good file."""

    site: Site
    pid: int
    token: str
    good: bytes

    def client(self) -> httpx2.Client:
        headers = {"Authorization": f"Bearer {self.token}"}
        return httpx2.Client(base_url=self.site.url, headers=headers, timeout=TIMEOUT_S, trust_env=False)

    def memory_mb(self, what: str) -> float:
        """`VmRSS`: what the process has in memory now; `VmHWM`: the most that it ever had."""
        status = Path(f"/proc/{self.pid}/status").read_text()
        line = next(line for line in status.splitlines() if line.startswith(what))
        return int(line.split()[1]) / 1024


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Alone]:
    """gunicorn with one process, without the path of the private directory."""
    directory = tmp_path_factory.mktemp("alone")
    url = f"http://127.0.0.1:{free_port()}"
    maintainers = environment_of_its_own() | {
        "DJANGO_SETTINGS_MODULE": "leaderboard.settings",
        "TSTTC_DATA_DIR": str(directory / "data"),
        "TSTTC_GROUND_TRUTH_DIR": str(directory / "private"),
        "TSTTC_STATIC_ROOT": str(static_files()),
        "TSTTC_SITE_URL": url,
        "TSTTC_WEB_BIND": url.removeprefix("http://"),
        "TSTTC_LOG_LEVEL": "WARNING",
        "TSTTC_QUOTAS": "0",
        "TSTTC_THROTTLES": "0",
        "WEB_CONCURRENCY": "1",
    }
    keeper = Site(url=url, directory=directory, environment=maintainers)
    (directory / "data").mkdir()
    put_sqlite(directory / "data" / "leaderboard.sqlite3")
    builders.truth_csv(directory / "truth.csv")
    output = keeper.manage("shell", "-v0", "-c", SET_UP.format(truth=str(directory / "truth.csv")))
    token = json.loads(output.splitlines()[-1])
    webs = maintainers | {"TSTTC_GROUND_TRUTH_DIR": str(directory / "not-there")}
    site = Site(url=url, directory=directory, environment=webs)
    truth = evaluator.read_truth(directory / "truth.csv")
    good = evaluator.write_predictions(manifest=truth.manifest, ttc_s=truth.ttc_s * 1.1)
    with web_process(site) as process:
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        yield Alone(site=site, pid=int(children[0]), token=token, good=good)


def send(client: httpx2.Client, data: bytes, *, method: str = "Foo", **fields: str) -> httpx2.Response:
    form = {"split": "test", "method": method, **fields}
    files = {"file": ("predictions.json", data, "application/json")}
    return client.post("/api/v1/submissions", data=form, files=files)


def test_pages_and_uploads_need_no_ground_truth(alone: Alone) -> None:
    with alone.client() as client:
        answer = send(client, alone.good)
        assert answer.status_code == 201, answer.text
        statuses: dict[str, int] = {}

        def get(path: str) -> bytes:
            answer = client.get(path)
            statuses[path] = answer.status_code
            return answer.content

        api = ("splits", "splits/test/manifest", "splits/test/board", "schema")
        start = ["/", "/board/test/", "/docs/", *(f"/api/v1/{name}" for name in api)]
        crawl(get, start=[*start, f"/api/v1/submissions/{answer.json()['id']}"], limit=80)
    assert not {path: status for path, status in statuses.items() if status >= 500}
    assert statuses["/api/v1/splits/test/manifest"] == 200
    assert len(statuses) > 30
    assert not (alone.site.directory / "not-there").exists()


PREFIXES = ("/x", "/board", "//evil.example", "/does-not-fit")


@pytest.mark.parametrize("name", ["SCRIPT_NAME", "Script-Name", "PATH_INFO", "X-Forwarded-Prefix"])
def test_no_header_moves_the_site(alone: Alone, name: str) -> None:
    # Without cookies and tokens: what is answered is kept for others. We ask from loopback, as a proxy may.
    with httpx2.Client(base_url=alone.site.url, timeout=TIMEOUT_S, trust_env=False) as client:
        for path in ("/", "/board/test/", "/board/test/?sort=-mid", "/docs/", "/api/v1/splits"):
            for prefix in PREFIXES:
                moved = client.get(path, headers={name: prefix})
                plain = client.get(path)
                assert (moved.status_code, moved.content) == (200, plain.content), (path, prefix)
                assert prefix.encode() + b"/board" not in plain.content
                # Where the header was believed, the page was one below it.
                below = client.get(f"/x{path}", headers={name: prefix})
                assert below.status_code == 404, (path, prefix)


def test_hostile_files_and_names_are_answered_and_leave_no_memory_behind(alone: Alone) -> None:
    counts: dict[int, int] = {}
    with alone.client() as client:
        for n in range(20):
            assert send(client, alone.good + b" " * n, method=f"Warm {n}").status_code in {200, 201}
            assert client.get("/board/test/").status_code == 200
        before_mb = alone.memory_mb("VmRSS")
        for name, make in corpus():
            status = send(client, make(alone.good), method="Hostile").status_code
            assert status in {200, 201, 413}, name
            counts[status] = counts.get(status, 0) + 1
        for name in NAMES_SENT:
            text = name.encode("utf-8", "surrogatepass").decode("latin-1") if _is_broken(name) else name
            answer = send(client, alone.good, method=text, description=text, note=text)
            assert answer.status_code < 500, repr(name)
            counts[answer.status_code] = counts.get(answer.status_code, 0) + 1
    grown_mb = alone.memory_mb("VmRSS") - before_mb
    peak_mb = alone.memory_mb("VmHWM") - before_mb
    print(f"web process: {before_mb:.0f} MB, {grown_mb:+.0f} MB after, {peak_mb:+.0f} MB at most; {counts}")  # noqa: T201 - the figure
    assert grown_mb < MAX_GROWTH_MB
    assert peak_mb < MAX_GROWTH_MB


def _is_broken(text: str) -> bool:
    try:
        text.encode()
    except UnicodeEncodeError:
        return True
    return False
