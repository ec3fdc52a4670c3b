"""From the POST of a file of 28,600 sequences to its score, and what that costs a worker.

gunicorn with two processes, PostgreSQL, Redis and one worker as in production. First one submission at a
time: the clock runs from before the request is sent until the database says that it was scored. Then many at
once: the processor time of the worker, without PostgreSQL's. Last, `tsttc submit --wait` as a program.
"""

import os
import subprocess
import time
from statistics import median
from uuid import UUID

import httpx2
import numpy as np

import evaluator
from benchmarks._site import QUICK, leave_intervals, processor_s, site, worker
from tests.journeys.production import BIN, Site, await_that, web_process

N_ONE_BY_ONE = 5 if QUICK else 100
N_AT_ONCE = 5 if QUICK else 60
N_COMMANDS = 1 if QUICK else 5
N_WARM = 5
POLL_S = 0.02
N_SEQUENCES = 28_600
SEED = 20230901


def main() -> None:
    """Print one line per figure, `name = value unit`."""
    with site() as made:
        token, truth = prepare(made)
        rng = np.random.default_rng(SEED)
        with worker(made, n_processes=1) as pid, web_process(made):
            leave_intervals()
            client = httpx2.Client(
                base_url=f"{made.url}/api/v1",
                headers={"Authorization": f"Bearer {token}"},
                trust_env=False,
                timeout=90,
            )
            with client as http:
                took_s = [one_by_one(http, file_of(truth, rng)) for _ in range(N_WARM + N_ONE_BY_ONE)]
                print(f"submissions.scored_p50 = {median(took_s[N_WARM:]):.3f} s", flush=True)
                files = [file_of(truth, rng) for _ in range(N_AT_ONCE)]
                before_s = processor_s(pid)
                ids = [send(http, data) for data in files]
                await_that(lambda: n_scored(ids) == len(ids), what="all are scored")
                used_s = processor_s(pid) - before_s
                print(f"submissions.processor = {used_s / len(ids):.4f} s of a worker")
            infer_again()
            commands(made, token, truth, rng)


def prepare(made: Site) -> tuple[str, evaluator.GroundTruth]:
    """A split with ground truth, and the token of a person who may submit to it."""
    from django.utils import timezone  # noqa: PLC0415 - Django is configured only now

    from leaderboard.demo.runs import simulate  # noqa: PLC0415
    from leaderboard.models import User  # noqa: PLC0415
    from leaderboard.people import teams, tokens  # noqa: PLC0415

    truth = simulate(rng=np.random.default_rng(SEED), n_sequences=N_SEQUENCES)
    table = made.directory / "truth.csv"
    table.write_bytes(truth.to_csv())
    made.manage("import_truth", "test", str(table))
    user = User.objects.create_user("bench@example.org", "correct horse", name="Owls")
    teams.team_of(user=user)
    return tokens.create(user=user, name="bench", now=timezone.now()), truth


def send(http: httpx2.Client, data: bytes) -> str:
    """Send a file; returns the id of its submission."""
    fields = {"split": "test", "method": "Bench"}
    answer = http.post("/submissions", data=fields, files={"file": ("predictions.json", data)})
    answer.raise_for_status()
    return str(answer.json()["id"])


def one_by_one(http: httpx2.Client, data: bytes) -> float:
    """Seconds from before the POST until the database says that it was scored."""
    from leaderboard.models import Evaluation  # noqa: PLC0415

    began_at = time.time()
    submission_id = send(http, data)
    while not n_scored([submission_id]):
        time.sleep(POLL_S)
    finished_at = Evaluation.objects.get(submission=UUID(submission_id)).finished_at
    assert finished_at is not None
    return finished_at.timestamp() - began_at


def n_scored(ids: list[str]) -> int:
    """The number of these submissions that are scored."""
    from leaderboard.models import Evaluation, Status  # noqa: PLC0415

    return Evaluation.objects.filter(submission__in=map(UUID, ids), status=Status.SCORED).count()


def infer_again() -> None:
    """Let the worker compute intervals from now on: the command waits for them."""
    from leaderboard.models import Edition  # noqa: PLC0415

    Edition.objects.update(inferred_at=None)


def commands(made: Site, token: str, truth: evaluator.GroundTruth, rng: np.random.Generator) -> None:
    """The command line, started again for each file."""
    path = made.directory / "predictions.json"
    environment = os.environ | {"TSTTC_URL": made.url, "TSTTC_TOKEN": token, "NO_PROXY": "*"}
    command = [str(BIN / "tsttc"), "submit", str(path), "--split", "test", "--method", "Bench", "--wait"]
    took_s = []
    for _ in range(N_COMMANDS):
        path.write_bytes(file_of(truth, rng))
        began_s = time.perf_counter()
        subprocess.run(command, env=environment, check=True, capture_output=True)
        took_s.append(time.perf_counter() - began_s)
    print(f"submissions.submit_wait = {median(took_s):.2f} s")


def file_of(truth: evaluator.GroundTruth, rng: np.random.Generator) -> bytes:
    """A file that was not sent before."""
    ttc_s = truth.ttc_s * rng.lognormal(0, 0.15, truth.n_sequences)
    return evaluator.write_predictions(manifest=truth.manifest, ttc_s=ttc_s)
