"""Gates: what they are written in, what they compare, and that a value that is missing is no pass."""

from __future__ import annotations

import json
from typing import Any

import pytest
from click.testing import Result

from evaluator.cli import gates
from evaluator.metrics.protocol import SCORE_NAMES
from tests.evaluator.cli.recorded_site import RecordedSite, Reply
from tests.evaluator.worlds import EXAMPLES, Tsttc

pytestmark = [pytest.mark.usefixtures("at_site")]

ID = "1f0c6a2e-6d0b-4f3e-9c55-0d4f2b8f3a11"
METHOD, OTHER = "5d2c1f8e-0b7a-4c36-9f41-7a3e6b9d2c10", "8c1e2b9a-3f47-4d0c-a6e1-5b7d90c2e4f6"
SCORES: dict[str, float | None] = dict.fromkeys(SCORE_NAMES, 14.0)
SCORED: dict[str, Any] = {"id": ID, "state": "SCORED", "split": "val", "method": "New", "method_id": METHOD}
POST = "POST /api/v1/submissions"
BOARD = "GET /api/v1/splits/val/board"


def entry(name: str, mid: float | None, *, method_id: str | None, kind: str = "submission") -> dict[str, Any]:
    return {
        "method": name,
        "method_id": method_id,
        "team": "T",
        "kind": kind,
        "decimals": 1 if kind == "published" else 2,
        "scores": SCORES | {"mid": mid},
    }


def board(*entries: dict[str, Any]) -> Reply:
    return Reply({"split": "val", "edition": 1, "entries": list(entries)})


def submit(tsttc: Tsttc, *more: str) -> Result:
    return tsttc("submit", EXAMPLES / "predictions.json", "--split", "val", "--method", "New", *more)


@pytest.mark.parametrize(
    ("text", "is_true"),
    [
        ("mid > 15.0", False),
        ("mid>13.99", True),
        ("  mid  >=  14  ", True),
        ("mid < 14 or rte_negative == 14", True),
        ("mid <= 13.9 or mid != 14.00", False),
        ("mid > .5e1", True),
        ("mid > -1", True),
        ("MiD > 13.99", True),
        ("RTE_n == 14 or MID_C > 20", True),
    ],
)
def test_condition_is_compared_with_the_published_value(text: str, is_true: bool) -> None:
    scores = SCORES | {"mid": 13.999}
    assert any(condition.holds(scores) for condition in gates.parse(text)) is is_true


@pytest.mark.parametrize(
    "text",
    [
        *("", "mid", "mid >", "> 3", "mid > x", "mid => 3", "mid > 3 and rte > 2", "mid > 3 or", "or"),
        *("mid_e > 3", "mid > 1e", "mid > 0x10", "mid > nan", "mid > inf", "mid > 1_000", "mid > ١"),
        *("mid > 3; import os", "mid > (3)", "__import__('os') > 3", "mid_overall > 3", "mid > 3 or rte"),
    ],
)
def test_anything_else_is_wrong_usage_before_anything_is_sent(
    tsttc: Tsttc, site: RecordedSite, text: str
) -> None:
    result = submit(tsttc, "--fail-if", text)
    assert result.exit_code == 2
    assert "--fail-if" in result.stderr
    assert ("several are joined by or" in result.stderr) is (" and " in text)
    assert site.requests == []


@pytest.mark.slow
def test_gate_waits_shows_the_scores_and_then_sets_the_exit_code(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put(POST, Reply(SCORED | {"state": "QUEUED"}, status=201))
    site.put(f"GET /api/v1/submissions/{ID}", Reply(SCORED | {"scores": SCORES}))
    good = submit(tsttc, "--fail-if", "mid > 15.0")
    assert good.exit_code == 0
    bad = submit(tsttc, "--fail-if", "mid > 15.0", "--fail-if", "rte >= 14 or rte_small > 99")
    assert bad.exit_code == 6
    assert "SCORED: New on val" in bad.stdout
    assert bad.stderr.endswith("Error: The gate fails: rte is 14.00, which matches rte >= 14.\n")
    assert tsttc("status", ID, "--fail-if", "mid > 1").exit_code == 6


def test_gate_as_json_is_one_document_with_the_submission(tsttc: Tsttc, site: RecordedSite) -> None:
    scored = SCORED | {"scores": SCORES}
    site.put(f"GET /api/v1/submissions/{ID}", Reply(scored))
    assert json.loads(tsttc("status", ID, "--json", "--fail-if", "mid > 99").stdout) == scored
    result = tsttc("status", ID, "--json", "--fail-if", "mid > 1")
    document = json.loads(result.stdout)
    assert (result.exit_code, document["gate"]["code"]) == (6, "gate-failed")
    assert {name: document[name] for name in scored} == scored


@pytest.mark.parametrize("scores", [None, SCORES | {"mid": None}, {}])
def test_missing_value_is_an_error_and_not_a_pass(
    tsttc: Tsttc, site: RecordedSite, scores: dict[str, Any] | None
) -> None:
    site.put(f"GET /api/v1/submissions/{ID}", Reply(SCORED | {"scores": scores}))
    result = tsttc("status", ID, "--fail-if", "mid > 99")
    assert result.exit_code == 6
    assert "The gate cannot be evaluated: there is no value for mid." in result.stderr


def test_score_gates_offline_with_the_numbers_of_the_board(tsttc: Tsttc) -> None:
    arguments = ["score", EXAMPLES / "predictions.json", "--truth", EXAMPLES / "truth.csv"]
    # 11.988172… is published as 11.99.
    assert tsttc(*arguments, "--fail-if", "mid < 11.99").exit_code == 0
    assert tsttc(*arguments, "--fail-if", "mid == 11.99").exit_code == 6
    document = json.loads(tsttc(*arguments, "--json", "--fail-if", "mid > 1").stdout)
    assert (document["n_sequences"], document["gate"]["code"]) == (60, "gate-failed")


# --- worse than another ----------------------------------------------------------------------------------


def scored(site: RecordedSite, *, mid: float | None) -> None:
    site.put(POST, Reply(SCORED | {"scores": SCORES | {"mid": mid}}))


@pytest.mark.parametrize(("mid", "exit_code"), [(13.9, 0), (14.0, 0), (14.01, 6), (None, 6)])
@pytest.mark.parametrize("name", ["Old", OTHER])
def test_file_is_compared_with_a_method_of_the_board(
    tsttc: Tsttc, site: RecordedSite, mid: float | None, exit_code: int, name: str
) -> None:
    site.put(BOARD, board(entry("Old", 14.0, method_id=OTHER), entry("Else", 1.0, method_id=None)))
    scored(site, mid=mid)
    result = submit(tsttc, "--fail-if-worse-than", name)
    assert result.exit_code == exit_code, result.stderr
    if mid == 14.01:
        assert "The gate fails: MiD is 14.01, and Old has 14.00." in result.stderr


def test_every_gate_that_fails_is_named(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put(BOARD, board(entry("Old", 13.0, method_id=OTHER)))
    scored(site, mid=14.0)
    result = submit(tsttc, "--fail-if", "mid > 5", "--fail-if-worse-than", "Old")
    words = "The gate fails: mid is 14.00, which matches mid > 5; MiD is 14.00, and Old has 13.00."
    assert (result.exit_code, words in result.stderr) == (6, True)


def test_file_may_be_compared_with_a_row_of_a_paper(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put(BOARD, board(entry("Deep Scale", 14.4, method_id=None, kind="published")))
    scored(site, mid=15.0)
    assert submit(tsttc, "--fail-if-worse-than", "Deep Scale").exit_code == 6


@pytest.mark.slow
def test_row_of_a_paper_comes_before_methods_that_took_its_name(tsttc: Tsttc, site: RecordedSite) -> None:
    quoted = entry("Deep Scale", 14.4, method_id=None, kind="published") | {"id": "published:deep-scale"}
    taken = entry("Deep Scale", 99.0, method_id=OTHER) | {"id": OTHER}
    site.put(BOARD, board(taken, quoted, taken | {"method_id": METHOD, "id": METHOD}))
    scored(site, mid=15.0)
    for name in ("Deep Scale", "published:deep-scale"):
        result = submit(tsttc, "--fail-if-worse-than", name)
        assert result.exit_code == 6, result.stderr
        assert "MiD is 15.00, and Deep Scale has 14.4" in result.stderr
    assert submit(tsttc, "--fail-if-worse-than", OTHER).exit_code == 0


@pytest.mark.slow
def test_first_file_of_a_method_has_nothing_of_its_own_to_be_worse_than(
    tsttc: Tsttc, site: RecordedSite
) -> None:
    site.put(BOARD, board(entry("Old", 1.0, method_id=OTHER)), board(entry("New", 13.0, method_id=METHOD)))
    scored(site, mid=14.0)
    first = submit(tsttc, "--fail-if-worse-than", "New")
    assert first.exit_code == 0
    assert "New is not on the board of val yet; nothing to compare with." in first.stderr
    assert submit(tsttc, "--fail-if-worse-than", "New").exit_code == 6


@pytest.mark.parametrize(
    ("entries", "words"),
    [
        ([], "has no method 'Old'"),
        (
            [entry("Old", 14.0, method_id=METHOD), entry("Old", 15.0, method_id=OTHER)],
            "has 2 methods called 'Old'",
        ),
    ],
)
def test_method_that_is_not_clear_is_wrong_usage_before_the_file_is_sent(
    tsttc: Tsttc, site: RecordedSite, entries: list[dict[str, Any]], words: str
) -> None:
    site.put(BOARD, board(*entries))
    result = submit(tsttc, "--fail-if-worse-than", "Old")
    assert result.exit_code == 2
    assert words in result.stderr
    assert site.posts == []
