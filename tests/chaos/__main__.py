"""`python -m tests.chaos`: uploads while everything that can fail does, and their results.

Ends with one line of figures. The exit code says whether nothing was lost, doubled or stuck, and nobody
waited longer than is allowed.
"""

import argparse
import random
import re
import shutil
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
import psycopg

from leaderboard.demo.runs import simulate
from tests.chaos.faults import Faults
from tests.chaos.site import SPLIT, Site, running_site
from tests.chaos.uploads import Clients, make_uploads
from tests.chaos.verdict import Verdict, judge, n_open

TICK_S = 0.1
MAX_REASONS = 20
TIMEOUT_S = 300.0  # with what was acknowledged, once nothing goes wrong any more


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.chaos", description=__doc__)
    parser.add_argument("--uploads", type=int, default=200)
    parser.add_argument("--bombs", type=int, default=2, help="so many kill the process that reads them")
    parser.add_argument("--seconds", type=float, default=100.0, help="over which the uploads are spread")
    parser.add_argument("--workers", type=int, default=3, help="with two processes each")
    parser.add_argument("--clients", type=int, default=4)
    parser.add_argument("--worst-s", type=float, default=120.0, help="nobody may wait longer for a result")
    parser.add_argument("--rarity", type=float, default=1.0, help="stretches the time between faults")
    parser.add_argument("--seed", type=int, default=1)
    return parser.parse_args()


def say(text: str) -> None:
    sys.stdout.write(f"chaos: {text}\n")
    sys.stdout.flush()


def run(options: argparse.Namespace, directory: Path) -> bool:
    """Do the whole run. Returns whether it was good."""
    rng = np.random.default_rng(options.seed)
    truth = simulate(rng=rng, n_sequences=1_000, n_recordings=25)
    uploads = make_uploads(truth, n=options.uploads, n_bombs=options.bombs, seed=options.seed)
    with running_site(directory, truth=truth, n_workers=options.workers) as site:
        token = site.manage("create_token", "chaos@example.org", "--name", "chaos").strip()
        clients = Clients(url=site.url, token=token, split=SPLIT)
        faults = Faults(site, rng=random.Random(options.seed), rarity=options.rarity)
        say(f"seed={options.seed} pid={site.web.pid} url={site.url}")
        started_s = time.monotonic()
        threads = clients.start(uploads, n_clients=options.clients, seconds=options.seconds)
        while any(thread.is_alive() for thread in threads):
            faults.tick()
            time.sleep(TICK_S)
        faults.calm()
        say(f"all was sent after {time.monotonic() - started_s:.0f} s")
        _drain(site, faults)
        say(f"all was decided after {time.monotonic() - started_s:.0f} s")
        with site.postgres.connect() as connection:
            files = site.directory / "files" / "predictions"
            verdict = judge(clients.receipts, n_uploads=options.uploads, connection=connection, files=files)
        _tell(verdict, faults, clients, site)
    n_kills = faults.counts["worker_kills"] + faults.counts["pool_process_kills"]
    say(
        f"uploads={verdict.n_uploads} kills={n_kills} lost={verdict.lost} doubled={verdict.doubled} "
        f"stuck={verdict.stuck} worst_s={verdict.worst_s:.1f}"
    )
    return verdict.is_good(worst_allowed_s=options.worst_s) and not clients.refused


def _drain(site: Site, faults: Faults) -> None:
    """Wait, without faults, until everything is decided or the time is over."""
    deadline_s = time.monotonic() + TIMEOUT_S
    while time.monotonic() < deadline_s:
        faults.tick()
        try:
            with site.postgres.connect() as connection:
                if n_open(connection) == 0:
                    return
        except psycopg.OperationalError as fault:
            say(f"the database does not answer: {fault}")
        time.sleep(TICK_S)


def _tell(verdict: Verdict, faults: Faults, clients: Clients, site: Site) -> None:
    """The figures behind the last line."""
    for reason in [*verdict.reasons, *clients.refused][:MAX_REASONS]:
        say(reason)
    say("faults " + " ".join(f"{name}={n}" for name, n in sorted(faults.counts.items())))
    output = "".join(worker.output() for worker in site.workers)
    n_known = sum(receipt.was_known for receipt in clients.receipts)
    say(
        f"fenced={len(re.findall('evaluation_lost', output))} "
        f"struck={len(re.findall('evaluation_struck', output))} most_attempts={verdict.most_attempts} "
        f"failed_tries={clients.n_failed_tries} answered_with_the_first={n_known}"
    )
    waits_s = verdict.waits_s or [0.0]
    say(
        " ".join(f"{state.lower()}={n}" for state, n in sorted(verdict.states.items()))
        + f" median_s={waits_s[len(waits_s) // 2]:.1f} p95_s={waits_s[int(len(waits_s) * 0.95)]:.1f}"
    )


def main() -> int:
    options = arguments()
    directory = Path(tempfile.mkdtemp(prefix="tsttc-chaos-site-"))
    is_good = False
    try:
        is_good = run(options, directory)
    finally:
        if not is_good:
            sys.stderr.write(f"chaos: the logs are in {directory}\n")
        else:
            shutil.rmtree(directory)
    return 0 if is_good else 1


if __name__ == "__main__":
    threading.current_thread().name = "chaos"
    sys.exit(main())
