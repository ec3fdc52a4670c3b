"""What happens before a file is sent: the check with the split's manifest, and who will see the results."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from click.testing import Result

from evaluator.predictions import plausibility
from evaluator.tables.formats import parquet_of
from tests.evaluator.cli.recorded_site import CUT, RecordedSite, Reply, problem
from tests.evaluator.worlds import EXAMPLES, Tsttc

pytestmark = [pytest.mark.usefixtures("at_site")]

MANIFEST = EXAMPLES / "manifest.csv"
ID = "1f0c6a2e-6d0b-4f3e-9c55-0d4f2b8f3a11"
QUEUED: dict[str, Any] = {"id": ID, "state": "QUEUED", "split": "val", "method": "Foo++"}
POST = "POST /api/v1/submissions"
METHODS = "GET /api/v1/methods"
TABLE = "GET /api/v1/splits/val/manifest"


def submit(tsttc: Tsttc, name: str = "predictions.json", *more: object) -> Result:
    return tsttc("submit", EXAMPLES / name, "--split", "val", "--method", "Foo++", *more)


def put_manifest(site: RecordedSite) -> None:
    site.put(TABLE, Reply(MANIFEST.read_bytes(), headers={"Content-Type": "text/csv"}))
    site.put(POST, Reply(QUEUED, status=201))


def paths(site: RecordedSite) -> list[str]:
    return [f"{request.method} {request.path}" for request in site.requests]


def test_bad_file_gets_the_words_of_check_and_nothing_is_sent(tsttc: Tsttc, site: RecordedSite) -> None:
    put_manifest(site)
    checked = tsttc("check", EXAMPLES / "broken.json", "--manifest", MANIFEST)
    result = submit(tsttc, "broken.json")
    assert (result.exit_code, result.stdout) == (1, "")
    assert (
        result.stderr
        == checked.stderr + "This file was not submitted and did not count against your quota.\n"
    )
    assert paths(site) == [TABLE]
    assert site.requests[0].headers["Authorization"] is None, "a manifest is for everybody"
    document = json.loads(submit(tsttc, "broken.json", "--json").stdout)
    assert (document["code"], document["n_problems"]) == ("rejected", 7)
    assert submit(tsttc, "broken.json", "--no-check").exit_code == 0
    assert len(site.posts) == 1


def test_parquet_is_sent_as_json(tsttc: Tsttc, site: RecordedSite, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    put_manifest(site)
    path = tmp_path / "mine.parquet"
    rows = [{"anno_id": row, "ttc": 1.5 + row} for row in range(60)]
    path.write_bytes(parquet_of(rows, columns=["anno_id", "ttc"]))
    assert tsttc("submit", path, "--split", "val", "--method", "Foo++").exit_code == 0
    name, content = site.posts[0].parts()["file"]
    assert name == "mine.json"
    assert json.loads(content) == {str(row): 1.5 + row for row in range(60)}


@pytest.mark.slow
def test_a_warning_of_the_check_is_not_repeated_with_the_scores(
    tsttc: Tsttc, site: RecordedSite, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(plausibility, "MIN_VALUES", 10)
    put_manifest(site)
    path = tmp_path / "ratios.json"
    path.write_text(json.dumps({str(row): 0.9 for row in range(60)}))
    words = "Probably"
    warning = {"code": "looks-like-ratios", "message": f"{words} scale ratios."}
    site.put(POST, Reply(QUEUED | {"state": "SCORED", "scores": {"mid": 1.0}, "warnings": [warning]}))
    sent = ("submit", path, "--split", "val", "--method", "Foo++")
    assert tsttc(*sent, "--yes").stderr.count("Warning: ") == 1
    assert tsttc(*sent, "--no-check").stderr == f"Warning: {words} scale ratios.\n"


def test_split_without_a_manifest_is_left_to_the_server_s_words(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put(POST, Reply(problem("The split val takes no submissions yet.", where="split"), 409))
    result = submit(tsttc)
    assert (result.exit_code, result.stderr) == (8, "Error: The split val takes no submissions yet.\n")


@pytest.mark.slow
def test_answer_that_was_lost_is_no_file_sent_before(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put(POST, Reply(fault=CUT), Reply(QUEUED, status=200))
    assert "already submitted" not in submit(tsttc).stdout
    assert "already submitted" in submit(tsttc).stdout, "an answer to the first try of a call"


@pytest.mark.slow
def test_first_submission_of_a_private_method_says_how_to_show_it(tsttc: Tsttc, site: RecordedSite) -> None:
    private = QUEUED | {"method": "Foo\x1b[2J++", "visibility": "PRIVATE"}
    site.put(POST, Reply(private, status=201), Reply(private | {"visibility": "PUBLIC"}, status=201))
    assert submit(tsttc).stdout.endswith(
        "is private: only your team and the maintainers see its results. "
        'Publish it with: tsttc publish "Foo\\x1b[2J++"\n'
    )
    assert "private" not in submit(tsttc).output


NOTICE = "“Foo++” is public: everyone sees its results on every split."
PUBLIC = {"id": "m1", "name": "Foo++", "visibility": "PUBLIC", "notice": NOTICE}


def test_notice_of_a_public_method_is_shown_before_the_file_is_sent(tsttc: Tsttc, site: RecordedSite) -> None:
    put_manifest(site)
    site.put(METHODS, Reply([PUBLIC]))
    result = submit(tsttc)
    assert result.stdout.splitlines()[0] == NOTICE
    asked = paths(site)
    assert asked.index(METHODS) < asked.index(POST)


def test_a_person_is_asked_before_the_results_of_a_public_method_go_public(
    tsttc: Tsttc, site: RecordedSite, monkeypatch: pytest.MonkeyPatch
) -> None:
    put_manifest(site)
    site.put(METHODS, Reply([PUBLIC]))
    terminal = SimpleNamespace(stdin=SimpleNamespace(isatty=lambda: True))
    monkeypatch.setattr("evaluator.cli.consent.sys", terminal)
    words = ("submit", EXAMPLES / "predictions.json", "--split", "val", "--method", "Foo++")
    refused = tsttc(*words, stdin=b"n\n")
    assert (refused.exit_code, refused.stdout, site.posts) == (2, f"{NOTICE}\n", [])
    assert "Submit? [y/N]: " in refused.stderr
    assert tsttc(*words, "--yes").exit_code == 0
    assert len(site.posts) == 1


def test_notice_of_a_public_method_is_in_json_and_on_stderr(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put(POST, Reply(QUEUED | {"notice": NOTICE}, status=201))
    site.put(METHODS, Reply([PUBLIC]))
    result = submit(tsttc, "predictions.json", "--json")
    assert (json.loads(result.stdout)["notice"], result.stderr) == (NOTICE, f"{NOTICE}\n")


def test_token_that_may_only_submit_learns_from_the_answer_who_sees_the_results(
    tsttc: Tsttc, site: RecordedSite
) -> None:
    site.put(POST, Reply(QUEUED | {"notice": NOTICE}, status=201))
    site.put(METHODS, Reply(problem("Not for reading.", code="token-scope"), status=403))
    assert submit(tsttc).stdout.splitlines()[1] == NOTICE


# --- doubts: a slot is not used for a slip ------------------------------------------------------------------


def doubtful(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str) -> Path:
    """A well-formed file whose values are probably of another unit."""
    monkeypatch.setattr(plausibility, "MIN_VALUES", 10)
    value = {"milliseconds": 2500.0, "ratios": 0.9, "constant": 3.0}[kind]
    step = 0.0 if kind == "constant" else value / 1000
    path = tmp_path / f"{kind}.json"
    path.write_text(json.dumps({str(row): value + step * row for row in range(60)}))
    return path


def at_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = SimpleNamespace(stdin=SimpleNamespace(isatty=lambda: True))
    monkeypatch.setattr("evaluator.cli.consent.sys", terminal)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["milliseconds", "ratios", "constant"])
def test_a_job_sends_no_file_with_a_warning_unless_it_says_yes(
    tsttc: Tsttc, site: RecordedSite, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    put_manifest(site)
    path = doubtful(tmp_path, monkeypatch, kind)
    words = ("submit", path, "--split", "val", "--method", "Foo++")
    refused = tsttc(*words, "--json")
    assert (refused.exit_code, site.posts) == (10, [])
    assert "Warning: " in refused.stderr
    assert "Nothing was submitted: the file has a warning." in refused.stderr
    assert "add --yes" in refused.stderr
    document = json.loads(refused.stdout)
    assert (document["code"], len(document["warnings"])) == ("not-confirmed", 1)
    assert tsttc(*words, "--yes").exit_code == 0
    assert len(site.posts) == 1
    checked = [tsttc("check", path, "--manifest", MANIFEST, *more) for more in ((), ("--strict",))]
    assert [result.exit_code for result in checked] == [0, 1]
    strict = tsttc("check", path, "--manifest", MANIFEST, "--strict", "--json")
    assert (strict.exit_code, len(json.loads(strict.stdout)["warnings"])) == (1, 1)


@pytest.mark.parametrize(("answer", "exit_code", "n_sent"), [(b"\n", 10, 0), (b"n\n", 10, 0), (b"y\n", 0, 1)])
def test_a_person_is_asked_before_a_file_with_a_warning_is_sent(
    tsttc: Tsttc,
    site: RecordedSite,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    answer: bytes,
    exit_code: int,
    n_sent: int,
) -> None:
    put_manifest(site)
    path = doubtful(tmp_path, monkeypatch, "milliseconds")
    at_a_terminal(monkeypatch)
    result = tsttc("submit", path, "--split", "val", "--method", "Foo++", stdin=answer)
    assert (result.exit_code, len(site.posts)) == (exit_code, n_sent)
    assert "Submit anyway? [y/N]: " in result.stderr


OWN = [{"id": f"m{number}", "name": name} for number, name in enumerate(["Other", "TTC-Former", "Foo v1"])]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["TTC-Fromer", "ttc former", "TTCFormer", "TTC-Formr"])
def test_a_new_method_with_a_name_like_another_one_is_asked_about(
    tsttc: Tsttc, site: RecordedSite, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    put_manifest(site)
    site.put(METHODS, Reply(OWN))
    words = ("submit", EXAMPLES / "predictions.json", "--split", "val", "--method", name)
    refused = tsttc(*words)
    assert (refused.exit_code, site.posts) == (10, [])
    assert f'"{name}" would be a new method; your team has "TTC-Former".' in refused.stderr
    assert tsttc(*words, "--yes").exit_code == 0
    at_a_terminal(monkeypatch)
    assert tsttc(*words, stdin=b"n\n").exit_code == 10
    assert len(site.posts) == 1


@pytest.mark.parametrize("name", ["TTC-Former", "m1", "Foo v2", "Foo", "Another"])
def test_a_method_of_the_team_or_another_version_is_no_slip(
    tsttc: Tsttc, site: RecordedSite, name: str
) -> None:
    put_manifest(site)
    site.put(METHODS, Reply(OWN))
    result = tsttc("submit", EXAMPLES / "predictions.json", "--split", "val", "--method", name)
    assert (result.exit_code, len(site.posts)) == (0, 1)
