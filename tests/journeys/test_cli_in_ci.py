"""`tsttc` in a CI job against the real thing, while everything around it fails.

Web server, worker, PostgreSQL and Redis are real, and so is a network that cuts uploads. Each failure has its
exit code and its words.
"""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import psycopg
import pytest

from evaluator import receipts
from tests.evaluator.toolkit_folders import camera, write_folder
from tests.journeys import recipes
from tests.journeys.cutting import Cut, CutNetwork, MovingNetwork
from tests.journeys.production import Site, free_port, get, web_process
from tests.journeys.programs import PATIENCE_S, Tsttc, command, environment

pytestmark = [pytest.mark.services, pytest.mark.slow]

N_JOBS = 20  # each test has one, whose quota is its own


class Job:
    """A CI job of a team of its own: its token, its files, its command."""

    def __init__(self, site: Site, *, email: str, token: str, home: Path) -> None:
        self.site, self.home, self.email, self.token = site, home, email, token
        self.tsttc = self.at(site.url)

    def at(self, url: str) -> Tsttc:
        """The command for another address of the same site."""
        return command(url, self.token, home=self.home)

    def predictions(self, factor: float) -> Path:
        """A good file, off by that factor."""
        rows = (self.site.directory / "truth.csv").read_text().splitlines()[1:]
        values = {row.split(",")[0]: float(row.split(",")[-1]) * factor for row in rows}
        path = self.home / f"predictions-{factor}.json"
        path.write_text(json.dumps(values))
        return path

    def submit(
        self, path: Path, *more: str, tsttc: Tsttc | None = None, method: str = "Job"
    ) -> subprocess.CompletedProcess[str]:
        return (tsttc or self.tsttc)("submit", path, "--split", "test", "--method", method, *more)

    def submissions(self) -> list[dict[str, object]]:
        """What the server has of this team, newest first."""
        answer = get(f"{self.site.url}/api/v1/submissions", Authorization=f"Bearer {self.token}")
        assert answer.status_code == 200, answer.text
        return list(answer.json())


@pytest.fixture(scope="module")
def tokens(site: Site) -> Iterator[tuple[str, str]]:
    """Addresses and tokens of one person after the other, made by one process."""
    program = (
        "from django.core.management import call_command\n"
        f"for i in range({N_JOBS}):\n"
        "    call_command('create_token', f'job-{i}@example.org', name='CI')\n"
    )
    found = site.manage("shell", "--no-imports", "--command", program).split()
    assert len(found) == N_JOBS
    return iter([(f"job-{i}@example.org", token) for i, token in enumerate(found)])


@pytest.fixture
def job(site: Site, tokens: Iterator[tuple[str, str]], tmp_path: Path) -> Job:
    email, token = next(tokens)
    return Job(site, email=email, token=token, home=tmp_path)


@pytest.fixture
def paused_worker(site: Site) -> Iterator[Callable[[], None]]:
    """The site's worker stands still until what this gives is called, or the test ends."""
    group = site.processes["worker"].pid
    os.killpg(group, signal.SIGSTOP)

    def go_on() -> None:
        os.killpg(group, signal.SIGCONT)

    yield go_on
    go_on()


def at_port(site: Site, port: int, **settings: str) -> Site:
    """The same site behind a web server of its own."""
    url = f"http://127.0.0.1:{port}"
    own = {"TSTTC_WEB_BIND": f"127.0.0.1:{port}", "WEB_CONCURRENCY": "1", **settings}
    return replace(site, url=url, environment=site.environment | own)


def test_job_waits_for_its_scores_and_can_prove_them(job: Job) -> None:
    waited = job.submit(job.predictions(1.02), "--wait", "--json", "--commit", "c0ffee")
    assert waited.returncode == 0, waited.stderr
    scored = json.loads(waited.stdout)
    offline = job.tsttc("score", job.predictions(1.02), "--truth", job.site.directory / "truth.csv", "--json")
    assert (scored["state"], scored["commit"]) == ("SCORED", "c0ffee")
    assert scored["scores"]["mid"] == round(json.loads(offline.stdout)["scores"]["overall"]["mid"], 1)

    receipt, keys = job.home / "receipt.jwt", job.home / "keys.json"
    assert job.tsttc("receipt", scored["id"], "-o", receipt).returncode == 0
    verified = job.tsttc("verify", receipt)
    assert verified.stdout.startswith("The receipt is valid.\n"), verified.stderr
    keys.write_text(get(f"{job.site.url}/.well-known/tsttc-receipt-keys.json").text)
    offline_url = f"http://127.0.0.1:{free_port()}"
    said = json.loads(job.at(offline_url)("verify", receipt, "--keys", keys, "--json").stdout)
    assert (said["submission"], said["scores"]["mid"]) == (scored["id"], scored["scores"]["mid"])
    header, payload, signature = receipt.read_text().strip().split(".")
    said = receipts.decode(payload).decode().replace(f'"{scored["scores"]["mid"]:.1f}"', '"0.01"')
    receipt.write_text(f"{header}.{receipts.encode(said.encode())}.{signature}")
    forged = job.tsttc("verify", receipt)
    assert (forged.returncode, forged.stdout) == (1, "")
    assert "The signature does not fit what the receipt says" in forged.stderr


def test_what_is_one_s_own_is_listed_taken_back_and_withdrawn(job: Job) -> None:
    """The token lies in a file, as the secret of a container does."""
    secret, mine, sent = job.home / "secret", job.home / "mine.json", job.predictions(1.07)
    secret.write_text(f"{job.token}\n")
    tsttc = command(job.site.url, secret, home=job.home)
    assert tsttc("methods").stdout == "Your team has no methods yet; tsttc submit creates one.\n"
    assert job.submit(sent, "--wait", tsttc=tsttc).returncode == 0
    assert 'token "CI": read and submit, until ' in tsttc("whoami").stdout
    (submission,) = json.loads(tsttc("submissions", "--split", "test", "--json").stdout)
    (method,) = json.loads(tsttc("methods", "--json").stdout)
    assert (submission["method_id"], method["visibility"]) == (method["id"], "PRIVATE")
    assert tsttc("download", submission["id"], "-o", mine).returncode == 0
    assert mine.read_bytes() == sent.read_bytes()

    manifest, table = job.home / "manifest.csv", job.home / "own.csv"
    assert tsttc("manifest", "--split", "test", "-o", manifest).returncode == 0
    checked = json.loads(tsttc("check", mine, "--manifest", manifest, "--json").stdout)
    assert checked["predictions_digest"] == submission["digest"]
    folder = write_folder(job.home / "folder", {"a.pkl": [camera({7: list(range(6))})]})
    assert tsttc("truth", folder, "-o", table).stdout == f"{table}: 1 sequence of 1 recording.\n"
    nowhere = tsttc("manifest", "--split", "tset")
    assert (nowhere.returncode, "The splits here are " in nowhere.stderr) == (8, True)

    shown = tsttc("publish", "Job", "--yes")
    assert shown.returncode == 0, shown.stderr
    again = job.submit(sent, tsttc=tsttc)
    assert again.stdout.startswith("Job is public: "), "a job is told, and not asked"
    assert tsttc("board", "--format", "bibtex").stdout.startswith("@misc{shi2023tsttc,")
    assert tsttc("withdraw", submission["id"]).returncode == 2
    assert tsttc("withdraw", submission["id"], "--yes").stdout == "Job on test is withdrawn.\n"
    assert tsttc("status", submission["id"]).stdout.startswith("SCORED, withdrawn: Job on test")


def test_worse_method_fails_the_gate_and_the_better_one_is_shown(job: Job) -> None:
    good = job.submit(job.predictions(1.05), "--wait", method="Steady")
    assert good.returncode == 0, good.stderr
    assert "Steady is private: only your team sees its results." in good.stdout
    gate = ("--fail-if-worse-than", "Steady")
    worse = job.submit(job.predictions(1.06), *gate, "--json", method="Shaky")
    assert worse.returncode == 6, worse.stderr
    assert re.search(r"The gate fails: MiD is .*, and Steady has ", worse.stderr)
    assert json.loads(worse.stdout)["gate"]["code"] == "gate-failed"
    compared = job.tsttc("compare", "Steady", "Shaky")
    assert compared.returncode == 0, compared.stderr
    assert "Steady's MiD is " in compared.stdout
    assert "is not public, and the ground truth of test is hidden" in compared.stdout
    anybody = command(job.site.url, "", home=job.home)
    assert "Steady" not in anybody("board").stdout
    assert job.tsttc("publish", "Steady").returncode == 2, "nobody has said that it is meant"
    shown = job.tsttc("publish", "Steady", "--yes")
    assert (shown.returncode, shown.stdout[:21]) == (0, "Steady is public now:"), shown.stderr
    assert "Steady" in anybody("board").stdout
    assert "Shaky" not in anybody("board").stdout


def test_job_that_runs_again_with_the_same_bytes_has_one_submission(job: Job) -> None:
    first, again = (job.submit(job.predictions(1.1), "--wait", "--json") for _ in range(2))
    assert (first.returncode, again.returncode) == (0, 0), again.stderr
    assert json.loads(first.stdout)["id"] == json.loads(again.stdout)["id"]
    other = job.submit(job.predictions(1.2), "--json")
    assert json.loads(other.stdout)["id"] != json.loads(first.stdout)["id"]
    assert len(job.submissions()) == 2


def test_upload_that_the_network_cuts_arrives_once(job: Job) -> None:
    port = int(job.site.url.rpartition(":")[2])
    with CutNetwork(port, Cut.IN_THE_MIDDLE, Cut.BEFORE_THE_ANSWER, Cut.IN_THE_MIDDLE) as network:
        done = job.submit(job.predictions(1.3), "--wait", tsttc=job.at(network.url))
        assert (network.n_uploads, network.n_cuts_left) == (4, 0)
    assert done.returncode == 0, done.stderr
    assert "SCORED: Job on test" in done.stdout
    assert "already submitted" not in done.stdout, "the same call again is no other submission"
    assert len(job.submissions()) == 1


def waiting_job(job: Job, url: str) -> subprocess.Popen[str]:
    """`tsttc submit --wait` at that address, once it has heard that its file is queued."""
    waiting = subprocess.Popen(
        [
            *(sys.executable, "-m", "evaluator", "submit", str(job.predictions(1.4))),
            *("--split", "test", "--method", "Job", "--wait", "--json", "--fail-if", "mid > 0.01"),
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(url, job.token, home=job.home),
    )
    assert waiting.stderr is not None
    assert waiting.stderr.readline().startswith("Submission ")
    assert waiting.stderr.readline().startswith("QUEUED")
    return waiting


def test_job_outlives_a_restart_of_the_server(job: Job, paused_worker: Callable[[], None]) -> None:
    """It bears with one that is away for seconds, so the second server is up before the first one ends."""
    before, after = (at_port(job.site, free_port()) for _ in range(2))
    with MovingNetwork() as network, web_process(after, "web-after"):
        with web_process(before, "web-before"):
            network.lead_to(before.url)
            waiting = waiting_job(job, network.url)
        assert waiting.poll() is None, "the server is away, and the job still waits"
        network.lead_to(after.url)
        paused_worker()
        stdout, stderr = waiting.communicate(timeout=PATIENCE_S)
    assert waiting.returncode == 6, stderr
    assert stderr.endswith("which matches mid > 0.01.\n")
    assert json.loads(stdout)["state"] == "SCORED"


def test_nothing_in_time_says_how_to_go_on(job: Job, paused_worker: Callable[[], None]) -> None:
    done = job.submit(job.predictions(1.5), "--wait", "--timeout", "1")
    assert done.returncode == 9
    assert "is not final after 1 s. It was QUEUED last." in done.stderr
    (submission,) = job.submissions()
    paused_worker()
    watched = job.tsttc("status", submission["id"], "--watch")
    assert (watched.returncode, watched.stdout[:6]) == (0, "SCORED")


def test_server_that_is_never_there_is_told_after_a_few_tries(job: Job) -> None:
    """Not at once: a job may begin before its server has."""
    url = f"http://127.0.0.1:{free_port()}"
    done = job.submit(job.predictions(1.02), tsttc=job.at(url))
    assert done.returncode == 3
    assert done.stderr.startswith(f"Error: Nothing answers at {url} (")


def test_token_that_has_expired_is_told_with_what_to_do(job: Job) -> None:
    with psycopg.connect(job.site.environment["TSTTC_DATABASE_URL"]) as connection:
        connection.execute(
            "UPDATE leaderboard_apitoken SET expiry = now() - interval '1 hour' "
            "WHERE user_id = (SELECT id FROM leaderboard_user WHERE email = %s)",
            [job.email],
        )
    done = job.submit(job.predictions(1.02), "--json")
    assert done.returncode == 4
    said = json.loads(done.stdout)
    assert said["code"] == "token-expired"
    assert done.stderr.startswith(f"Error: {said['detail']}\nCreate a token at {job.site.url}/tokens/")


def test_spent_quota_is_told_in_the_server_s_words_with_the_next_slot(job: Job) -> None:
    there = at_port(job.site, free_port(), TSTTC_QUOTAS="1")
    with web_process(there, "web-with-quotas"):
        tsttc = job.at(there.url)
        assert job.submit(job.predictions(1.02), tsttc=tsttc).returncode == 0
        done = job.submit(job.predictions(1.03), "--wait", "--json", tsttc=tsttc)
        (quota,) = [row for row in json.loads(tsttc("quota", "--json").stdout) if row["split"] == "test"]
        shown = tsttc("quota").stdout
    assert done.returncode == 5
    assert json.loads(done.stdout)["code"] == "quota-exceeded"
    assert done.stderr.startswith(f"Error: {quota['sentence']}\nTry again in 24 h.")
    assert re.search(r"the next slot opens at \d{4}-\d\d-\d\d \d\d:\d\d UTC", done.stderr)
    assert f"test: {quota['sentence']}" in shown
    assert len(job.submissions()) == 1


def test_file_that_is_too_large_for_the_server_is_the_sender_s_fault(job: Job) -> None:
    large = job.home / "large.json"
    large.write_bytes(b" " * 30_000_000)
    done = job.submit(large, "--no-check")
    assert done.returncode == 1
    assert "expected at most" in done.stderr


# --- the recipes ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("factor", "exit_code"), [(1.001, 0), (1.7, 6)])
@pytest.mark.parametrize("recipe", [recipes.github(), recipes.gitlab()], ids=["github", "gitlab"])
def test_recipe_runs_as_it_stands(job: Job, recipe: recipes.Recipe, factor: float, exit_code: int) -> None:
    """But for the installation, and with this site's address, split and token."""
    programs, work = job.home / "bin", job.home / "work"
    programs.mkdir()
    work.mkdir()
    for path, text in {
        programs / "tsttc": f'exec {sys.executable} -m evaluator "$@"',
        work / "predict.sh": f'cp {job.predictions(factor)} "$1"',
    }.items():
        path.write_text(f"#!/bin/sh\n{text}\n")
        path.chmod(0o755)
    surroundings = recipe.environment | environment(job.site.url, job.token, home=job.home)
    surroundings |= {"PATH": f"{programs}:{os.environ['PATH']}", "SPLIT": "test"}
    surroundings |= {"GITHUB_SHA": "c0ffee", "CI_COMMIT_SHA": "c0ffee", "GITHUB_STEP_SUMMARY": "summary.md"}
    codes = [
        subprocess.run(
            ["bash", "-e", "-o", "pipefail", "-c", step], cwd=work, env=surroundings, check=False
        ).returncode
        for step in recipe.steps
    ]
    assert codes == [0, exit_code, 0]
    result = json.loads((work / "result.json").read_text())
    assert (result["state"], result["commit"]) == ("SCORED", "c0ffee")
    assert recipe.n_installing == 1
    assert all(re.fullmatch(r"[\w/-]+@v\d+\.\d+\.\d+", action) for action in recipe.actions)
    assert recipe.secret in {"", "${{ secrets.TSTTC_TOKEN }}"}
