"""Board against a real HTTP server: what a person and a program see of it, and what a wrong address gives."""

from __future__ import annotations

import io
import json
import sys
from functools import partial
from typing import Any

import click
import msgspec
import pytest

from evaluator.cli import boards
from evaluator.cli.connection import connect
from evaluator.client.answers import Board
from evaluator.client.api import Client
from evaluator.client.exchange import RetryPolicy
from evaluator.metrics.protocol import SCORE_NAMES
from tests.evaluator.cli.recorded_site import RecordedSite, Reply, problem
from tests.evaluator.fake_time import FakeTime
from tests.evaluator.worlds import Tsttc, on_terminal
from tests.services import free_port

BOARD = "GET /api/v1/splits/test/board"


def published(method: str, values: list[float], *, rank: int) -> dict[str, object]:
    """A row as printed in a paper."""
    scores = dict(zip(SCORE_NAMES, values, strict=True))
    return {
        "rank": rank,
        "method": method,
        "team": "Yuheng Shi, Zehao Huang, Naiyan Wang",
        "date": "2023",
        "kind": "published",
        "decimals": 1,
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

pytestmark = pytest.mark.usefixtures("at_site")


def test_message_about_an_unreachable_server_has_its_address(
    tsttc: Tsttc, clock: FakeTime, monkeypatch: pytest.MonkeyPatch
) -> None:
    url = f"http://127.0.0.1:{free_port()}"
    monkeypatch.setenv("TSTTC_URL", url)
    monkeypatch.setattr("evaluator.client.api.Client", partial(Client, sleep=clock.sleep))
    result = tsttc("board")
    assert result.exit_code == 3
    assert result.stderr.startswith(f"Error: Nothing answers at {url} (")
    assert "Check --server" in result.stderr
    assert 7 < clock.now_s < 15, "a job may begin before its server has"


@pytest.mark.parametrize(("is_terminal", "n_tries"), [(True, 1), (False, RetryPolicy().n_first_tries)])
def test_person_who_watches_hears_of_a_silent_address_at_once(
    monkeypatch: pytest.MonkeyPatch, is_terminal: bool, n_tries: int
) -> None:
    class Screen(io.StringIO):
        def isatty(self) -> bool:
            return is_terminal

    monkeypatch.setattr(sys, "stderr", Screen())
    with connect("http://127.0.0.1:9", with_token=False) as client:
        assert client.retry_policy.n_first_tries == n_tries


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


@pytest.mark.parametrize("arguments", [["status", "../splits"], ["board", "a/b"], ["status", "a?b"]])
def test_name_that_is_no_name_is_wrong_usage(tsttc: Tsttc, site: RecordedSite, arguments: list[str]) -> None:
    result = tsttc(*arguments)
    assert result.exit_code == 2
    assert site.requests == []


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


@pytest.mark.parametrize(
    ("where", "words"),
    [("sort", "The board cannot be sorted by 'x'."), ("at", "'x' is not a date or a time.")],
)
def test_unknown_order_or_moment_is_wrong_usage_in_the_server_s_words(
    tsttc: Tsttc, site: RecordedSite, where: str, words: str
) -> None:
    site.put(BOARD, Reply(problem(words, where=where), 400))
    result = tsttc("board", f"--{where}", "x")
    assert (result.exit_code, result.stderr) == (2, f"Error: {words}\n")


def test_empty_board_says_how_to_be_the_first(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put(BOARD, Reply(BOARD_DOCUMENT | {"entries": [], "edition": None, "updated_at": None}))
    assert tsttc("board").stdout.splitlines() == ["test", "No results yet. Be the first: tsttc submit --help"]


def test_names_of_strangers_cannot_steer_the_terminal(tsttc: Tsttc, site: RecordedSite) -> None:
    entry = BOARD_DOCUMENT["entries"][1] | {"method": "\x1b[31m\u202eevil", "team": "a\nb\x07"}
    site.put(BOARD, Reply(BOARD_DOCUMENT | {"entries": [entry]}))
    shown = tsttc("board").stdout
    assert r"\x1b[31m\u202eevil" in shown
    assert r"a\nb\x07" in shown


def test_rows_of_one_s_own_team_that_others_do_not_see_are_marked(tsttc: Tsttc, site: RecordedSite) -> None:
    row = BOARD_DOCUMENT["entries"][1]
    masked = row | {"method": "Bar", "visibility": "ANONYMOUS", "pseudonym": "Anonymous 3f9c2a"}
    theirs = row | {"method": "Anonymous 77aa00", "visibility": "ANONYMOUS", "pseudonym": None}
    entries = [row | {"visibility": "PRIVATE"}, masked, theirs]
    site.put(BOARD, Reply(BOARD_DOCUMENT | {"entries": entries}))
    shown = tsttc("board", "--mine").stdout
    assert "Foo++ (private)  " in shown
    assert "Bar (anonymous)  " in shown
    assert "Anonymous 77aa00  " in shown
    assert site.requests[0].headers["Authorization"] == "Bearer secret-token"


def test_board_is_shown_in_an_edition_as_of_a_time_and_with_intervals(
    tsttc: Tsttc, site: RecordedSite
) -> None:
    row = BOARD_DOCUMENT["entries"][1]
    known = {"mid": {"low": 19.5, "high": 20.75, "rank_low": 1, "rank_high": 2, "is_with_best": True}}
    answer = Reply(BOARD_DOCUMENT | {"entries": [BOARD_DOCUMENT["entries"][0], row | {"intervals": known}]})
    site.put(BOARD, answer)
    site.put("GET /api/v1/splits/test/editions/1/board", answer)
    lines = tsttc("board", "--at", "2026-11-20", "--intervals").stdout.splitlines()
    assert "20.00 [19.50, 20.75]  21.00  " in lines[5]
    assert lines[5].split()[:2] == ["2", "(1–2)"]
    assert lines[-1].startswith("In square brackets: 95% confidence interval, bootstrap over recordings. In ")
    assert lines[4].index(".8") == lines[5].index(".00"), "decimal points stand below each other"
    assert tsttc("board", "--edition", "1").exit_code == 0
    assert [request.path for request in site.requests] == [
        "/api/v1/splits/test/board?sort=rank&at=2026-11-20&intervals=1",
        "/api/v1/splits/test/editions/1/board?sort=rank",
    ]
    for arguments in (["--edition", "0"], ["--edition", "x"], ["--edition", "1", "--at", "2026-11-20"]):
        assert tsttc("board", *arguments).exit_code == 2
    assert len(site.requests) == 2


def test_board_says_below_what_the_ground_truth_itself_scores(tsttc: Tsttc, site: RecordedSite) -> None:
    floor = {"mid": 0.36, "mid_crucial": 0.0, "mid_negative": None, "rte": 0.73}
    site.put(BOARD, Reply(BOARD_DOCUMENT), Reply(BOARD_DOCUMENT | {"floor": floor}))
    plain = tsttc("board").stdout
    with_floor = tsttc("board").stdout
    assert with_floor.startswith(
        f"{plain}\nFloor: the ground truth itself, submitted as predictions, scores MiD 0.36, "
    )
    assert json.loads(tsttc("board", "--json").stdout)["floor"] == floor


def board_of(document: dict[str, Any]) -> Board:
    return msgspec.convert({**document, "document": document}, Board)


def test_board_on_a_narrow_terminal_keeps_the_main_columns() -> None:
    lines = list(boards.in_words(board_of(BOARD_DOCUMENT), width=70))
    assert click.unstyle(lines[3]).split() == ["rank", "method", "MiD", "RTE"]
    assert max(len(click.unstyle(line)) for line in lines[3:]) <= 70
    assert lines[-1].startswith("The terminal is too narrow")


def test_wide_letters_keep_the_columns_in_line() -> None:
    entry = BOARD_DOCUMENT["entries"][1] | {"method": "时间到接触"}
    rows = [BOARD_DOCUMENT["entries"][0], entry]
    lines = list(boards.in_words(board_of(BOARD_DOCUMENT | {"entries": rows}), width=None))[4:]
    assert lines[0].index("Shi et al.") == lines[1].index("TJU-V") + len("时间到接触")


@pytest.mark.slow
@pytest.mark.parametrize(("environment", "is_styled"), [({}, True), ({"NO_COLOR": "1"}, False)])
def test_real_terminal_gets_bold_unless_it_asks_for_none(
    site: RecordedSite, environment: dict[str, str], is_styled: bool
) -> None:
    site.put(BOARD, Reply(BOARD_DOCUMENT))
    _, shown = on_terminal("board", stream="stdout", COLUMNS="200", **environment)
    assert "Deep Scale" in shown
    assert ("\x1b[1m14.8\x1b[0m" in shown) is is_styled


def test_board_before_the_first_edition_is_shown(tsttc: Tsttc, site: RecordedSite) -> None:
    nothing = ("edition", "protocol", "decimals", "ground_truth", "unit", "n_units", "floor", "updated_at")
    site.put(
        BOARD, Reply(BOARD_DOCUMENT | dict.fromkeys(nothing) | {"entries": BOARD_DOCUMENT["entries"][:1]})
    )
    result = tsttc("board")
    assert result.exit_code == 0, result.stderr
    assert result.output.startswith("test\n")
    assert "Deep Scale" in result.output
    assert json.loads(tsttc("board", "--json").output)["unit"] is None


def test_a_change_that_is_published_by_day_is_shown_by_day(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put(BOARD, Reply(BOARD_DOCUMENT | {"updated_at": "2026-11-28T23:59:59.999999Z"}))
    assert tsttc("board").output.startswith("test · edition 2 · updated 2026-11-28\n")
