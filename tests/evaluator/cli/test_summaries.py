"""`submit --summary`: what a job's page shows of a result, and of a failure."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.evaluator.cli.recorded_site import RecordedSite, Reply, problem
from tests.evaluator.cli.test_gates import BOARD, OTHER, POST, SCORED, SCORES, board, entry
from tests.evaluator.worlds import EXAMPLES, Tsttc

pytestmark = pytest.mark.usefixtures("at_site")

RESULT = SCORED | {
    "visibility": "PRIVATE",
    "url": "/submissions/1/",
    "scores": SCORES | {"mid": 13.92},
    "intervals": {"mid": {"low": 13.21, "high": 14.6, "rank_low": 1, "rank_high": 3}},
    "rank": 2,
    "counts": {"overall": 60},
    "warnings": [{"code": "shuffled-values", "message": "The values look shuffled."}],
}


def submit(tsttc: Tsttc, path: Path, *more: str, file: str = "predictions.json") -> int:
    words = ("submit", EXAMPLES / file, "--split", "val", "--method", "New", "--summary", path, *more)
    return tsttc(*words).exit_code


def test_result_and_gates_are_appended(tsttc: Tsttc, site: RecordedSite, tmp_path: Path) -> None:
    path = tmp_path / "summary.md"
    path.write_text("# Before\n")
    site.put(BOARD, board(entry("Old", 13.0, method_id=OTHER)))
    site.put(POST, Reply(RESULT, status=201))
    gates = ("--fail-if", "rte > 99", "--fail-if-worse-than", "Old")
    assert submit(tsttc, path, *gates, "--json") == 6
    lines = path.read_text().splitlines()
    assert lines[:4] == [
        "# Before",
        "### New on val: SCORED",
        "",
        "**The gate fails: MiD is 13.92, and Old has 13.00.**",
    ]
    assert "If published: rank 2 (1–3)" in lines
    assert [line for line in lines if line.startswith("| 95% | 13.21–14.60 | – |")]
    assert "- `--fail-if rte > 99` passes: rte is 14.00" in lines
    assert "- `--fail-if-worse-than Old` **fails**: MiD is 13.92, and Old has 13.00" in lines
    assert "Warning: The values look shuffled." in lines
    assert lines[-2].startswith(f"Submission: <{site.url}/submissions/1/>")


def test_failure_lists_its_problems(tsttc: Tsttc, site: RecordedSite, tmp_path: Path) -> None:
    bad, late = tmp_path / "bad.md", tmp_path / "late.md"
    manifest = (EXAMPLES / "manifest.csv").read_bytes()
    site.put("GET /api/v1/splits/val/manifest", Reply(manifest, headers={"Content-Type": "text/csv"}))
    assert submit(tsttc, bad, file="broken.json") == 1
    text = bad.read_text()
    assert text.startswith("### New on val: not submitted\n\n**")
    assert '\n5. "23": The value is the string' in text
    site.put(POST, Reply(problem("No slot is left.", code="quota-exceeded"), status=429))
    assert submit(tsttc, late) == 5
    assert "**No slot is left.**" in late.read_text()


def test_summary_that_cannot_be_written_does_not_hide_the_result(
    tsttc: Tsttc, site: RecordedSite, tmp_path: Path
) -> None:
    site.put(POST, Reply(RESULT, status=201))
    assert submit(tsttc, tmp_path / "nowhere" / "summary.md") == 0
