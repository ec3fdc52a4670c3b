"""quota, compare, publish, receipt and verify, as a person and as a program call them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from evaluator import compare_predictions, read_predictions, read_truth
from evaluator.metrics.protocol import SCORE_NAMES
from evaluator.receipts import key_set, public_key
from evaluator.tables.sentences import influence, sentence
from tests.evaluator.cli.console import METHOD_ID, RECEIPT, RECEIPT_KEYS
from tests.evaluator.cli.recorded_site import RecordedSite, Reply, problem
from tests.evaluator.worlds import EXAMPLES, Tsttc

pytestmark = pytest.mark.usefixtures("at_site")

SENTENCE = "Your team has used 3 submissions to test; the next slot opens at 2026-12-04 09:13 UTC."
QUOTAS: list[dict[str, Any]] = [
    {"split": "val", "limit": None, "used": 4, "left": None, "is_open": True, "sentence": "Any number."},
    {"split": "test", "limit": 3, "used": 3, "left": 0, "is_open": False, "sentence": SENTENCE}
    | {"next_slot_at": "2026-12-04T09:13:00Z"},
]


def test_quota_of_one_split_is_its_document(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put("GET /api/v1/quota", Reply(QUOTAS))
    assert tsttc("quota").stdout.splitlines()[1].split() == ["val", "–", "any", "number", "now"]
    assert json.loads(tsttc("quota", "test", "--json").stdout) == QUOTAS[1]
    unknown = tsttc("quota", "trial")
    assert (unknown.exit_code, unknown.stdout, "'trial'" in unknown.stderr) == (2, "", True)


# --- compare ----------------------------------------------------------------------------------------------


def board(*names: tuple[str, str | None]) -> Reply:
    scores = dict.fromkeys(SCORE_NAMES, 14.0)
    entries = [{"method": name, "method_id": key, "team": "T", "scores": scores} for name, key in names]
    return Reply({"split": "val", "edition": 2, "entries": entries})


@pytest.mark.slow
def test_compare_asks_until_it_is_computed(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put("GET /api/v1/splits/val/board", board(("A", "id-a"), ("B", "id-b")))
    differences: dict[str, Any] = dict.fromkeys(SCORE_NAMES)
    differences["mid"] = {"difference": -1.2, "low": -2.0, "high": -0.4, "p": 0.003, "is_significant": True}
    waiting = {"split": "val", "edition": 2, "is_complete": False, "reason": "", "entries": []}
    pair = {"first": "id-a", "second": "id-b", "differences": differences, "sentence": "A is better."}
    ready = waiting | {"is_complete": True, "pairs": [pair]}
    unready = waiting | {"pairs": [pair | {"differences": None, "sentence": ""}]}
    site.put("GET /api/v1/compare", Reply(unready, status=202), Reply(ready))
    result = tsttc("compare", "A", "id-b", "--split", "val")
    assert (result.exit_code, result.stderr) == (0, "")
    rows = {line.split("  ")[0]: line.split() for line in result.stdout.splitlines()}
    assert rows["difference"][1:3] == ["-1.20", "–"]
    assert result.stdout.endswith("\n\nA is better.\n")
    assert site.requests[-1].path == "/api/v1/compare?split=val&m=id-a&m=id-b"
    assert json.loads(tsttc("compare", "A", "B", "--split", "val", "--json").stdout) == ready


def test_compare_names_what_it_does_not_find_and_what_cannot_be_compared(
    tsttc: Tsttc, site: RecordedSite
) -> None:
    site.put("GET /api/v1/splits/test/board", board(("A", "id-a"), ("Paper", None)))
    unknown = tsttc("compare", "A", "C")
    assert (unknown.exit_code, "has no method 'C'" in unknown.stderr) == (2, True)
    printed = tsttc("compare", "A", "Paper")
    assert (printed.exit_code, "quoted from a paper" in printed.stderr) == (2, True)
    words = "One method is given twice; expected different methods to compare."
    site.put("GET /api/v1/compare", Reply(problem(words, where="m"), 400))
    twice = tsttc("compare", "A", "A")
    assert (twice.exit_code, twice.stderr) == (2, f"Error: {words}\n")


def test_files_are_compared_offline_as_the_library_does(
    tsttc: Tsttc, site: RecordedSite, tmp_path: Path, truth_of_30_recordings: Path
) -> None:
    truth = read_truth(truth_of_30_recordings)
    files = []
    for name, factor in (("good", 1.05), ("bad", 1.3)):
        values = dict(zip(truth.manifest.anno_id_keys, (truth.ttc_s * factor).tolist(), strict=True))
        files.append(tmp_path / f"{name}.json")
        files[-1].write_text(json.dumps(values))
    arguments = ["compare", *files, "--truth", truth_of_30_recordings]
    document = json.loads(tsttc(*arguments, "--json").stdout)
    read = [read_predictions(path.read_bytes(), manifest=truth.manifest) for path in files]
    expected = compare_predictions(read[0], read[1], truth)
    assert document["differences"]["mid"]["p"] == expected["mid"].p
    assert document["differences"]["mid"]["low"] == expected["mid"].low
    assert document["first"]["scores"]["overall"]["mid"] < document["second"]["scores"]["overall"]["mid"]
    text = tsttc(*arguments).stdout
    assert sentence("good.json", "bad.json", name="mid", difference=expected["mid"]) in text
    assert "9 of the 9 other metrics differ significantly" in text
    assert influence("good.json", "bad.json", difference=expected["mid"]) in text.splitlines()
    assert site.requests == []
    bad = tsttc("compare", EXAMPLES / "broken.json", files[0], "--truth", truth_of_30_recordings)
    assert bad.exit_code == 1
    assert "broken.json is rejected" in bad.stderr


def test_files_are_compared_offline_by_the_protocol_of_the_board(
    tsttc: Tsttc, site: RecordedSite, tmp_path: Path, truth_of_30_recordings: Path
) -> None:
    truth = read_truth(truth_of_30_recordings)
    files = []
    for factor in (1.05, 1.3):
        values = dict(zip(truth.manifest.anno_id_keys, (truth.ttc_s * factor).tolist(), strict=True))
        files.append(tmp_path / f"{factor}.json")
        files[-1].write_text(json.dumps(values))
    arguments = ["compare", *files, "--truth", truth_of_30_recordings, "--protocol", "tsttc-2"]
    compared = json.loads(tsttc(*arguments, "--json").stdout)["differences"]
    read = [read_predictions(path.read_bytes(), manifest=truth.manifest) for path in files]
    expected = compare_predictions(read[0], read[1], truth, protocol="tsttc-2")
    assert compared.keys() == expected.keys()
    assert compared["warning"]["difference"] == expected["warning"].difference
    assert "WE" in tsttc(*arguments).stdout
    assert site.requests == []
    online = tsttc("compare", "A", "B", "--protocol", "tsttc-2")
    assert (online.exit_code, "--protocol needs --truth" in online.stderr) == (2, True)


@pytest.fixture
def truth_of_30_recordings(tmp_path: Path) -> Path:
    rows = [f"{i},bag{i % 30},1,{i},7,{(i % 37 - 18) / 2 + 0.3}" for i in range(300)]
    path = tmp_path / "truth.csv"
    path.write_text("\n".join(["anno_id,bag_stamp,cam_id,ts,track_id,ttc", *rows, ""]))
    return path


# --- publish ----------------------------------------------------------------------------------------------

MINE = {"id": METHOD_ID, "name": "Foo++", "visibility": "PRIVATE"}
SHOW = f"POST /api/v1/methods/{METHOD_ID}/visibility"
PREVIEW_ADDRESS = f"GET /api/v1/methods/{METHOD_ID}/visibility"
SCORES = dict.fromkeys(SCORE_NAMES, 14.0)
MOVED = [{"method": f"M{n}", "method_id": None, "rank_before": n, "rank_after": n + 1} for n in range(3, 10)]
PREVIEW: dict[str, Any] = {
    "visibility": "PUBLIC",
    "name": "Foo++",
    "team": "TJU-V\x1b[2J",
    "splits": [
        {"split": "test", "edition": 2, "n_ranked": 1207, "before": None, "moved": MOVED}
        | {"after": {"rank": 3, "method": "Foo++", "scores": SCORES | {"rte": None}}},
        {"split": "val", "edition": 1, "n_ranked": 6, "moved": []}
        | {"before": {"rank": 1, "method": "Anonymous 3f9c2a", "scores": SCORES}}
        | {"after": {"rank": 1, "method": "Foo++", "scores": SCORES}},
    ],
}


@pytest.mark.parametrize("name", ["Foo++", METHOD_ID])
def test_publish_shows_one_s_own_method_once_it_is_confirmed(
    tsttc: Tsttc, site: RecordedSite, name: str
) -> None:
    site.put("GET /api/v1/methods", Reply([MINE]))
    site.put(PREVIEW_ADDRESS, Reply(PREVIEW))
    site.put(SHOW, Reply(MINE | {"visibility": "PUBLIC", "url": "https://e.example/methods/x/"}))
    asked = tsttc("publish", name)
    assert (asked.exit_code, asked.stdout, site.posts) == (2, "", [])
    assert "Use --yes to confirm." in asked.stderr
    result = tsttc("publish", name, "--yes")
    assert (result.exit_code, result.stdout) == (0, "Foo++ is public now: https://e.example/methods/x/\n")
    assert json.loads(site.posts[0].body) == {"visibility": "PUBLIC", "confirm": True, "reveal_at": None}
    n_previews = sum(request.path.endswith("/visibility?as=PUBLIC") for request in site.requests)
    assert n_previews == 1, "what is confirmed is not shown first"


def test_publish_shows_what_everybody_will_see_before_it_asks(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put("GET /api/v1/methods", Reply([MINE]))
    site.put(PREVIEW_ADDRESS, Reply(PREVIEW))
    lines = tsttc("publish", "Foo++").stderr.splitlines()
    assert lines[0] == r"Everyone will see Foo++, team TJU-V\x1b[2J:"
    assert [line.split() for line in lines[1:4]] == [
        ["split", "rank", "of", "MiD", "RTE", "now"],
        ["test", "3", "1,207", "14.00", "–", "not", "visible"],
        ["val", "1", "6", "14.00", "14.00", "visible", "as", "Anonymous", "3f9c2a"],
    ]
    assert lines[4] == (
        "On test other ranks change: M3 3 to 4, M4 4 to 5, M5 5 to 6, M6 6 to 7, M7 7 to 8, and 2 more."
    )
    assert lines[6].startswith("Error: This publishes Foo++, with")
    assert site.requests[-1].path.endswith(f"/{METHOD_ID}/visibility?as=PUBLIC")
    refused = tsttc("publish", "Foo++", "--as", "anonymous", "--json")
    assert json.loads(refused.stdout)["preview"] == PREVIEW
    assert site.requests[-1].path.endswith("?as=ANONYMOUS")


def test_publish_under_a_pseudonym_until_a_day(tsttc: Tsttc, site: RecordedSite) -> None:
    day = "2027-03-01T00:00:00Z"
    site.put("GET /api/v1/methods", Reply([MINE]))
    shown = MINE | {"visibility": "ANONYMOUS", "pseudonym": "Anonymous 3f9c2a", "reveal_at": day}
    site.put(SHOW, Reply(shown))
    result = tsttc("publish", "Foo++", "--as", "anonymous", "--reveal-at", day, "--yes")
    assert result.stdout == f'Foo++ is anonymous now, and called "Anonymous 3f9c2a" until {day}\n'
    assert json.loads(site.posts[0].body)["reveal_at"] == day
    assert tsttc("publish", "Foo++", "--reveal-at", day, "--yes").exit_code == 2


def test_publish_knows_one_s_own_methods_alone_and_tells_the_server_s_words(
    tsttc: Tsttc, site: RecordedSite
) -> None:
    site.put("GET /api/v1/methods", Reply([MINE]))
    site.put(
        SHOW, Reply(problem("The method 'Foo++' is public; this is permanent.", where="visibility"), 422)
    )
    assert tsttc("publish", "Theirs", "--yes").exit_code == 2
    refused = tsttc("publish", "Foo++", "--as", "anonymous", "--yes")
    assert (refused.exit_code, refused.stderr) == (
        2,
        "Error: The method 'Foo++' is public; this is permanent.\n",
    )


# --- receipts ---------------------------------------------------------------------------------------------

KEYS = "GET /.well-known/tsttc-receipt-keys.json"


@pytest.fixture
def receipt(tmp_path: Path) -> Path:
    path = tmp_path / "receipt.jwt"
    path.write_text(RECEIPT)
    return path


def test_verify_asks_the_named_server_for_its_keys_and_no_other(
    tsttc: Tsttc, site: RecordedSite, receipt: Path
) -> None:
    site.put(KEYS, Reply(RECEIPT_KEYS))
    result = tsttc("verify", receipt)
    assert result.exit_code == 0
    assert result.stdout.startswith("The receipt is valid.\n")
    assert "13.9" in result.stdout
    # A name is a word of the team and can change; the id cannot.
    assert f"method       {METHOD_ID}, named Foo++ when signed\n" in result.stdout
    assert result.stderr == (
        f"Note: the receipt names https://leaderboard.example.org; the keys are those of {site.url}.\n"
    )
    assert site.requests[0].headers["Authorization"] is None


def test_verify_of_a_reviewer_without_a_login_names_the_site_of_the_receipt(
    tsttc: Tsttc, site: RecordedSite, receipt: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("TSTTC_URL")
    result = tsttc("verify", receipt)
    assert result.exit_code == 2
    assert "The receipt names https://leaderboard.example.org." in result.stderr
    command = f"tsttc verify {receipt} --server https://leaderboard.example.org"
    assert command in result.stderr
    site.put(KEYS, Reply(key_set([public_key(bytes(32))])))
    other = tsttc("verify", receipt, "--server", site.url)
    assert (other.exit_code, command in other.stderr) == (1, True), "the keys of another site"


@pytest.mark.parametrize("text", ["", "x", "{}", "a.b.c", "<html></html>", "\0" * 99])
def test_what_is_no_receipt_is_called_so_without_asking_a_site(
    tsttc: Tsttc, site: RecordedSite, receipt: Path, text: str
) -> None:
    receipt.write_text(text)
    for more in ((), ("--server", site.url)):
        result = tsttc("verify", receipt, *more)
        assert (result.exit_code, site.requests) == (1, [])
        assert "This is not a receipt" in result.stderr


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-be"])
def test_receipts_and_keys_of_any_editor_are_read(
    tsttc: Tsttc, receipt: Path, tmp_path: Path, encoding: str
) -> None:
    mark = "\ufeff" if encoding == "utf-16-be" else ""
    keys = tmp_path / "keys.json"
    keys.write_bytes((mark + json.dumps(RECEIPT_KEYS)).encode(encoding))
    receipt.write_bytes((mark + RECEIPT).encode(encoding))
    result = tsttc("verify", receipt, "--keys", keys)
    assert result.exit_code == 0, result.stderr


def test_verify_with_kept_keys_asks_nobody(
    tsttc: Tsttc, site: RecordedSite, receipt: Path, tmp_path: Path
) -> None:
    keys = tmp_path / "keys.json"
    keys.write_text(json.dumps(RECEIPT_KEYS))
    document = json.loads(tsttc("verify", receipt, "--keys", keys, "--json").stdout)
    assert (document["scores"]["mid"], document["edition"], document["split"]) == (13.9, 2, "test")
    receipt.write_text(RECEIPT[:300] + "A" + RECEIPT[301:])
    forged = tsttc("verify", receipt, "--keys", keys, "--json")
    assert (forged.exit_code, json.loads(forged.stdout)["code"]) == (1, "receipt-altered")
    assert tsttc("verify", "-", "--keys", keys, stdin=b"{}").exit_code == 1
    assert site.requests == []
