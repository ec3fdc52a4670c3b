"""whoami, methods, submissions, withdraw, download, manifest --split and truth, as a person calls them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from evaluator import read_manifest, read_truth
from tests.evaluator.cli.console import ID, METHOD_ID, REJECTED_ID
from tests.evaluator.cli.recorded_site import RecordedSite, Reply, problem
from tests.evaluator.toolkit_folders import camera, write_folder
from tests.evaluator.worlds import EXAMPLES, Tsttc

pytestmark = pytest.mark.usefixtures("at_site")

SUBMISSIONS = [
    {"id": ID, "state": "SCORED", "split": "val", "method": "Foo++", "scores": {"mid": 13.921}},
    {
        "id": REJECTED_ID,
        "state": "REJECTED",
        "split": "test",
        "method": "Bar",
        "submitted_at": "2026-11-20T12:00:00Z",
    },
]
MANIFEST = EXAMPLES / "manifest.csv"


def test_whoami_names_team_token_and_limits(tsttc: Tsttc, site: RecordedSite) -> None:
    account = {"team": "TJU-V", "token": "ci", "scopes": ["read"], "split": "val", "expires_at": "2027-01-01"}
    site.put("GET /api/v1/account", Reply(account))
    result = tsttc("whoami")
    expected = f'team TJU-V at {site.url}\ntoken "ci": read, for val only, until 2027-01-01 UTC\n'
    assert result.stdout == expected
    assert json.loads(tsttc("whoami", "--json").stdout) == account


def test_methods_are_listed_with_who_sees_them(tsttc: Tsttc, site: RecordedSite) -> None:
    rows = [
        {"id": METHOD_ID, "name": "Foo++", "visibility": "PRIVATE"},
        {"id": ID, "name": "Bar", "visibility": "ANONYMOUS", "pseudonym": "Anonymous 1a2b3c"},
    ]
    site.put("GET /api/v1/methods", Reply(rows))
    lines = tsttc("methods").stdout.splitlines()
    assert lines[1].split() == [METHOD_ID, "Foo++", "private"]
    assert lines[2].endswith("anonymous as Anonymous 1a2b3c")
    assert [row["name"] for row in json.loads(tsttc("methods", "--json").stdout)] == ["Foo++", "Bar"]


def test_submissions_are_listed_page_after_page_and_filtered(tsttc: Tsttc, site: RecordedSite) -> None:
    link = {"Link": f'<{site.url}/api/v1/submissions?after={ID}>; rel="next"'}
    site.put("GET /api/v1/submissions", *[Reply(SUBMISSIONS[:1], headers=link), Reply(SUBMISSIONS[1:])] * 2)
    lines = tsttc("submissions").stdout.splitlines()
    assert lines[1].split() == [ID, "val", "Foo++", "SCORED", "13.92"]
    assert lines[2].split() == [REJECTED_ID, "2026-11-20", "12:00", "test", "Bar", "REJECTED", "–"]
    rows = json.loads(tsttc("submissions", "--method", "Bar", "--json").stdout)
    assert [row["id"] for row in rows] == [REJECTED_ID]


def test_status_without_an_id_is_that_of_the_latest_submission(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put("GET /api/v1/submissions", Reply(SUBMISSIONS), Reply([]))
    site.put(f"GET /api/v1/submissions/{ID}", Reply(SUBMISSIONS[0]))
    assert "Foo++ on val" in tsttc("status").stdout
    assert "Your team has no submission yet" in tsttc("status").stderr


def test_quota_says_of_a_split_without_a_next_slot_that_it_is_closed(
    tsttc: Tsttc, site: RecordedSite
) -> None:
    row = {"split": "val", "limit": None, "used": 0, "left": None, "next_slot_at": None, "is_open": False}
    site.put("GET /api/v1/quota", Reply([row]))
    assert tsttc("quota").stdout.splitlines()[1].split() == ["val", "–", "any", "number", "closed"]


def test_withdraw_asks_first_and_says_what_became_of_it(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put(f"GET /api/v1/submissions/{ID}", Reply(SUBMISSIONS[0]))
    site.put(f"POST /api/v1/submissions/{ID}/withdraw", Reply(SUBMISSIONS[0] | {"state": "CANCELLED"}))
    result = tsttc("withdraw", ID)
    assert (result.exit_code, site.posts) == (2, [])
    assert "This withdraws Foo++ on val, state SCORED; it cannot be undone." in result.stderr
    done = tsttc("withdraw", ID, "--yes")
    assert (done.exit_code, done.stdout) == (0, "Foo++ on val is cancelled.\n")


def test_move_sends_the_method_and_says_where_the_submission_is_now(tsttc: Tsttc, site: RecordedSite) -> None:
    moved = SUBMISSIONS[0] | {"method": "Right net"}
    site.put(f"POST /api/v1/submissions/{ID}/move", Reply(moved))
    result = tsttc("move", ID, "--method", "Right net")
    assert (result.exit_code, result.stdout) == (0, "The submission to val is now one of Right net.\n")
    assert json.loads(tsttc("move", ID, "--method", METHOD_ID, "--json").stdout) == moved
    assert [json.loads(post.body) for post in site.posts] == [{"method": "Right net"}, {"method": METHOD_ID}]


@pytest.mark.parametrize(
    ("code", "status", "detail", "exit_code"),
    [
        ("not-movable", 409, "The method 'Foo++' is public; expected a private one.", 8),
        ("not-yours", 403, "Only the team that sent a submission can move it.", 4),
        ("same-file", 409, "The method 'Bar' has the same file already; expected a method without it.", 8),
        ("unknown-method", 422, "Your team has no method 'Bar'; expected the name or id of one.", 2),
        ("not-found", 404, "No such submission.", 8),
    ],
)
def test_move_that_is_refused_prints_the_server_s_sentence(
    tsttc: Tsttc, site: RecordedSite, code: str, status: int, detail: str, exit_code: int
) -> None:
    site.put(f"POST /api/v1/submissions/{ID}/move", Reply(problem(detail, code=code, where="method"), status))
    result = tsttc("move", ID, "--method", "Bar")
    assert (result.exit_code, result.stdout) == (exit_code, "")
    assert detail in result.stderr
    assert tsttc("move", ID).exit_code == 2, "without a method"


def test_download_gives_the_bytes_as_they_were_sent(tsttc: Tsttc, site: RecordedSite, tmp_path: Path) -> None:
    data = b'{"0": 1.0}\r\n'
    site.put(f"GET /api/v1/submissions/{ID}/file", Reply(data))
    assert tsttc("download", ID).stdout_bytes == data
    assert tsttc("download", ID, "-o", tmp_path / "mine.json").exit_code == 0
    assert (tmp_path / "mine.json").read_bytes() == data
    site.put(f"GET /api/v1/submissions/{REJECTED_ID}/file", Reply(problem("No such submission."), 404))
    assert tsttc("download", REJECTED_ID).exit_code == 8


def test_manifest_of_a_split_comes_from_the_leaderboard_without_a_token(
    tsttc: Tsttc, site: RecordedSite, tmp_path: Path
) -> None:
    site.put(
        "GET /api/v1/splits/val/manifest", Reply(MANIFEST.read_bytes(), headers={"Content-Type": "text/csv"})
    )
    path = tmp_path / "manifest.csv"
    result = tsttc("manifest", "--split", "val", "-o", path)
    assert result.stdout == f"{path}: 60 sequences of 6 recordings.\n"
    assert read_manifest(path).digest == read_manifest(MANIFEST).digest
    assert site.requests[0].headers["Authorization"] is None
    for arguments in ((), (MANIFEST, "--split", "val")):
        assert "Give either TRUTH_OR_FOLDER or --split." in tsttc("manifest", *arguments).stderr


@pytest.mark.slow
def test_truth_of_a_folder_becomes_a_table_with_its_objects(tsttc: Tsttc, tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "folder", {"a.pkl": [camera({7: list(range(6))}, occ_ratio=0.25)]})
    path = tmp_path / "val.csv"
    assert tsttc("truth", folder, "-o", path).stdout == f"{path}: 1 sequence of 1 recording.\n"
    truth = read_truth(path)
    assert truth.digest == json.loads(tsttc("truth", folder, "--json").stdout)["truth_digest"]
    assert truth.objects.occ_ratio.tolist() == [0.25]
    assert tsttc("truth", path, "-o", path).exit_code == 2


def test_a_split_that_is_not_there_is_answered_with_those_that_are(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put("GET /api/v1/splits/trial/board", Reply(problem("Nothing here."), status=404))
    refused = tsttc("board", "trial")
    assert (refused.exit_code, refused.stderr) == (
        2,
        "Error: There is no split 'trial'; expected one of val.\n",
    )


def test_a_withdrawn_submission_says_so(tsttc: Tsttc, site: RecordedSite) -> None:
    gone = SUBMISSIONS[0] | {"withdrawn_at": "2026-11-21T12:00:00Z"}
    site.put("GET /api/v1/submissions", Reply([gone]))
    site.put(f"GET /api/v1/submissions/{ID}", Reply(gone))
    assert "SCORED, withdrawn" in tsttc("submissions").stdout
    assert tsttc("status", ID).stdout.startswith("SCORED, withdrawn: Foo++ on val\n")


def test_next_slot_is_written_as_in_the_sentence_below_the_table(tsttc: Tsttc, site: RecordedSite) -> None:
    moments = ("2026-11-29T08:23:22.277839Z", "2026-11-29T08:24:00Z", "2026-11-29T09:23:22+01:00")
    rows = [{"split": "val", "limit": 3, "left": 0, "next_slot_at": at, "is_open": False} for at in moments]
    site.put("GET /api/v1/quota", Reply(rows))
    lines = tsttc("quota").stdout.splitlines()[1:4]
    assert [line.split(maxsplit=3)[3] for line in lines] == ["2026-11-29 08:24 UTC"] * 3
