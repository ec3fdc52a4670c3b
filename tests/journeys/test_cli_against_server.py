"""`tsttc` against the leaderboard itself: the same file, numbers and words on both sides."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from django.utils import timezone
from pytest_django import Settings
from pytest_django.live_server_helper import LiveServer

from evaluator.cli import main as cli
from evaluator.client.api import Client
from evaluator.client.exchange import RetryPolicy
from evaluator.metrics.protocol import PROTOCOLS
from leaderboard.editions import ground_truth
from leaderboard.models import Submission, User
from tests import builders
from tests.evaluator.fake_time import FakeTime
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


def _no_folder(settings: Settings) -> None:
    shutil.rmtree(settings.FILES_DIR)
    Path(settings.FILES_DIR).write_text("not a folder")


def _silent_bucket(settings: Settings) -> None:
    options = {"url": "s3://bucket/files?endpoint=http://127.0.0.1:1"}
    store = {"BACKEND": "leaderboard.storage.s3.S3FileStore", "OPTIONS": options}
    settings.STORAGES = {**settings.STORAGES, "files": store}


@pytest.fixture
def waiting_costs_nothing(
    live_server: LiveServer, owner: User, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> FakeTime:
    """The command in this process, which sleeps in no time."""
    clock = FakeTime()
    monkeypatch.setattr("evaluator.client.api.Client", partial(Client, sleep=clock.sleep))
    monkeypatch.setenv("TSTTC_URL", live_server.url)
    monkeypatch.setenv("TSTTC_TOKEN", builders.token(owner))
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    return clock


def submit_here(*more: str) -> Result:
    arguments = ["submit", str(EXAMPLES / "predictions.json"), "--split", "val", "--method", "Foo++", *more]
    return CliRunner().invoke(cli, arguments, prog_name="tsttc")


@pytest.mark.parametrize("spoil", [_no_folder, _silent_bucket])
@pytest.mark.parametrize("more", [(), ("--no-check",)])
def test_a_site_whose_store_is_broken_is_named_with_the_code_of_the_server_and_takes_the_file_later(
    tsttc: Tsttc,
    waiting_costs_nothing: FakeTime,
    settings: Settings,
    monkeypatch: pytest.MonkeyPatch,
    spoil: Callable[[Settings], None],
    more: tuple[str, ...],
) -> None:
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "k")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "s")
    storages_before = settings.STORAGES
    kept = Path(settings.FILES_DIR).with_name("kept")
    shutil.copytree(settings.FILES_DIR, kept)
    spoil(settings)
    for as_json in (False, True):
        done = submit_here(*more, *(["--json"] if as_json else []))
        assert done.exit_code == 7
        # It says at once why it waits.
        sentence = "The file store does not answer at the moment. Nothing was stored or changed."
        assert done.stderr.startswith(sentence)
        assert done.stderr.count("\nTrying again in 30 s.\n") == RetryPolicy().n_tries - 1
        assert "This is not your fault." in done.stderr
        if as_json:
            assert json.loads(done.stdout)["code"] == "store-unavailable"
        else:
            assert done.stdout == ""
    assert not Submission.objects.exists()
    settings.STORAGES = storages_before
    if not Path(settings.FILES_DIR).is_dir():
        Path(settings.FILES_DIR).unlink()
        shutil.copytree(kept, settings.FILES_DIR)
    assert submit_here(*more).exit_code == 0
    assert builders.score_all() == 1
