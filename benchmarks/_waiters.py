"""Clients that wait for submissions, as `tsttc submit --wait` does: many of them in one process of their own.

They share the machine with the server that is measured. So each writes its request to a socket and reads no
more of the answer than it needs: a whole client would take as much processor as the server does.

`python -m benchmarks._waiters URL FILE SECONDS`: FILE is a JSON list of [submission id, token]. Prints a line
`ready` once each has asked. So many seconds after SIGUSR1, or when all are told that theirs is final, one
line of JSON.
"""

import asyncio
import json
import random
import re
import signal
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

WAIT_S = 30
RAMP_S = 30.0
LENGTH = re.compile(rb"\r\ncontent-length: *(\d+)", re.IGNORECASE)
RETRY_AFTER = re.compile(rb"\r\nretry-after: *(\d+)", re.IGNORECASE)


@dataclass
class Counts:
    """What happened to all of them together."""

    n_requests: int = 0
    n_turned_away: int = 0
    n_failed: int = 0
    n_begun: int = 0
    n_told: int = 0  # heard that their submission is final
    processor_s: float = 0.0  # of this process


class Asker:
    """One client's connection, which it keeps while the server does."""

    def __init__(self, url: str, submission_id: str, token: str) -> None:
        place = urlsplit(url)
        self._host, self._port = str(place.hostname), place.port or 80
        self._request = (
            f"GET /api/v1/submissions/{submission_id}?wait={WAIT_S} HTTP/1.1\r\nHost: {place.netloc}\r\n"
            f"Authorization: Bearer {token}\r\nAccept: application/json\r\n\r\n"
        ).encode()
        self._streams: tuple[asyncio.StreamReader, asyncio.StreamWriter] | None = None
        self.was_kept = False  # the server may close a connection on which nothing was asked for long

    async def ask(self) -> tuple[bytes, bytes]:
        """The head of the answer and its body. Raises OSError or EOFError."""
        self.was_kept = self._streams is not None
        if self._streams is None:
            self._streams = await asyncio.open_connection(self._host, self._port)
        reader, writer = self._streams
        writer.write(self._request)
        head = await reader.readuntil(b"\r\n\r\n")
        length = LENGTH.search(head)
        if not head.startswith(b"HTTP/1.1 200") or length is None:
            raise OSError(head[:60])
        return head, await reader.readexactly(int(length[1]))

    def close(self) -> None:
        """Forget the connection, so that the next question makes a new one."""
        if self._streams is not None:
            self._streams[1].close()
            self._streams = None


async def wait(asker: Asker, counts: Counts) -> None:
    """Ask until it is final, as often as the server says; the answer to the file told the state before."""
    await asyncio.sleep(random.uniform(0, RAMP_S))
    counts.n_begun += 1
    while True:
        counts.n_requests += 1
        try:
            head, body = await asker.ask()
        except (OSError, EOFError):
            counts.n_failed += not asker.was_kept
            asker.close()
            await asyncio.sleep(0.1)
            continue
        if b'"is_final":true' in body:
            counts.n_told += 1
            return
        again = RETRY_AFTER.search(head)
        if again is not None:
            counts.n_turned_away += 1
            await asyncio.sleep(float(again[1]))


async def say_ready(counts: Counts, n: int) -> None:
    """Tell whoever measures that all wait."""
    while counts.n_begun < n:
        await asyncio.sleep(0.1)
    print("ready", flush=True)


async def main(url: str, waiters: list[tuple[str, str]], *, tell_s: float) -> None:
    """All of them at once."""
    counts = Counts()
    is_cancelled = asyncio.Event()
    asyncio.get_running_loop().add_signal_handler(signal.SIGUSR1, is_cancelled.set)
    askers = [Asker(url, *waiter) for waiter in waiters]
    tasks = [asyncio.ensure_future(say_ready(counts, len(waiters)))]
    tasks += [asyncio.ensure_future(wait(asker, counts)) for asker in askers]
    await is_cancelled.wait()
    counts.processor_s = time.process_time()
    _, waiting = await asyncio.wait(tasks, timeout=tell_s)
    for task in waiting:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    for asker in askers:
        asker.close()
    print(json.dumps(vars(counts)), flush=True)


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1], json.loads(Path(sys.argv[2]).read_text()), tell_s=float(sys.argv[3])))
