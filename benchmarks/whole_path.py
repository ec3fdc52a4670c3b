"""From the POST of a file to its score, as a client sees it, while nothing else is to do.

gunicorn with two processes, PostgreSQL, Redis and one worker as in production, ground truth of 28,600
sequences. One submission at a time: the clock runs from before the request is sent until the database says
that it was decided (`whole_path.scored`). Then `tsttc submit --wait` as a program of its own: what it takes
beyond scoring is for starting, for checking the file, for asking, and for the confidence intervals that it
waits for.

`python -m benchmarks whole_path`
"""

import itertools
import os
import subprocess
import tempfile
import time
from pathlib import Path
from uuid import UUID

import httpx
import numpy as np

import evaluator
from tests.journeys.production import BIN, Site, await_that, free_port, running, settings_for, web_process
from tests.services import throwaway_database, throwaway_redis

# As many as can be sent one after the other meanwhile.
SEND_S = float(os.environ.get("BENCH_SEND_S", "25"))
N_COMMANDS = 5
N_WARM = 5
POLL_S = 0.02
N_SEQUENCES = 28_600
SEED = 20230901


def main() -> None:
    """Print one line per figure, `name = value unit`."""
    with (
        throwaway_database() as postgres_url,
        throwaway_redis() as redis_url,
        tempfile.TemporaryDirectory(prefix="whole-path-") as folder,
    ):
        url = f"http://127.0.0.1:{free_port()}"
        environment = settings_for(Path(folder), url=url, postgres_url=postgres_url, redis_url=redis_url)
        environment |= {"TSTTC_LOG_LEVEL": "INFO"}
        site = Site(url=url, directory=Path(folder), environment=environment)
        (site.directory / "mail").mkdir()
        site.manage("migrate", "--no-input", "--verbosity=0")
        site.manage("collectstatic", "--no-input", "--verbosity=0")
        os.environ.update(environment)
        os.environ.update({"DJANGO_SETTINGS_MODULE": "leaderboard.settings", "TSTTC_LOG_LEVEL": "WARNING"})
        token, truth = prepare(site)
        worker = (str(BIN / "celery"), "--app=leaderboard", "worker", "--concurrency=1", "--loglevel=info")
        with running(site, "worker", *worker), web_process(site):
            log = site.directory / "worker.log"
            await_that(lambda: b" ready." in log.read_bytes(), what="the worker is up")
            scoring_s = print_requests(url, token, truth)
            print_commands(site, token, truth, scoring_s=scoring_s)


def prepare(site: Site) -> tuple[str, evaluator.GroundTruth]:
    """A split with ground truth, and the token of somebody who may submit to it."""
    import django  # noqa: PLC0415 - its settings are read from the environment, which is known only now

    django.setup()
    from django.db import connections  # noqa: PLC0415 - needs Django
    from django.utils import timezone  # noqa: PLC0415

    from leaderboard.demo.runs import simulate  # noqa: PLC0415
    from leaderboard.models import User  # noqa: PLC0415
    from leaderboard.people import teams, tokens  # noqa: PLC0415

    truth = simulate(rng=np.random.default_rng(SEED), n_sequences=N_SEQUENCES)
    table = site.directory / "truth.csv"
    table.write_bytes(truth.to_csv())
    site.manage("import_truth", "test", str(table))
    user = User.objects.create_user("whole-path@example.org", "correct horse", name="Owls")
    teams.team_of(user=user)
    token = tokens.create(user=user, name="whole path", now=timezone.now())
    connections.close_all()
    return token, truth


def print_requests(url: str, token: str, truth: evaluator.GroundTruth) -> float:
    """One submission after the other through the API; returns the median until it is scored, in seconds."""
    rng = np.random.default_rng(SEED)
    headers = {"Authorization": f"Bearer {token}"}
    scored_s: list[float] = []
    with httpx.Client(base_url=f"{url}/api/v1", headers=headers, trust_env=False, timeout=90) as http:
        until_s = time.monotonic() + SEND_S
        for number in itertools.count():
            if time.monotonic() > until_s and len(scored_s) > 1:
                break
            data = file_of(truth, rng)
            began_at = time.time()
            fields = {"split": "test", "method": "Whole path"}
            sent = http.post("/submissions", data=fields, files={"file": (f"{number}.json", data)})
            sent.raise_for_status()
            found = sent.json()
            while not found["is_final"]:
                time.sleep(POLL_S)
                found = http.get(f"/submissions/{found['id']}").json()
            assert found["state"] == "SCORED", found
            if number >= N_WARM:  # everybody's first question costs more
                scored_s.append(finished_at(found["id"]) - began_at)
    print(f"whole_path.submissions = {len(scored_s)}")
    print(f"whole_path.scored_p50 = {np.percentile(scored_s, 50):.3f} s")
    print(f"whole_path.scored_p99 = {np.percentile(scored_s, 99):.3f} s", flush=True)
    return float(np.percentile(scored_s, 50))


def finished_at(submission_id: str) -> float:
    """When the database says that it was decided; its clock is this machine's."""
    from leaderboard.models import Evaluation  # noqa: PLC0415 - needs Django

    found = Evaluation.objects.values_list("finished_at", flat=True).get(submission=UUID(submission_id))
    assert found is not None
    return found.timestamp()


def print_commands(site: Site, token: str, truth: evaluator.GroundTruth, *, scoring_s: float) -> None:
    """The command line, started anew for each file; beyond scoring, of which the median is known."""
    rng = np.random.default_rng([SEED, 1])
    path = site.directory / "predictions.json"
    took_s = []
    environment = os.environ | {"TSTTC_URL": site.url, "TSTTC_TOKEN": token, "NO_PROXY": "*"}
    for _ in range(N_COMMANDS):
        path.write_bytes(file_of(truth, rng))
        command = [str(BIN / "tsttc"), "submit", str(path), "--split", "test", "--method", "Whole path"]
        began_s = time.perf_counter()
        subprocess.run([*command, "--wait"], env=environment, check=True, capture_output=True)
        took_s.append(time.perf_counter() - began_s)
    print(f"whole_path.submit_wait_p50 = {np.percentile(took_s, 50):.2f} s")
    print(f"whole_path.submit_wait_beyond_scoring = {np.percentile(took_s, 50) - scoring_s:.2f} s")


def file_of(truth: evaluator.GroundTruth, rng: np.random.Generator) -> bytes:
    """A file that nobody has sent before."""
    ttc_s = truth.ttc_s * rng.lognormal(0, 0.15, truth.n_sequences)
    return evaluator.write_predictions(manifest=truth.manifest, ttc_s=ttc_s)


if __name__ == "__main__":
    main()
