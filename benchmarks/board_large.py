"""A board of ten thousand entries: how long first readers wait, its sizes, and the memory of the web process.

`python -m benchmarks board_large`
"""

import os

import httpx

from benchmarks import board
from benchmarks.board import API, GZIP, asked_ms, filled, print_memory, serving

N_ENTRIES = int(os.environ.get("BENCH_LARGE_ENTRIES", "10000"))


def main() -> None:
    """Print one line per figure, `name = value unit`."""
    with filled(N_ENTRIES) as (environment, url), serving(environment, url) as process:
        with httpx.Client(base_url=url, trust_env=False, timeout=120) as http:
            print(f"board_large_first_reader_without_workers = {asked_ms(http):.0f} ms", flush=True)
            print(f"board_large_json_again = {asked_ms(http):.0f} ms")
            page = http.get("/board/test/", headers=GZIP)
            print(f"board_large_page = {1e3 * page.elapsed.total_seconds():.0f} ms")
            print(f"board_large_page_size = {len(page.content) / 1e3:.0f} KB")
            size = len(http.get(API).content)
            print(f"board_large_json_size = {size / 1e6:.1f} MB", flush=True)
        print_memory(url, process.pid, name="board_large")


if __name__ == "__main__":
    board.N_ENTRIES = N_ENTRIES
    main()
