"""`tsttc` in a CI job against the real thing: web server, worker, PostgreSQL and Redis."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from evaluator import receipts
from tests.evaluator.toolkit_folders import camera, write_folder
from tests.journeys import recipes
from tests.journeys.production import Site, free_port, get
from tests.journeys.programs import Tsttc, command, environment

pytestmark = [pytest.mark.services, pytest.mark.slow]

N_JOBS = 5  # each test has one


class Job:
    """A CI job of a team of its own: its token, its files, its command."""

    def __init__(self, site: Site, *, token: str, home: Path) -> None:
        self.site, self.home, self.token = site, home, token
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


@pytest.fixture(scope="module")
def tokens(site: Site) -> Iterator[str]:
    """Tokens of one person after the other, made by one process."""
    program = (
        "from django.core.management import call_command\n"
        f"for i in range({N_JOBS}):\n"
        "    scopes = ['read', 'submit', 'publish']\n"
        "    call_command('create_token', f'job-{i}@example.org', name='CI', scope=scopes)\n"
    )
    lines = site.manage("shell", "--no-imports", "--command", program).split()
    assert len(lines) == N_JOBS
    return iter(lines)


@pytest.fixture
def job(site: Site, tokens: Iterator[str], tmp_path: Path) -> Job:
    return Job(site, token=next(tokens), home=tmp_path)


def test_job_waits_for_its_scores_and_can_prove_them(job: Job) -> None:
    waited = job.submit(job.predictions(1.02), "--wait", "--json", "--commit", "c0ffee")
    assert waited.returncode == 0, waited.stderr
    scored = json.loads(waited.stdout)
    offline = job.tsttc("score", job.predictions(1.02), "--truth", job.site.directory / "truth.csv", "--json")
    assert (scored["state"], scored["commit"]) == ("SCORED", "c0ffee")
    again = json.loads(job.submit(job.predictions(1.02), "--json").stdout)
    assert again["id"] == scored["id"], "the same bytes are one submission"
    assert scored["scores"]["mid"] == round(json.loads(offline.stdout)["scores"]["overall"]["mid"], 1)

    receipt, keys = job.home / "receipt.jwt", job.home / "keys.json"
    assert job.tsttc("receipt", scored["id"], "-o", receipt).returncode == 0
    verified = job.tsttc("verify", receipt)
    assert verified.stdout.startswith("The receipt is valid.\n"), verified.stderr
    keys.write_text(get(f"{job.site.url}/.well-known/tsttc-receipt-keys.json").text)
    offline_url = f"http://127.0.0.1:{free_port()}"
    claims = json.loads(job.at(offline_url)("verify", receipt, "--keys", keys, "--json").stdout)
    assert (claims["submission"], claims["scores"]["mid"]) == (scored["id"], scored["scores"]["mid"])
    header, payload, signature = receipt.read_text().strip().split(".")
    forged_text = receipts.decode(payload).decode().replace(f'"{scored["scores"]["mid"]:.1f}"', '"0.01"')
    receipt.write_text(f"{header}.{receipts.encode(forged_text.encode())}.{signature}")
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
    assert 'token "CI": read, submit, publish, until ' in tsttc("whoami").stdout
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
    assert (nowhere.returncode, "There is no split 'tset'; " in nowhere.stderr) == (2, True)

    shown = tsttc("publish", "Job", "--yes")
    assert shown.returncode == 0, shown.stderr
    again = job.submit(sent, tsttc=tsttc)
    assert again.stdout.startswith("“Job” is public: "), "a job is told, and not asked"
    assert tsttc("board", "--format", "bibtex").stdout.startswith("@misc{shi2023tsttc,")
    assert tsttc("withdraw", submission["id"]).returncode == 2
    assert tsttc("withdraw", submission["id"], "--yes").stdout == "Job on test is withdrawn.\n"
    assert tsttc("status", submission["id"]).stdout.startswith("SCORED, withdrawn: Job on test")


def test_worse_method_fails_the_gate_and_the_better_one_is_shown(job: Job) -> None:
    good = job.submit(job.predictions(1.05), "--wait", method="Steady")
    assert good.returncode == 0, good.stderr
    assert "Steady is private: only your team and the maintainers see its results." in good.stdout
    gate = ("--fail-if-worse-than", "Steady")
    worse = job.submit(job.predictions(1.06), *gate, "--json", method="Shaky")
    assert worse.returncode == 6, worse.stderr
    assert re.search(r"The gate fails: MiD is .*, and Steady has ", worse.stderr)
    assert json.loads(worse.stdout)["gate"]["code"] == "gate-failed"
    compared = job.tsttc("compare", "Steady", "Shaky")
    assert compared.returncode == 0, compared.stderr
    assert "The MiD of Steady is " in compared.stdout
    assert "is not public, and the ground truth of Test is hidden" in compared.stdout
    anybody = command(job.site.url, "", home=job.home)
    assert "Steady" not in anybody("board").stdout
    assert job.tsttc("publish", "Steady").returncode == 2, "nobody has said that it is meant"
    shown = job.tsttc("publish", "Steady", "--yes")
    assert (shown.returncode, shown.stdout[:21]) == (0, "Steady is public now:"), shown.stderr
    assert "Steady" in anybody("board").stdout
    assert "Shaky" not in anybody("board").stdout


# --- the recipes ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("recipe", "factor", "exit_code"),
    [(recipes.github(), 1.001, 0), (recipes.gitlab(), 1.7, 6)],
    ids=["github", "gitlab"],
)
def test_recipe_runs_as_it_stands(job: Job, recipe: recipes.Recipe, factor: float, exit_code: int) -> None:
    """But for the installation, and with this site's address, split and token."""
    programs, work = job.home / "tsttc" / "bin", job.home / "work"
    programs.mkdir(parents=True)
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
    surroundings |= {"RUNNER_TEMP": str(job.home)}
    codes = [
        subprocess.run(
            ["bash", "-e", "-o", "pipefail", "-c", step], cwd=work, env=surroundings, check=False
        ).returncode
        for step in recipe.steps
    ]
    assert codes[:2] == [0, exit_code]
    assert not any(codes[2:])
    result = json.loads((work / "result.json").read_text())
    assert (result["state"], result["commit"]) == ("SCORED", "c0ffee")
    assert recipe.n_installing == 1
    summary = (work / "summary.md").read_text()
    assert summary.startswith("### Foo++ on test: SCORED\n")
    assert "`--fail-if mid > 15` " in summary
    assert ("**The gate fails: " in summary) is (exit_code == 6)


def test_actions_of_others_are_named_by_commit() -> None:
    foreign = [step["uses"] for step in recipes.github_steps() if step.get("uses", "./")[:2] != "./"]
    assert foreign
    assert all(recipes.PIN.fullmatch(use) for use in foreign)
