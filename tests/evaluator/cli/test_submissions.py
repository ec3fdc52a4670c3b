"""Submit and status against a real HTTP server that shows what a healthy leaderboard never does."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result

from evaluator.metrics.protocol import SCORE_NAMES
from tests.evaluator.cli.recorded_site import CUT, RecordedSite, Reply, problem
from tests.evaluator.worlds import REPOSITORY, Tsttc
from tests.signals import default_signals

PREDICTIONS = REPOSITORY / "examples" / "predictions.json"

ID = "1f0c6a2e-6d0b-4f3e-9c55-0d4f2b8f3a11"
POST = "POST /api/v1/submissions"
GET = f"GET /api/v1/submissions/{ID}"
COLUMNS = ["MiD", "MiD_c", "MiD_s", "MiD_l", "MiD_n", "RTE", "RTE_c", "RTE_s", "RTE_l", "RTE_n"]

QUEUED: dict[str, Any] = {
    "id": ID,
    "state": "QUEUED",
    "split": "val",
    "method": "Foo++",
    "url": f"/submissions/{ID}/",
    "queue": {"ahead": 2},
    "scores": None,
    "counts": None,
    "problems": [],
    "n_problems": 0,
    "truncated": {},
    "n_out_of_range": None,
}
SCORED = QUEUED | {
    "state": "SCORED",
    "queue": None,
    "scores": {name: 10 + number + 0.25 for number, name in enumerate(SCORE_NAMES)} | {"mid_small": None},
    "counts": {"overall": 28600, "crucial": 3832, "small": 0, "large": 12470, "negative": 8523},
    "n_out_of_range": 458,
    "truncated": {"-20": 3, "-0.15": 0, "0.05": 1, "20": 12},
}
REJECTED = QUEUED | {
    "state": "REJECTED",
    "queue": None,
    "problems": [
        {"code": "zero", "message": "The value is 0; expected another.", "where": "/8"},
        {"code": "not-json", "message": "The text is not JSON.", "where": ""},
    ],
    "n_problems": 2,
}


pytestmark = [pytest.mark.usefixtures("at_site")]


def submit(tsttc: Tsttc, *more: object) -> Result:
    return tsttc("submit", PREDICTIONS, "--split", "val", "--method", "Foo++", *more)


def test_submit_sends_all_options_and_names_the_submission(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put(POST, Reply(QUEUED, status=201))
    options = {"description": "A test", "paper-url": "https://p.example", "code-url": "https://c.example"}
    options |= {"note": "third try", "commit": "c0ffee"}
    result = submit(tsttc, *[part for name, value in options.items() for part in (f"--{name}", value)])
    assert (result.exit_code, result.stderr) == (0, "")
    assert result.stdout.splitlines() == [
        f"Submission {ID}  {site.url}/submissions/{ID}/",
        "QUEUED, 2 ahead: Foo++ on val",
    ]
    sent = site.posts[0].parts()
    assert sent.pop("file") == ("predictions.json", PREDICTIONS.read_bytes())
    expected = {"split": "val", "method": "Foo++"} | {k.replace("-", "_"): v for k, v in options.items()}
    assert {name: content.decode() for name, (_, content) in sent.items()} == expected
    assert site.posts[0].headers["Authorization"] == "Bearer secret-token"
    assert site.posts[0].headers["User-Agent"].startswith("tsttc/")


@pytest.mark.slow
def test_submit_takes_standard_input(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put(POST, Reply(fault=CUT), Reply(QUEUED, status=201))
    result = tsttc("submit", "-", "--split", "val", "--method", "Foo++", stdin=b'{"0": 1.5}')
    assert result.exit_code == 0
    sent = [request.parts()["file"] for request in site.posts]
    assert sent == [("predictions.json", b'{"0": 1.5}')] * 2


def test_file_whose_name_is_no_text_is_sent_under_another(
    tsttc: Tsttc, site: RecordedSite, tmp_path: Path
) -> None:
    site.put(POST, Reply(QUEUED, status=201))
    odd = tmp_path / os.fsdecode(b"\xff.json")
    odd.write_bytes(b"{}")
    assert tsttc("submit", odd, "--split", "val", "--method", "Foo").exit_code == 0
    assert site.posts[0].parts()["file"] == ("predictions.json", b"{}")


@pytest.mark.parametrize("option", ["--method", "--note", "--commit"])
def test_words_that_are_no_text_are_wrong_usage(tsttc: Tsttc, site: RecordedSite, option: str) -> None:
    result = submit(tsttc, option, os.fsdecode(b"\xff"))
    assert result.exit_code == 2
    assert "expected UTF-8 text" in result.stderr
    assert site.requests == []


@pytest.mark.slow
def test_wait_ends_with_the_scores(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put(POST, Reply(QUEUED, status=201))
    site.put(GET, Reply(QUEUED | {"state": "RUNNING", "queue": None}), Reply(SCORED))
    result = submit(tsttc, "--wait")
    assert result.exit_code == 0
    assert result.stderr == "RUNNING\n"
    lines = result.stdout.splitlines()
    assert lines[1:3] == ["SCORED: Foo++ on val", ""]
    assert lines[3].split() == COLUMNS
    assert lines[4].split()[:4] == ["error", "10.25", "11.25", "–"]
    assert "28,600 sequences, 458 of them in no TTC range, which count in the overall scores only." in lines
    assert "Truncated predictions: 3 set to −20 s, 1 set to 0.05 s, 12 set to 20 s." in lines


@pytest.mark.slow
def test_json_is_the_server_s_document_alone(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put(POST, Reply(QUEUED, status=201))
    site.put(GET, Reply(SCORED | {"new_member": [1]}))
    assert json.loads(submit(tsttc, "--json").stdout) == QUEUED
    assert json.loads(submit(tsttc, "--wait", "--json").stdout) == SCORED | {"new_member": [1]}
    assert json.loads(tsttc("status", ID, "--json").stdout) == SCORED | {"new_member": [1]}


@pytest.mark.slow
def test_status_asks_once_and_watch_asks_until_the_end(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put(GET, Reply(QUEUED), Reply(QUEUED), Reply(SCORED))
    once = tsttc("status", ID)
    assert (once.exit_code, once.stdout) == (0, "QUEUED, 2 ahead: Foo++ on val\n")
    watched = tsttc("status", ID, "--watch")
    assert watched.exit_code == 0
    assert watched.stdout.startswith("SCORED: Foo++ on val\n")


def test_rejected_file_is_the_file_s_fault_with_numbered_problems(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put(GET, Reply(REJECTED))
    result = tsttc("status", ID, "--watch")
    assert (result.exit_code, result.stdout) == (1, "")
    assert result.stderr.splitlines()[:3] == [
        "Error: The file is rejected: 2 problems.",
        '  1. "8": The value is 0; expected another.',
        "  2. The text is not JSON.",
    ]
    as_json = tsttc("status", ID, "--json")
    assert as_json.exit_code == 1
    assert json.loads(as_json.stdout) == REJECTED


@pytest.mark.parametrize(
    ("state", "exit_code", "words"),
    [
        ("SYSTEM_ERROR", 7, "The fault is not the file's."),
        ("CANCELLED", 8, "was cancelled, so it has no scores"),
    ],
)
def test_submission_without_scores_says_whose_turn_it_is(
    tsttc: Tsttc, site: RecordedSite, state: str, exit_code: int, words: str
) -> None:
    site.put(GET, Reply(QUEUED | {"state": state, "queue": None}))
    result = tsttc("status", ID)
    assert result.exit_code == exit_code
    assert words in result.stderr


@pytest.mark.slow
def test_timeout_says_that_the_submission_goes_on(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put(POST, Reply(QUEUED, status=201))
    site.put(GET, Reply(QUEUED))
    result = submit(tsttc, "--wait", "--timeout", "0.1")
    assert result.exit_code == 9
    assert f"Submission {ID} is not final after 0.1 s. It was QUEUED last." in result.stderr
    assert f"tsttc status {ID} --watch" in result.stderr
    document = json.loads(submit(tsttc, "--wait", "--timeout", "0.1", "--json").stdout)
    assert (document["code"], document["submission"]) == ("timeout", QUEUED)


def test_waiting_job_knows_its_submission_from_the_start(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put(POST, Reply(QUEUED, status=201))
    site.put(GET, Reply(SCORED))
    result = submit(tsttc, "--wait", "--json")
    assert result.stderr == f"Submission {ID}  {site.url}/submissions/{ID}/\n"
    assert json.loads(result.stdout) == SCORED


def test_token_on_an_unencrypted_way_is_warned_of(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put(GET, Reply(SCORED))
    assert tsttc("status", ID).stderr == ""
    elsewhere = site.url.replace("127.0.0.1", "127.1")  # the same machine under a name that does not look it
    result = tsttc("status", ID, "--url", elsewhere)
    assert result.exit_code == 0
    assert result.stderr == f"Warning: the token goes to {elsewhere} unencrypted; use https where you can.\n"


@pytest.mark.parametrize("command", ["submit", "status"])
@pytest.mark.parametrize("token", ["", "  ", "to ken", "tökén", "a\nb"])
def test_empty_or_senseless_token_is_refused_and_nothing_is_sent(
    tsttc: Tsttc, site: RecordedSite, monkeypatch: pytest.MonkeyPatch, command: str, token: str
) -> None:
    monkeypatch.setenv("TSTTC_TOKEN", token)
    result = submit(tsttc) if command == "submit" else tsttc("status", ID)
    assert result.exit_code == 4
    assert "TSTTC_TOKEN" in result.stderr
    assert site.requests == []


def test_token_is_no_option(tsttc: Tsttc) -> None:
    for command in ("submit", "status", "board"):
        assert "--token" not in tsttc(command, "--help").stdout


@pytest.mark.slow
@pytest.mark.parametrize(
    ("reply", "exit_code", "words"),
    [
        (Reply(problem("Invalid token."), 401), 4, "Error: Invalid token.\nCreate a token at http://"),
        (Reply(problem("Not yours."), 403), 4, "Error: Not yours."),
        (Reply(problem("Page not found."), 404), 8, "Error: Page not found."),
        (Reply(problem("The split is closed.", where="split"), 409), 8, "Error: The split is closed."),
        (Reply(problem("It has 21 MB.", where="file"), 413), 1, "Error: It has 21 MB."),
        (Reply(problem("No such split 'x'.", where="split"), 422), 2, "Error: No such split 'x'."),
        (Reply(problem("The file is empty.", where="file"), 422), 1, "Error: The file is empty."),
        (Reply(b"<html>", 400), 1, "The server refused (400: Bad Request)."),
        (Reply(b"<html>nginx</html>", 413), 1, "its page “Submit” says how large a file may be."),
        (
            Reply(problem("5 a day; the next slot opens at noon."), 429, {"Retry-After": "7200"}),
            5,
            "Error: 5 a day; the next slot opens at noon.\nTry again in 2 h.\n",
        ),
        (Reply(b"<html>gateway</html>", 500), 7, "The server failed (500: Internal Server Error)."),
        (Reply(b"<html>", 401), 4, "The server does not accept the token (401: Unauthorized)."),
        (Reply(status=418), 8, "The server refused (418"),
        (
            Reply(status=301, headers={"Location": "https://e.example/"}),
            3,
            "a redirect to https://e.example/",
        ),
        (Reply(b"<html>hello</html>", 200), 3, "did not answer like a leaderboard: not JSON"),
        (Reply({"hello": "world"}, 200), 3, "Object missing required field"),
    ],
)
def test_refusal_is_explained_in_plain_words_and_by_whose_fault_it_is(
    tsttc: Tsttc, site: RecordedSite, reply: Reply, exit_code: int, words: str
) -> None:
    site.put(POST, reply)
    result = submit(tsttc)
    assert result.exit_code == exit_code
    assert words in result.stderr
    assert result.stderr.count(words) == 1
    assert "Traceback" not in result.output
    assert result.stdout == ""


def test_refusal_as_json_is_the_server_s_own_document(tsttc: Tsttc, site: RecordedSite) -> None:
    document = problem("5 a day.", code="quota")
    site.put(POST, Reply(document, 429))
    assert json.loads(submit(tsttc, "--json").stdout) == document


def test_fault_without_a_document_still_gives_json(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put(POST, Reply(b"<html>gateway</html>", 500))
    document = json.loads(submit(tsttc, "--json").stdout)
    assert (document["code"], document["problems"]) == ("http-500", [])
    assert document["title"].startswith("The server failed (500")


def test_name_of_a_method_cannot_steer_the_terminal(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put(GET, Reply(SCORED | {"method": "\x1b[31mevil"}))
    assert r"\x1b[31mevil on val" in tsttc("status", ID).stdout


@pytest.mark.slow
def test_ctrl_c_while_waiting_ends_quietly_with_130(site: RecordedSite) -> None:
    site.put(GET, Reply(QUEUED))
    with default_signals():
        waiting = subprocess.Popen(
            [sys.executable, "-m", "evaluator", "status", ID, "--watch"],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=REPOSITORY,
            env=os.environ | {"TSTTC_URL": site.url, "TSTTC_TOKEN": "secret-token"},
        )
    try:
        assert waiting.stderr is not None
        assert waiting.stderr.readline() == "QUEUED, 2 ahead\n"
        waiting.send_signal(signal.SIGINT)
        stdout, stderr = waiting.communicate(timeout=120)
    finally:
        waiting.kill()
    assert (waiting.returncode, stdout, stderr.strip()) == (130, "", "Interrupted.")
