"""A board of ten thousand entries: how long first readers wait, its sizes, and the memory of the web process.

`python -m benchmarks board_large`
"""

import itertools
import os

import httpx

from benchmarks import board
from benchmarks.board import API, GZIP, asked_ms, filled, memory_mb, print_memory, serving, web_process

N_ENTRIES = int(os.environ.get("BENCH_LARGE_ENTRIES", "10000"))


def main() -> None:
    """Print one line per figure, `name = value unit`."""
    with filled(N_ENTRIES) as (environment, url), serving(environment, url) as process:
        with httpx.Client(base_url=url, trust_env=False, timeout=120) as http:
            print(f"board_large_first_reader = {asked_ms(http):.0f} ms", flush=True)
            print(f"board_large_json_again = {asked_ms(http):.0f} ms")
            page = http.get("/board/test/", headers=GZIP)
            print(f"board_large_page = {1e3 * page.elapsed.total_seconds():.0f} ms")
            print(f"board_large_page_size = {len(page.content) / 1e3:.0f} KB")
            size = len(http.get(API).content)
            print(f"board_large_json_size = {size / 1e6:.1f} MB", flush=True)
            print_growth(http, pid=process.pid)
        print_memory(url, process.pid, name="board_large")


def print_growth(http: httpx.Client, *, pid: int) -> None:
    """What different answers take, beyond the rows that the process has already."""
    web = web_process(pid)
    (web / "clear_refs").write_text("5", encoding="ascii")  # the peak is counted from here on
    before_mb = memory_mb(web, "VmRSS")
    for page, (sort, headers) in itertools.product(range(1, 101, 5), [("mid", GZIP), ("-rte", {})]):
        http.get("/board/test/", params={"page": page, "sort": sort}, headers=headers).raise_for_status()
    for headers in (GZIP, {}):
        for path in (API, f"{API}?sort=-rte", "/board/test.csv"):
            http.get(path, headers=headers).raise_for_status()
    print(f"board_large_growth_of_46_answers = {memory_mb(web, 'VmHWM') - before_mb:.0f} MB", flush=True)


if __name__ == "__main__":
    board.N_ENTRIES = N_ENTRIES
    main()
