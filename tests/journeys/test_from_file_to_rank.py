"""What the project exists for, on the real thing: a prediction file in, a ranked board out.

Real processes (gunicorn, a Celery worker), a real PostgreSQL and a real Redis; the people use forms
and the programs use tokens.
"""

import subprocess
import sys
from collections.abc import Callable

import pytest

import evaluator
from tests.journeys.people import Program, Visitor
from tests.journeys.production import REPOSITORY, Site, free_port

pytestmark = [pytest.mark.services, pytest.mark.slow]

People = Callable[[Site], Visitor]
Programs = Callable[[Site, str], Program]


def predictions(truth: evaluator.GroundTruth, *, factor: float) -> bytes:
    """A file whose every time to contact is wrong by the same factor."""
    return evaluator.write_predictions(manifest=truth.manifest, ttc_s=truth.ttc_s * factor)


def offline(data: bytes, truth: evaluator.GroundTruth) -> dict[str, float | None]:
    """The ten published numbers as the evaluator alone gives them."""
    report = evaluator.evaluate(evaluator.read_predictions(data, manifest=truth.manifest), truth)
    scores = {}
    for name in evaluator.SCORE_NAMES:
        metric, _, interval = name.partition("_")
        scores[name] = evaluator.published(getattr(report.scores[interval or "overall"], metric), decimals=1)
    return scores


def test_a_person_signs_up_uploads_is_scored_and_sees_the_rank(
    site: Site, people: People, programs: Programs, truth: evaluator.GroundTruth
) -> None:
    data = predictions(truth, factor=1.01)
    ada = people(site)
    ada.sign_up(email="ada@example.org", name="Team Ada")

    submission = ada.submit(split="test", method="Counting frames", data=data, description="Frame by frame.")
    program = programs(site, "ada@example.org")
    outcome = program.outcome(submission)

    assert outcome["state"] == "SCORED"
    assert outcome["scores"] == offline(data, truth)
    assert "Counting frames" not in people(site).text_of("/board/test/")
    ada.show(submission)
    entries = program.board("test")
    mine = next(entry for entry in entries if entry["method"] == "Counting frames")
    assert (mine["rank"], mine["team"], mine["kind"]) == (1, "Team Ada", "submission")
    assert mine["scores"] == outcome["scores"]
    # The rows printed in the paper stand below it, in the order of their own numbers.
    published = [entry for entry in entries if entry["kind"] == "published"]
    assert [entry["rank"] for entry in published] == sorted(entry["rank"] for entry in published)
    assert len(published) == 5
    assert published[0]["rank"] == 2
    page = people(site).text_of("/board/test/")
    assert "Counting frames" in page
    assert f"{outcome['scores']['mid']:.1f}" in page


def test_a_file_with_faults_is_rejected_with_their_list_and_the_next_good_one_is_scored(
    site: Site, people: People, programs: Programs, truth: evaluator.GroundTruth
) -> None:
    grace = people(site)
    grace.sign_up(email="grace@example.org", name="Team Grace")
    program = programs(site, "grace@example.org")
    before = program.board("test")

    rejected = grace.submit(split="test", method="Nanoseconds", data=b'{"0": 1.5, "1": NaN, "2": "three"}')
    outcome = program.outcome(rejected)

    assert outcome["state"] == "REJECTED"
    assert outcome["scores"] is None
    assert {"nan", "not-a-number", "missing-keys"} <= {problem["code"] for problem in outcome["problems"]}
    page = grace.text_of(f"/submissions/{rejected}/")
    assert all(problem["message"] in page for problem in outcome["problems"])
    assert program.board("test") == before

    data = predictions(truth, factor=0.9)
    accepted = program.submit(split="test", method="Nanoseconds", data=data)
    assert program.outcome(accepted)["scores"] == offline(data, truth)


def test_the_check_that_containers_use_finds_the_web_process_alive(site: Site) -> None:
    command = [sys.executable, "deploy/healthcheck.py"]
    alive = subprocess.run(command, cwd=REPOSITORY, env=site.environment, capture_output=True, check=False)
    assert alive.returncode == 0, alive.stderr
    elsewhere = site.environment | {"TSTTC_WEB_BIND": f"127.0.0.1:{free_port()}"}
    dead = subprocess.run(command, cwd=REPOSITORY, env=elsewhere, capture_output=True, check=False)
    assert dead.returncode == 1
