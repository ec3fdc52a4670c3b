"""Board against a real HTTP server: what a person and a program see of it, and what a wrong address gives."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import msgspec
import pytest
from click.testing import Result

from evaluator.answers import Board
from evaluator.cli import standings
from evaluator.protocol import SCORE_NAMES
from tests.evaluator.recorded_site import RecordedSite, Reply, problem

REPOSITORY = Path(__file__).resolve().parents[2]
BOARD = "GET /api/v1/splits/test/board"


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
    "updated_at": "2026-11-20T12:00:00.123456Z",
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
pytestmark = pytest.mark.usefixtures("at_site")


def test_unreachable_server_is_told_with_its_address(tsttc: Tsttc, monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))
        url = f"http://127.0.0.1:{unused.getsockname()[1]}"
        monkeypatch.setenv("TSTTC_URL", url)
        result = tsttc("board")
    assert result.exit_code == 3
    assert result.stderr.startswith(f"Error: Nothing answers at {url} (")
    assert "Check --server" in result.stderr


@pytest.mark.parametrize(
    "url",
    [
        "example.org",
        "ftp://example.org",
        "https://",
        "http://[::1",
        "http://example.org:port",
        "https://me:secret@example.org",
        "http://example.org/?x=1",
    ],
)
def test_address_that_is_none_is_wrong_usage(tsttc: Tsttc, url: str) -> None:
    result = tsttc("board", "--url", url)
    assert result.exit_code == 2
    assert "--url" in result.stderr


@pytest.mark.parametrize("host", ["a..b", "xn--a", "a" * 70 + ".org"])
def test_host_that_cannot_exist_is_not_reached(tsttc: Tsttc, host: str) -> None:
    result = tsttc("board", "--url", f"http://{host}:1")
    assert result.exit_code == 3
    assert f"Nothing answers at http://{host}:1" in result.stderr


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


def test_private_rows_of_one_s_own_team_are_marked(tsttc: Tsttc, site: RecordedSite) -> None:
    entries = [row | {"visibility": "PRIVATE"} for row in BOARD_DOCUMENT["entries"][1:2]]
    site.put(BOARD, Reply(BOARD_DOCUMENT | {"entries": entries}))
    assert "Foo++ (private)" in tsttc("board", "--mine").stdout


def found(document: dict[str, Any]) -> Board:
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
