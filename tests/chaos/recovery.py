"""`python -m tests.chaos.recovery`: how long a file waits for its result after one thing has gone wrong.

With the settings of production: a lease of 60 s, a look for work every 5 s, a sweep every 15 s. One line a
figure: the median and the worst of a few trials, in seconds from the acknowledgement to the result.
"""

import shutil
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import httpx
import numpy as np

import evaluator
from leaderboard.demo.truth import simulate
from tests.chaos.processes import Process
from tests.chaos.site import SPLIT, Site, running_site
from tests.chaos.uploads import bomb_file
from tests.journeys.production import await_that

PRODUCTION = {
    "TSTTC_LEASE_S": "60",
    "TSTTC_HEARTBEAT_S": "15",
    "TSTTC_WALL_S": "300",
    "TSTTC_SWEEP_S": "15",
    "TSTTC_POLL_S": "5",
    "TSTTC_BACKOFF_S": "2",
}
FINAL = {"SCORED", "REJECTED", "SYSTEM_ERROR", "CANCELLED"}
PATIENCE_S = 200.0


@dataclass
class Trial:
    """A site and somebody who sends files to it."""

    site: Site
    http: httpx.Client
    truth: evaluator.GroundTruth
    rng: np.random.Generator

    def send(self, data: bytes | None = None) -> str:
        """A new file, or this one; returns the submission's id."""
        ttc_s = self.truth.ttc_s * np.exp(self.rng.normal(0.0, 0.2, self.truth.n_sequences))
        fresh = evaluator.write_predictions(manifest=self.truth.manifest, ttc_s=ttc_s)
        answer = self.http.post(
            "/api/v1/submissions",
            data={"split": SPLIT, "method": "recovery"},
            files={"file": ("predictions.json", data or fresh, "application/json")},
        )
        answer.raise_for_status()
        return str(answer.json()["id"])

    def state(self, submission_id: str) -> str:
        """As the API tells it."""
        return str(self.http.get(f"/api/v1/submissions/{submission_id}").json()["state"])

    def decided(self, submission_id: str) -> None:
        """Wait for the result."""
        await_that(
            lambda: self.state(submission_id) in FINAL,
            what=f"{submission_id} is decided",
            patience_s=PATIENCE_S,
        )

    def holder(self, submission_id: str) -> Process:
        """Wait until it runs; the worker that runs it, which is the only one that is not stopped."""
        await_that(lambda: self.state(submission_id) != "QUEUED", what="it runs")
        return self.site.workers[0]


def nothing(trial: Trial) -> float:
    """Nothing goes wrong."""
    sent_s = time.monotonic()
    trial.decided(trial.send())
    return time.monotonic() - sent_s


def broker_down(trial: Trial) -> float:
    """The broker is not there when the file comes."""
    trial.site.redis.server.kill()
    took_s = nothing(trial)
    trial.site.redis.start()
    return took_s


def broker_flushed(trial: Trial) -> float:
    """Every message is lost while no worker listens."""
    for worker in trial.site.workers:
        worker.kill()
    submission_id = trial.send()
    trial.site.redis.client.flushall()
    for worker in trial.site.workers:
        worker.start()
    sent_s = time.monotonic()
    trial.decided(submission_id)
    return time.monotonic() - sent_s


def database_restarted(trial: Trial) -> float:
    """The database is restarted as soon as the file is acknowledged."""
    submission_id = trial.send()
    sent_s = time.monotonic()
    trial.site.postgres.stop()
    trial.site.postgres.start()
    trial.decided(submission_id)
    return time.monotonic() - sent_s


def after_a_bomb(trial: Trial) -> float:
    """A file that kills its reader is just before this one."""
    trial.send(bomb_file(trial.rng.integers(1 << 30)))
    return nothing(trial)


def worker_killed(trial: Trial) -> float:
    """The machine that reads the file loses its power meanwhile; another one takes over."""
    first, second = trial.site.workers
    second.kill()
    submission_id = trial.send()
    sent_s = time.monotonic()
    trial.holder(submission_id)
    first.kill()
    second.start()
    trial.decided(submission_id)
    took_s = time.monotonic() - sent_s
    first.start()
    return took_s


TRIALS: tuple[tuple[Callable[[Trial], float], int], ...] = (
    (nothing, 20),
    (after_a_bomb, 5),
    (broker_down, 5),
    (broker_flushed, 3),
    (database_restarted, 5),
    (worker_killed, 5),
)


def main() -> None:
    """Print the figures."""
    directory = Path(tempfile.mkdtemp(prefix="tsttc-recovery-"))
    rng = np.random.default_rng()
    truth = simulate(rng=np.random.default_rng(1), n_sequences=1_000, n_recordings=25)
    with running_site(directory, truth=truth, n_workers=2, changes=PRODUCTION) as site:
        token = site.manage("create_token", "recovery@example.org", "--name", "recovery").strip()
        headers = {"Authorization": f"Bearer {token}"}
        with httpx.Client(base_url=site.url, headers=headers, timeout=60, trust_env=False) as http:
            trial = Trial(site, http, truth, rng)
            nothing(trial)
            for measure, n in TRIALS:
                took_s = [measure(trial) for _ in range(n)]
                sys.stdout.write(
                    f"recovery: {measure.__name__}_s median={statistics.median(took_s):.1f} "
                    f"worst={max(took_s):.1f} n={n}\n"
                )
                sys.stdout.flush()
    shutil.rmtree(directory)


if __name__ == "__main__":
    main()
