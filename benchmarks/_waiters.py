"""Clients that wait for submissions, as `tsttc submit --wait` does: many of them in one process of their own.

`python -m benchmarks._waiters URL FILE SECONDS`: FILE is a JSON list of [submission id, token]. Prints a line
`ready` once each has had its first answer. So many seconds after SIGUSR1, or when all are told that theirs is
final, one line of JSON.
"""

import asyncio
import json
import random
import signal
import sys
from dataclasses import dataclass
from pathlib import Path

import httpx

WAIT_S = 30
RAMP_S = 30.0


@dataclass
class Counts:
    """What happened to all of them together."""

    n_requests: int = 0
    n_turned_away: int = 0
    n_failed: int = 0
    n_begun: int = 0
    n_told: int = 0  # heard that their submission is final


async def wait(http: httpx.AsyncClient, submission_id: str, token: str, counts: Counts) -> None:
    """Ask until it is final, as often as the server says."""
    await asyncio.sleep(random.uniform(0, RAMP_S))
    address, headers = f"/api/v1/submissions/{submission_id}", {"Authorization": f"Bearer {token}"}
    is_first = True
    while True:
        counts.n_requests += 1
        try:
            if is_first:  # the present state first, as a program that has just submitted
                response = await http.get(address, headers=headers)
            else:
                response = await http.get(address, params={"wait": WAIT_S}, headers=headers)
            response.raise_for_status()
        except httpx.HTTPError:
            counts.n_failed += 1
            await asyncio.sleep(1)
            continue
        counts.n_begun += is_first
        is_first = False
        if response.json()["is_final"]:
            counts.n_told += 1
            return
        if "Retry-After" in response.headers:
            counts.n_turned_away += 1
            await asyncio.sleep(float(response.headers["Retry-After"]))


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
    limits = httpx.Limits(max_connections=None, max_keepalive_connections=None)
    async with httpx.AsyncClient(base_url=url, timeout=90, limits=limits, trust_env=False) as http:
        tasks = [asyncio.ensure_future(say_ready(counts, len(waiters)))]
        tasks += [asyncio.ensure_future(wait(http, *waiter, counts)) for waiter in waiters]
        await is_cancelled.wait()
        _, waiting = await asyncio.wait(tasks, timeout=tell_s)
        for task in waiting:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    print(json.dumps(vars(counts)), flush=True)


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1], json.loads(Path(sys.argv[2]).read_text()), tell_s=float(sys.argv[3])))
