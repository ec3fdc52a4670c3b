"""What can go wrong, gone wrong on purpose: a seeded plan of faults against a running site."""

import heapq
import json
import os
import random
import signal
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from typing import cast

import redis

from tests.chaos.processes import Process, children_of
from tests.chaos.site import Site

KILL_EVERY_S = 2.0
ZOMBIE_S = 9.0  # longer than a lease
QUEUE, UNACKED = "celery", "unacked"  # where Celery keeps messages in Redis
MOMENT_S = 0.5


class Faults:
    """Keeps a site's processes alive while it kills them. One thread does both; `tick` does what is due.

    `rarity` stretches the time between faults, but for the kills of workers, which never become rarer.
    """

    def __init__(self, site: Site, *, rng: random.Random, rarity: float = 1.0) -> None:
        self.counts: Counter[str] = Counter()
        self._site = site
        self._rng = rng
        self._plan: list[tuple[float, int, Callable[[], None]]] = []
        self._n_planned = 0
        self._stopped: dict[Process, float] = {}
        self._is_calm = False
        repeated: list[tuple[float, Callable[[], None]]] = [
            (10.0, self._make_a_zombie),
            (5.0, self._duplicate_messages),
            (3.0, self._drop_messages),
            (11.0, self._flush_the_broker),
            (29.0, self._restart_the_broker),
            (31.0, self._restart_the_database),
            (9.0, self._kill_a_web_process),
        ]
        self._repeat(KILL_EVERY_S, self._kill_a_worker, is_regular=True)
        for period_s, fault in repeated:
            self._repeat(period_s * rarity, fault)

    def tick(self) -> None:
        """Do what is due, and start again what has died."""
        while self._plan and self._plan[0][0] <= time.monotonic():
            heapq.heappop(self._plan)[2]()
        for process, until_s in list(self._stopped.items()):
            if time.monotonic() >= until_s:
                self._wake(process)
        for process in self._site.processes:
            if not process.is_alive:
                process.start()

    def calm(self) -> None:
        """Nothing more goes wrong; whatever is stopped or dead comes back."""
        self._plan.clear()
        self._is_calm = True
        for process in list(self._stopped):
            self._wake(process)
        if not self._site.redis.server.is_alive:
            self._site.redis.start()

    # --- the plan ----------------------------------------------------------------------------------------

    def _at(self, delay_s: float, action: Callable[[], None]) -> None:
        self._n_planned += 1
        heapq.heappush(self._plan, (time.monotonic() + delay_s, self._n_planned, action))

    def _repeat(self, period_s: float, fault: Callable[[], None], *, is_regular: bool = False) -> None:
        def once() -> None:
            fault()
            if not self._is_calm:
                self._repeat(period_s, fault, is_regular=is_regular)

        self._at(period_s if is_regular else period_s * self._rng.uniform(0.6, 1.4), once)

    # --- the faults --------------------------------------------------------------------------------------

    def _kill_a_worker(self) -> None:
        """One process of a pool, or every fourth time the whole machine, reading processes and all."""
        candidates = [worker for worker in self._site.workers if worker not in self._stopped]
        working = {worker: pool for worker in candidates if (pool := worker.children())}
        worker = self._rng.choice(list(working) or candidates)
        if worker in working and self._rng.random() < 0.75:
            with suppress(ProcessLookupError):
                os.kill(self._rng.choice(working[worker]), signal.SIGKILL)
            self.counts["pool_process_kills"] += 1
        else:
            worker.kill()
            self.counts["worker_kills"] += 1

    def _make_a_zombie(self) -> None:
        """Stop a worker beyond its leases; it wakes up believing that nothing happened."""
        candidates = [worker for worker in self._site.workers if worker not in self._stopped]
        if len(candidates) < 2:
            return
        worker = self._reading(candidates) or self._rng.choice(candidates)
        worker.send(signal.SIGSTOP)
        self._stopped[worker] = time.monotonic() + ZOMBIE_S
        self.counts["zombies"] += 1

    def _reading(self, workers: list[Process]) -> Process | None:
        """A worker that reads a file right now, if there is one within a moment."""
        until_s = time.monotonic() + MOMENT_S
        while time.monotonic() < until_s:
            for worker in workers:
                if any(children_of(pid) for pid in worker.children()):
                    return worker
        return None

    def _wake(self, process: Process) -> None:
        process.send(signal.SIGCONT)
        del self._stopped[process]

    def _duplicate_messages(self) -> None:
        """Those that wait and those that are being worked on, twice more each."""
        broker = self._site.redis.client
        with suppress(redis.RedisError):
            waiting = cast("list[bytes]", broker.lrange(QUEUE, 0, 19))  # this client is the blocking one
            taken = cast("dict[bytes, bytes]", broker.hgetall(UNACKED))
            for message in [*waiting, *(json.dumps(json.loads(raw)[0]) for raw in taken.values())]:
                broker.rpush(QUEUE, message, message)
                self.counts["messages_duplicated"] += 1

    def _drop_messages(self) -> None:
        """Every one that comes within a moment: a worker that listens is quicker than a single look."""
        until_s = time.monotonic() + MOMENT_S
        with suppress(redis.RedisError):
            while time.monotonic() < until_s:
                self.counts["messages_dropped"] += self._site.redis.client.lpop(QUEUE) is not None

    def _flush_the_broker(self) -> None:
        with suppress(redis.RedisError):
            self._site.redis.client.flushall()
            self.counts["broker_flushes"] += 1

    def _restart_the_broker(self) -> None:
        self._site.redis.server.kill()
        self.counts["broker_restarts"] += 1
        self._at(self._rng.uniform(0.5, 4.0), self._start_the_broker)

    def _start_the_broker(self) -> None:
        if not self._site.redis.server.is_alive:
            self._site.redis.start()

    def _restart_the_database(self) -> None:
        """Every other time as if it had crashed."""
        is_crash = self.counts["database_restarts"] % 2 == 1
        self._site.postgres.stop(crash=is_crash)
        self._site.postgres.start()
        self.counts["database_restarts"] += 1

    def _kill_a_web_process(self) -> None:
        """One that may be at work: where none answers, the next kill would meet them all at their start."""
        processes = self._site.web.children()
        if processes and self._site.answers():
            with suppress(ProcessLookupError):
                os.kill(self._rng.choice(processes), signal.SIGKILL)
            self.counts["web_kills"] += 1
