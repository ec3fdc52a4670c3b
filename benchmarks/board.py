"""The board for anybody: what an answer costs compared with an empty view, and how long a first reader waits.

gunicorn with one process, PostgreSQL, Redis, and no worker. What is compared is asked for in turns. The ratio
is that of the web process's processor time per answer, which is the inverse ratio of requests per second
where this process is the limit; so it holds on a busy machine too. A first reader asks after a change that
everybody must see.
"""

import time
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

import httpx2

from benchmarks._site import QUICK, processor_s, site
from tests.journeys.production import web_process

if TYPE_CHECKING:
    from leaderboard.models import Edition, User

N_ENTRIES = (200, 1_000)
N_ROUNDS = 1 if QUICK else 5
N_PER_ROUND = 50 if QUICK else 300
N_CHANGES = 3
ADDRESSES = {"empty": "/empty", "page": "/board/test/", "json": "/api/v1/splits/test/board"}


def main() -> None:
    """Print one line per figure, `name = value unit`."""
    with site(WEB_CONCURRENCY="1", TSTTC_LOG_LEVEL="WARNING") as made:
        edition, user = prepare(made.directory)
        n_before = 0
        with web_process(made) as process, httpx2.Client(base_url=made.url, trust_env=False) as http:
            for n in N_ENTRIES:
                fill(edition, n=n - n_before, user=user)
                n_before = n
                http.get(ADDRESSES["json"])
                print(f"board.first_reader_{n} = {first_reader_s(http):.3f} s", flush=True)
                if n == N_ENTRIES[0]:
                    compare(http, process.pid)


def prepare(directory: Path) -> "tuple[Edition, User]":
    """An edition of the split `test`, and a person."""
    from leaderboard.models import User  # noqa: PLC0415 - Django is configured only now
    from leaderboard.people import teams  # noqa: PLC0415
    from tests import builders  # noqa: PLC0415

    edition = builders.import_truth(directory)
    user = User.objects.create_user("owner@example.org", "correct horse", name="Owls")
    teams.team_of(user=user)
    return edition, user


def fill(edition: "Edition", *, n: int, user: "User") -> None:
    """Add `n` entries."""
    from tests import board_rows  # noqa: PLC0415

    board_rows.fill(edition, n=n, user=user)


def change() -> None:
    """Change one value that everybody sees: the next reader has to see it."""
    from django.db import transaction  # noqa: PLC0415
    from django.db.models import F  # noqa: PLC0415

    from leaderboard import board_versions  # noqa: PLC0415
    from leaderboard.models import Score  # noqa: PLC0415

    with transaction.atomic():
        first = Score.objects.order_by("pk").values("pk")[:1]
        Score.objects.filter(pk__in=first).update(value=F("value") + 0.01)
        board_versions.bump("test")


def first_reader_s(http: httpx2.Client) -> float:
    """The time of the page and the JSON for the first reader after a change, the longer of both."""
    taken_s = []
    for address in [ADDRESSES["page"], ADDRESSES["json"]]:
        times_s = []
        for _ in range(N_CHANGES):
            change()
            began_s = time.perf_counter()
            http.get(address).raise_for_status()
            times_s.append(time.perf_counter() - began_s)
        taken_s.append(median(times_s))
    return max(taken_s)


def compare(http: httpx2.Client, pid: int) -> None:
    """Processor time per answer, in turns."""
    used_s: dict[str, list[float]] = {name: [] for name in ADDRESSES}
    for _ in range(N_ROUNDS):
        for name, address in ADDRESSES.items():
            http.get(address).raise_for_status()
            before_s = processor_s(pid)
            for _ in range(N_PER_ROUND):
                http.get(address)
            used_s[name].append(processor_s(pid) - before_s)
    empty_s = used_s.pop("empty")
    print(f"board.empty = {1e3 * median(empty_s) / N_PER_ROUND:.2f} ms of a processor")
    for name, spent_s in used_s.items():
        ratios = [empty / spent for empty, spent in zip(empty_s, spent_s, strict=True)]
        print(f"board.{name}_of_empty = {median(ratios):.2f} of the empty view's rate", flush=True)
