"""The board of a thousand entries: requests per second beside an empty view of the same server, and sizes.

A gunicorn as in production (one process, so that the load has a processor too), a PostgreSQL and a Redis
database of this run's own; the load is `wrk` (Debian: `apt install wrk`), without which the rates are left
out. What is compared is asked for in turns, several rounds of them, and the ratio is taken within each round:
other work on the machine slows both.

`python -m benchmarks board`
"""

import os
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx

from tests.journeys.production import REPOSITORY, await_that, free_port, settings_for
from tests.services import throwaway_database, throwaway_redis

N_ENTRIES = int(os.environ.get("BENCH_ENTRIES", "1000"))
N_ROUNDS = int(os.environ.get("BENCH_ROUNDS", "4"))
ROUND_S = int(os.environ.get("BENCH_ROUND_S", "1"))
N_CHANGES = 3
API = "/api/v1/splits/test/board"
GZIP = {"Accept-Encoding": "gzip"}


def main() -> None:
    """Print one line per figure, `name = value unit`."""
    with filled(N_ENTRIES) as (environment, url):
        with serving(environment, url) as process:
            measure(url)
            print_memory(url, process.pid, name="board")
        with serving(environment, url):
            print_first_readers(environment, url)


@contextmanager
def filled(n: int) -> Iterator[tuple[dict[str, str], str]]:
    """The settings and the address of a site whose board has `n` entries."""
    with (
        throwaway_database() as postgres_url,
        throwaway_redis() as redis_url,
        tempfile.TemporaryDirectory(prefix="board-") as folder,
    ):
        url = f"http://127.0.0.1:{free_port()}"
        settings = settings_for(Path(folder), url=url, postgres_url=postgres_url, redis_url=redis_url)
        environment = settings | {
            "DJANGO_SETTINGS_MODULE": "benchmarks._board_settings",
            "TSTTC_LOG_LEVEL": "WARNING",
            "WEB_CONCURRENCY": "1",
        }
        run(environment, "manage.py", "migrate", "--no-input", "-v0")
        run(environment, "manage.py", "collectstatic", "--no-input", "-v0")
        run(environment, "-c", _ROWS.format("main"), str(n))
        yield environment, url


_ROWS = "import django; django.setup(); from benchmarks import _board_rows; _board_rows.{}()"


def run(environment: dict[str, str], *arguments: str) -> None:
    """Python, in the checkout, with these settings."""
    subprocess.run([sys.executable, *arguments], cwd=REPOSITORY, env=environment, check=True)


def print_first_readers(environment: dict[str, str], url: str) -> None:
    """How long the first reader after a change waits."""
    with httpx.Client(base_url=url, trust_env=False, timeout=60) as http:
        http.get(API)
        first_ms = []
        for _ in range(N_CHANGES):
            run(environment, "-c", _ROWS.format("change"))
            first_ms.append(asked_ms(http))
    print(f"board_first_reader_after_a_change = {statistics.median(first_ms):.0f} ms", flush=True)


def asked_ms(http: httpx.Client) -> float:
    """How long the board's JSON takes, compressed."""
    began_s = time.perf_counter()
    http.get(API, headers=GZIP).raise_for_status()
    return 1e3 * (time.perf_counter() - began_s)


def print_memory(url: str, master: int, *, name: str) -> None:
    """The most memory that the web process has had, once all that it shows of a board was asked for."""
    with httpx.Client(base_url=url, trust_env=False, timeout=60) as http:
        for path in (
            "/board/test/",
            API,
            f"{API}?intervals=1",
            "/board/test.csv",
            "/",
            "/board/test/charts/",
        ):
            for headers in (GZIP, {}):
                http.get(path, headers=headers)
    print(f"{name}_web_peak_memory = {memory_mb(web_process(master), 'VmHWM'):.0f} MB", flush=True)


def web_process(master: int) -> Path:
    """What the kernel says of the process that answers; `master` is the one that has started it."""
    return Path("/proc", Path(f"/proc/{master}/task/{master}/children").read_text().split()[0])


def memory_mb(process: Path, name: str) -> float:
    """VmRSS, what it has, or VmHWM, the most that it has had."""
    lines = (process / "status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(name)) / 1e3


@contextmanager
def serving(environment: dict[str, str], url: str) -> Iterator["subprocess.Popen[bytes]"]:
    """A gunicorn, until the context ends."""
    command = [
        sys.executable,
        "-m",
        "gunicorn",
        "--config",
        "deploy/gunicorn.conf.py",
        "leaderboard.wsgi:application",
    ]
    process = subprocess.Popen(command, cwd=REPOSITORY, env=environment, stderr=subprocess.DEVNULL)

    def answers() -> bool:
        try:
            return httpx.get(f"{url}/healthz", trust_env=False).status_code == 200
        except httpx.TransportError:
            return False

    try:
        await_that(answers, what="gunicorn answers")
        yield process
    finally:
        process.terminate()
        process.wait()


def measure(url: str) -> None:
    """Sizes and first answers, then the rates in turns."""
    with httpx.Client(base_url=url, trust_env=False, timeout=60) as http:
        sizes(http)
        tag = http.get(API, headers=GZIP).headers["ETag"]
    if shutil.which("wrk") is None:
        print("board: the rates are left out, because wrk is not installed; on Debian: apt install wrk")
        return
    targets = {
        "board_empty": ("/empty", GZIP),
        "board_json": (API, GZIP),
        "board_json_uncompressed": (API, {}),
        "board_json_unchanged": (API, {**GZIP, "If-None-Match": tag}),
        "board_page": ("/board/test/", GZIP),
        "board_csv": ("/board/test.csv", GZIP),
    }
    rates: dict[str, list[float]] = {name: [] for name in targets}
    for _ in range(N_ROUNDS):
        for name, (path, headers) in targets.items():
            rates[name].append(rate(url + path, headers))
    for name, found in rates.items():
        print(f"{name} = {statistics.median(found):.0f} requests/s")
    for name in list(targets)[1:]:
        ratios = [one / empty for one, empty in zip(rates[name], rates["board_empty"], strict=True)]
        print(
            f"{name}_of_empty = {statistics.median(ratios):.2f} (from {min(ratios):.2f} to {max(ratios):.2f})"
        )


def sizes(http: httpx.Client) -> None:
    """What the first visit loads: the page, and what it names from this host."""
    with http.stream("GET", "/board/test/", headers=GZIP) as response:
        page = b"".join(response.iter_raw())
    text = http.get("/board/test/").text
    parts = {"page": len(page)}
    for address in dict.fromkeys(re.findall(r'(?:href|src)="(/static/[^"]+)"', text)):
        with http.stream("GET", address, headers=GZIP) as response:
            parts[re.sub(r"\.[0-9a-f]{12}", "", address.rpartition("/")[2])] = len(
                b"".join(response.iter_raw())
            )
    for name, n_bytes in parts.items():
        print(f"board_first_visit_{name} = {n_bytes / 1e3:.1f} KB")
    print(
        f"board_first_visit = {sum(parts.values()) / 1e3:.1f} KB compressed, {len(text) / 1e3:.0f} KB of HTML"
    )
    with http.stream("GET", API, headers=GZIP) as response:
        packed = len(b"".join(response.iter_raw()))
    whole = len(http.get(API).content)
    print(f"board_json_size = {packed / 1e3:.1f} KB compressed, {whole / 1e3:.0f} KB as it is")


def rate(address: str, headers: dict[str, str]) -> float:
    """Answers per second to four connections that ask without pause."""
    command = [
        "wrk",
        "-t1",
        "-c4",
        f"-d{ROUND_S}s",
        *(f"-H{name}: {value}" for name, value in headers.items()),
    ]
    text = subprocess.run([*command, address], capture_output=True, text=True, check=True).stdout
    if "Non-2xx" in text and "If-None-Match" not in headers:
        sys.exit(f"board: {address} was answered with errors:\n{text}")
    return float(text.partition("Requests/sec:")[2].split()[0])


if __name__ == "__main__":
    main()
