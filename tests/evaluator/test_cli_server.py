"""submit, status and board against a real HTTP server that shows what a healthy leaderboard never does."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import click
import pytest
from click.testing import CliRunner, Result

from evaluator.answers import Board
from evaluator.cli import main, standings
from evaluator.protocol import SCORE_NAMES
from tests.evaluator.recorded_site import CUT, RecordedSite, Reply

REPOSITORY = Path(__file__).resolve().parents[2]
PREDICTIONS = REPOSITORY / "examples" / "predictions.json"

ID = "1f0c6a2e-6d0b-4f3e-9c55-0d4f2b8f3a11"
POST = "POST /api/v1/submissions"
GET = f"GET /api/v1/submissions/{ID}"
COLUMNS = ["MiD", "MiD_c", "MiD_s", "MiD_l", "MiD_n", "RTE", "RTE_c", "RTE_s", "RTE_l", "RTE_n"]
BOARD = "GET /api/v1/splits/test/board"

QUEUED: dict[str, Any] = {
    "id": ID,
    "state": "QUEUED",
    "split": "val",
    "method": "Foo++",
    "url": f"/submissions/{ID}/",
    "queue": {"ahead": 2, "estimate_s": 4.2},
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


def published(method: str, values: list[float], *, rank: int) -> dict[str, object]:
    """A row as printed in a paper."""
    scores = dict(zip(SCORE_NAMES, values, strict=True))
    return {
        "rank": rank,
        "method": method,
        "team": "Yuheng Shi, Zehao Huang",
        "date": "2023",
        "kind": "published",
        "scores": scores,
    }


BOARD_DOCUMENT: dict[str, Any] = {
    "split": "test",
    "edition": 2,
    "updated_at": "2026-11-20T12:00:00Z",
    "entries": [
        published("Deep Scale", [14.8, 27.6, 15.6, 11.5, 13.7, 12.3, 6.5, 8.8, 13.1, 15.0], rank=1),
        {
            "rank": 2,
            "method": "Foo++",
            "team": "TJU-V",
            "date": "2026-11-20",
            "kind": "submission",
            "scores": {name: 20.0 + number for number, name in enumerate(SCORE_NAMES)},
        },
        {
            "rank": None,
            "method": "Late",
            "team": "TJU-V",
            "kind": "submission",
            "scores": dict.fromkeys(SCORE_NAMES),
        },
    ],
}

Tsttc = Callable[..., Result]


@pytest.fixture
def site() -> Iterator[RecordedSite]:
    with RecordedSite() as running:
        yield running


@pytest.fixture
def tsttc(site: RecordedSite, monkeypatch: pytest.MonkeyPatch) -> Tsttc:
    """Run the command against the recorded site, with a token."""
    monkeypatch.setenv("TSTTC_URL", site.url)
    monkeypatch.setenv("TSTTC_TOKEN", "secret-token")

    def run(*arguments: object, stdin: bytes = b"") -> Result:
        return CliRunner().invoke(main, list(map(str, arguments)), input=stdin, prog_name="tsttc")

    return run


def submit(tsttc: Tsttc, *more: object) -> Result:
    return tsttc("submit", PREDICTIONS, "--split", "val", "--method", "Foo++", *more)


def test_submit_sends_what_was_said_and_names_the_submission(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put(POST, Reply(QUEUED, status=201))
    said = {"description": "A test", "paper-url": "https://p.example", "code-url": "https://c.example"}
    said |= {"note": "third try", "commit": "c0ffee"}
    result = submit(tsttc, *[part for name, value in said.items() for part in (f"--{name}", value)])
    assert (result.exit_code, result.stderr) == (0, "")
    assert result.stdout.splitlines() == [
        f"Submission {ID}  {site.url}/submissions/{ID}/",
        "QUEUED, 2 ahead, about 4 s: Foo++ on val",
    ]
    sent = site.requests[0].parts()
    assert sent.pop("file") == ("predictions.json", PREDICTIONS.read_bytes())
    expected = {"split": "val", "method": "Foo++"} | {k.replace("-", "_"): v for k, v in said.items()}
    assert {name: content.decode() for name, (_, content) in sent.items()} == expected
    assert site.requests[0].headers["Authorization"] == "Bearer secret-token"
    assert site.requests[0].headers["User-Agent"].startswith("tsttc/")


def test_submit_takes_standard_input(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put(POST, Reply(fault=CUT), Reply(QUEUED, status=201))
    result = tsttc("submit", "-", "--split", "val", "--method", "Foo++", stdin=b'{"0": 1.5}')
    assert result.exit_code == 0
    sent = [request.parts()["file"] for request in site.requests]
    assert sent == [("predictions.json", b'{"0": 1.5}')] * 2


def test_file_sent_before_is_said_to_be(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put(POST, Reply(SCORED, status=200))
    result = submit(tsttc, "--wait")
    assert result.exit_code == 0
    assert "This file was sent before; this is its first submission." in result.stdout
    assert len(site.requests) == 1


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
    assert "28,600 sequences, 458 of them with |τ| > 20 s, which count in MiD and RTE alone." in lines
    assert "Truncated predictions: 3 to -20 s, 1 to 0.05 s, 12 to 20 s." in lines


def test_json_is_the_server_s_document_alone(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put(POST, Reply(QUEUED, status=201))
    site.put(GET, Reply(SCORED | {"new_member": [1]}))
    assert json.loads(submit(tsttc, "--json").stdout) == QUEUED
    assert json.loads(submit(tsttc, "--wait", "--json").stdout) == SCORED | {"new_member": [1]}
    assert json.loads(tsttc("status", ID, "--json").stdout) == SCORED | {"new_member": [1]}


def test_status_asks_once_and_watch_asks_until_the_end(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put(GET, Reply(QUEUED), Reply(QUEUED), Reply(SCORED))
    once = tsttc("status", ID)
    assert (once.exit_code, once.stdout) == (0, "QUEUED, 2 ahead, about 4 s: Foo++ on val\n")
    watched = tsttc("status", ID, "--watch")
    assert watched.exit_code == 0
    assert watched.stdout.startswith("SCORED: Foo++ on val\n")


@pytest.mark.parametrize("arguments", [["status", ID], ["status", ID, "--watch"]])
def test_rejected_file_is_the_file_s_fault_with_numbered_problems(
    tsttc: Tsttc, site: RecordedSite, arguments: list[str]
) -> None:
    site.put(GET, Reply(REJECTED))
    result = tsttc(*arguments)
    assert (result.exit_code, result.stdout) == (1, "")
    assert result.stderr.splitlines()[:3] == [
        "Error: The file is rejected: 2 problems.",
        "  1. /8: The value is 0; expected another.",
        "  2. The text is not JSON.",
    ]
    as_json = tsttc(*arguments, "--json")
    assert as_json.exit_code == 1
    assert json.loads(as_json.stdout) == REJECTED


@pytest.mark.parametrize(
    ("state", "words"),
    [("SYSTEM_ERROR", "The fault is not the file's."), ("CANCELLED", "was cancelled, so it has no scores")],
)
def test_submission_without_scores_that_is_no_fault_of_the_file_ends_with_3(
    tsttc: Tsttc, site: RecordedSite, state: str, words: str
) -> None:
    site.put(GET, Reply(QUEUED | {"state": state, "queue": None}))
    result = tsttc("status", ID)
    assert result.exit_code == 3
    assert words in result.stderr


def test_timeout_says_that_the_submission_goes_on(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put(POST, Reply(QUEUED, status=201))
    site.put(GET, Reply(QUEUED))
    result = submit(tsttc, "--wait", "--timeout", "0.1")
    assert result.exit_code == 3
    assert f"Submission {ID} is not final after 0.1 s. It was QUEUED last." in result.stderr
    assert f"tsttc status {ID} --watch" in result.stderr


@pytest.mark.parametrize("command", ["submit", "status"])
@pytest.mark.parametrize("token", ["", "  ", "to ken", "tökén", "a\nb"])
def test_missing_or_senseless_token_is_wrong_usage_and_nothing_is_sent(
    tsttc: Tsttc, site: RecordedSite, monkeypatch: pytest.MonkeyPatch, command: str, token: str
) -> None:
    monkeypatch.setenv("TSTTC_TOKEN", token)
    result = submit(tsttc) if command == "submit" else tsttc("status", ID)
    assert result.exit_code == 2
    assert "TSTTC_TOKEN" in result.stderr
    assert site.requests == []


def test_token_is_no_option(tsttc: Tsttc) -> None:
    for command in ("submit", "status", "board"):
        assert "--token" not in tsttc(command, "--help").stdout


def problem(detail: str, *, code: str = "x", where: str = "") -> dict[str, object]:
    """An error as the API words it: the sentence as detail and as the one problem."""
    return {
        "title": "Title",
        "detail": detail,
        "code": code,
        "problems": [{"code": code, "message": detail, "where": where}],
    }


@pytest.mark.parametrize(
    ("reply", "exit_code", "words"),
    [
        (Reply(problem("Invalid token."), 401), 3, "The server does not accept the token: Invalid token."),
        (Reply(problem("Not yours."), 403), 3, "This token may not do that: Not yours."),
        (Reply(problem("There is nothing here."), 404), 3, "knows no such thing: There is nothing here."),
        (Reply(problem("The split is closed.", where="split"), 409), 3, "The split is closed."),
        (Reply(problem("It has 21 MB.", where="file"), 413), 1, "The file is too large: It has 21 MB."),
        (Reply(problem("No such split 'x'.", where="split"), 422), 2, "No such split 'x'."),
        (Reply(problem("The file is empty.", where="file"), 422), 1, "The file is empty."),
        (Reply(b"<html>", 400), 1, "Bad Request"),
        (Reply(problem("5 a day."), 429, {"Retry-After": "7200"}), 3, "Too much at once: 5 a day."),
        (Reply(b"<html>gateway</html>", 500), 3, "The server failed (500: Internal Server Error)."),
        (Reply(status=418), 3, "The server refused (418"),
        (Reply(status=301, headers={"Location": "https://e.example/"}), 3, "points to https://e.example/"),
        (Reply(b"<html>hello</html>", 200), 3, "gave no leaderboard's answer: not JSON"),
        (Reply({"hello": "world"}, 200), 3, "Object missing required field"),
    ],
)
def test_refusal_is_told_in_plain_words_and_by_whose_fault_it_is(
    tsttc: Tsttc, site: RecordedSite, reply: Reply, exit_code: int, words: str
) -> None:
    site.put(POST, reply)
    result = submit(tsttc)
    assert result.exit_code == exit_code
    assert words in result.stderr
    assert result.stderr.count(words) == 1
    assert "Traceback" not in result.output
    assert result.stdout == ""


def test_quota_says_when_to_come_back(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put(POST, Reply(problem("5 a day."), 429, {"Retry-After": "7200"}))
    assert "Try again in 2 h." in submit(tsttc).stderr


def test_refusal_as_json_is_the_server_s_own_document(tsttc: Tsttc, site: RecordedSite) -> None:
    document = problem("5 a day.", code="quota")
    site.put(POST, Reply(document, 429))
    assert json.loads(submit(tsttc, "--json").stdout) == document


def test_fault_without_a_document_still_gives_json(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put(POST, Reply(b"<html>gateway</html>", 500))
    document = json.loads(submit(tsttc, "--json").stdout)
    assert (document["code"], document["problems"]) == ("http-500", [])
    assert document["title"].startswith("The server failed (500")


def test_unreachable_server_is_told_with_its_address(tsttc: Tsttc, monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))
        url = f"http://127.0.0.1:{unused.getsockname()[1]}"
        monkeypatch.setenv("TSTTC_URL", url)
        result = tsttc("board")
    assert result.exit_code == 3
    assert result.stderr.startswith(f"Error: Nothing answers at {url} (")
    assert "Check --url" in result.stderr


@pytest.mark.parametrize(
    "url",
    ["example.org", "ftp://example.org", "https://", "https://me:secret@example.org", "http://e.org/?x=1"],
)
def test_address_that_is_none_is_wrong_usage(tsttc: Tsttc, url: str) -> None:
    result = tsttc("board", "--url", url)
    assert result.exit_code == 2
    assert "--url" in result.stderr


@pytest.mark.parametrize("arguments", [["status", "../splits"], ["board", "a/b"], ["status", "a?b"]])
def test_name_that_is_no_name_is_wrong_usage(tsttc: Tsttc, site: RecordedSite, arguments: list[str]) -> None:
    result = tsttc(*arguments)
    assert result.exit_code == 2
    assert site.requests == []


def test_board_shows_rank_names_and_the_ten_columns(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put(BOARD, Reply(BOARD_DOCUMENT))
    result = tsttc("board")
    assert (result.exit_code, result.stderr) == (0, "")
    lines = result.stdout.splitlines()
    assert lines[0] == "test · edition 2 · updated 2026-11-20T12:00:00Z"
    assert lines[3].split()[:6] == ["rank", "method", "team", "date", "MiD", "MiD_c"]
    printed = "14.8  27.6   15.6   11.5   13.7  12.3    6.5    8.8   13.1   15.0"
    assert lines[4].split() == [
        *("1", "Deep", "Scale", "Shi", "et", "al.", "(published)", "2023"),
        *printed.split(),
    ]
    assert lines[5].split()[:6] == ["2", "Foo++", "TJU-V", "2026-11-20", "20.00", "21.00"]
    assert lines[6].split() == ["–", "Late", "TJU-V", *["–"] * 10]
    assert lines[4].index(".8") == lines[5].index(".00"), "decimal points stand below each other"
    assert "\x1b" not in result.stdout


def test_board_needs_no_token_and_sends_none(
    tsttc: Tsttc, site: RecordedSite, monkeypatch: pytest.MonkeyPatch
) -> None:
    site.put(BOARD, Reply(BOARD_DOCUMENT))
    assert tsttc("board").exit_code == 0
    monkeypatch.delenv("TSTTC_TOKEN")
    assert tsttc("board").exit_code == 0
    assert [request.headers["Authorization"] for request in site.requests] == [None, None]


def test_board_asks_for_split_and_order_and_prints_json_as_it_came(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put("GET /api/v1/splits/val/board", Reply(BOARD_DOCUMENT))
    result = tsttc("board", "val", "--sort", "-rte_crucial", "--json")
    assert json.loads(result.stdout) == BOARD_DOCUMENT
    assert site.requests[0].path.endswith("?sort=-rte_crucial")


def test_unknown_order_is_wrong_usage_in_the_server_s_words(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put(BOARD, Reply(problem("The board cannot be sorted by 'x'.", where="sort"), 400))
    result = tsttc("board", "--sort", "x")
    assert result.exit_code == 2
    assert "The board cannot be sorted by 'x'." in result.stderr


def test_empty_board_says_how_to_be_the_first(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put(BOARD, Reply(BOARD_DOCUMENT | {"entries": [], "edition": None, "updated_at": None}))
    assert tsttc("board").stdout.splitlines() == ["test", "No results yet. Be the first: tsttc submit --help"]


def test_names_of_strangers_cannot_steer_the_terminal(tsttc: Tsttc, site: RecordedSite) -> None:
    entry = BOARD_DOCUMENT["entries"][1] | {"method": "\x1b[31m\u202eevil", "team": "a\nb\x07"}
    site.put(BOARD, Reply(BOARD_DOCUMENT | {"entries": [entry]}))
    shown = tsttc("board").stdout
    assert r"\x1b[31m\u202eevil" in shown
    assert r"a\nb\x07" in shown
    site.put(GET, Reply(SCORED | {"method": "\x1b[31mevil"}))
    assert r"\x1b[31mevil on val" in tsttc("status", ID).stdout


def found(document: dict[str, Any]) -> Board:
    import msgspec  # noqa: PLC0415 -- what the client does with an answer

    return msgspec.convert({**document, "document": document}, Board)


def test_board_on_a_terminal_marks_best_and_second() -> None:
    lines = list(standings.in_words(found(BOARD_DOCUMENT), width=200))
    assert "\x1b[1m14.8\x1b[0m" in lines[4]
    assert "\x1b[4m20.00\x1b[0m" in lines[5]
    assert "\x1b" not in lines[6]


def test_board_on_a_narrow_terminal_keeps_the_main_columns() -> None:
    lines = list(standings.in_words(found(BOARD_DOCUMENT), width=70))
    assert click.unstyle(lines[3]).split() == ["rank", "method", "MiD", "RTE"]
    assert max(len(click.unstyle(line)) for line in lines[3:]) <= 70
    assert lines[-1].startswith("Too narrow")


def test_wide_letters_keep_the_columns_in_line() -> None:
    entry = BOARD_DOCUMENT["entries"][1] | {"method": "时间到接触"}
    rows = [BOARD_DOCUMENT["entries"][0], entry]
    lines = list(standings.in_words(found(BOARD_DOCUMENT | {"entries": rows}), width=None))[4:]
    assert lines[0].index("Shi et al.") == lines[1].index("TJU-V") + len("时间到接触")


@pytest.mark.parametrize(("environment", "is_styled"), [({}, True), ({"NO_COLOR": "1"}, False)])
def test_real_terminal_gets_bold_unless_it_asks_for_none(
    site: RecordedSite, environment: dict[str, str], is_styled: bool
) -> None:
    site.put(BOARD, Reply(BOARD_DOCUMENT))
    terminal, end = os.openpty()
    subprocess.run(
        [sys.executable, "-m", "evaluator", "board"],
        stdin=subprocess.DEVNULL,
        stdout=end,
        check=True,
        cwd=REPOSITORY,
        env=os.environ | {"TSTTC_URL": site.url, "COLUMNS": "200"} | environment,
    )
    with open(terminal, "rb", buffering=0) as screen:  # noqa: PTH123 -- a descriptor, not a path
        shown = screen.read(1 << 16).decode()
    os.close(end)
    assert "Deep Scale" in shown
    assert ("\x1b[1m14.8\x1b[0m" in shown) is is_styled


def test_ctrl_c_while_waiting_ends_quietly_with_130(site: RecordedSite) -> None:
    site.put(GET, Reply(QUEUED))
    waiting = subprocess.Popen(
        [sys.executable, "-m", "evaluator", "status", ID, "--watch"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=REPOSITORY,
        env=os.environ | {"TSTTC_URL": site.url, "TSTTC_TOKEN": "secret-token"},
    )
    assert waiting.stderr is not None
    assert waiting.stderr.readline() == "QUEUED, 2 ahead, about 4 s\n"
    waiting.send_signal(signal.SIGINT)
    stdout, stderr = waiting.communicate(timeout=30)
    assert (waiting.returncode, stdout, stderr.strip()) == (130, "", "Interrupted.")
