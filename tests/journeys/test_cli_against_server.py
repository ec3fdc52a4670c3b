"""`tsttc` against the leaderboard itself: the same file, numbers and words on both sides."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from django.utils import timezone
from pytest_django.live_server_helper import LiveServer

from evaluator.metrics.protocol import PROTOCOLS
from leaderboard.editions import ground_truth
from leaderboard.models import Submission, User
from tests import builders
from tests.journeys.programs import EXAMPLES, Done, Tsttc, command

pytestmark = pytest.mark.slow


@pytest.fixture
def owner(transactional_db: None) -> User:
    return User.objects.create_user("owner@example.org", "correct horse", name="Owls")


@pytest.fixture
def tsttc(live_server: LiveServer, owner: User, benchmark: None, tmp_path: Path) -> Tsttc:
    """The owner's command; the split `val` has the truth of the examples."""
    ground_truth.import_truth(split_name="val", path=EXAMPLES / "truth.csv", now=timezone.now())
    return command(live_server.url, builders.token(owner), home=tmp_path)


def submit(tsttc: Tsttc, predictions: str, *more: str, method: str = "Foo++") -> Done:
    return tsttc("submit", predictions, "--split", "val", "--method", method, *more)


def submitted(tsttc: Tsttc, predictions: str, *more: str, method: str = "Foo++") -> str:
    """The id of a submission that was taken."""
    done = submit(tsttc, predictions, "--json", *more, method=method)
    assert done.returncode == 0, done.stderr
    return str(json.loads(done.stdout)["id"])


@pytest.mark.parametrize("predictions", ["predictions.json", "predictions.scale_ratio.json"])
def test_submission_scores_what_score_says_offline(tsttc: Tsttc, predictions: str) -> None:
    arguments = ("score", predictions, "--truth", "truth.csv", "--protocol", "tsttc-2")
    offline = tsttc(*arguments).stdout.splitlines()
    identity = submitted(tsttc, predictions)
    assert tsttc("status", identity).stdout.startswith("QUEUED, 0 ahead")
    assert builders.score_all() == 1
    done = tsttc("status", identity, "--watch")
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[:2] == ["SCORED: Foo++ on val", "if published: rank 1"]
    assert lines[lines.index("") + 1 :] == offline[: offline.index("", 4)]


def test_rejection_has_the_words_of_check(tsttc: Tsttc) -> None:
    offline = tsttc("check", "broken.json", "--manifest", "manifest.csv")
    here = submit(tsttc, "broken.json")
    assert (here.returncode, here.stdout, Submission.objects.count()) == (1, "", 0)
    assert (
        here.stderr == offline.stderr + "This file was not submitted and did not count against your quota.\n"
    )
    identity = submitted(tsttc, "broken.json", "--no-check")
    builders.score_all()
    done = tsttc("status", identity)
    assert (offline.returncode, done.returncode) == (1, 1)
    numbered = offline.stderr.splitlines()[1:]
    assert len(numbered) == 6
    assert done.stderr.splitlines()[1:7] == numbered
    assert "7 problems" in offline.stderr.splitlines()[0]
    assert "7 problems" in done.stderr.splitlines()[0]


def test_board_shows_published_rows_and_the_owner_s_own(tsttc: Tsttc) -> None:
    submitted(tsttc, "predictions.json")
    builders.score_all()
    assert "Foo++" not in tsttc("board", "val").stdout, "a new method is private"
    offline = json.loads(tsttc("score", "predictions.json", "--truth", "truth.csv", "--json").stdout)
    done = tsttc("board", "val", "--mine")
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[0].startswith("val · edition 1 · updated ")
    own = next(line.split() for line in lines if "Foo++" in line)
    assert own[:4] == ["1", "Foo++", "(private)", "Owls"]
    assert any(line.startswith("   1  Deep Scale") for line in lines), "a private method takes nobody's rank"
    assert own[5] == f"{offline['scores']['overall']['mid']:.2f}"
    assert "Shi et al. (published)  2023" in done.stdout
    document = json.loads(tsttc("board", "val", "--mine", "--sort", "-rte", "--json").stdout)
    assert document["sort"] == "-rte"
    errors = [entry["scores"]["rte"] for entry in document["entries"]]
    assert errors == sorted(errors, reverse=True)
    assert tuple(document["entries"][0]["scores"]) == PROTOCOLS["tsttc-2"].score_names
