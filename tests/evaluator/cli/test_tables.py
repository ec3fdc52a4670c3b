"""board in the forms that papers, notes and spreadsheets take, convert, and completion."""

from __future__ import annotations

import csv
import io
import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evaluator import Rejected, read_manifest, read_predictions, write_predictions
from evaluator.metrics.protocol import SCORE_NAMES
from evaluator.metrics.scale import ttc_to_scale_ratio
from evaluator.predictions.conversion import convert
from tests.evaluator.cli.recorded_site import RecordedSite, Reply
from tests.evaluator.worlds import EXAMPLES, REPOSITORY, Tsttc

MANIFEST = read_manifest(EXAMPLES / "manifest.csv")
PREDICTIONS = (EXAMPLES / "predictions.json").read_bytes()
TTC_S = read_predictions(PREDICTIONS, manifest=MANIFEST).ttc_s

HOSTILE = r"\input{x} $a_b$ | *c* <i> =1+1" + "\x1b[31m\n"
VALUES: dict[str, Any] = dict.fromkeys(SCORE_NAMES, 20.0)
BOARD: dict[str, Any] = {
    "split": "test",
    "edition": 2,
    "entries": [
        {"rank": 1, "method": "=cmd", "team": "T", "date": "2026-11-20", "scores": VALUES | {"mid": 14.5}},
        {"rank": 2, "method": HOSTILE, "team": "A, B", "kind": "published", "scores": VALUES},
        {"rank": None, "method": "Late", "team": "T", "scores": dict.fromkeys(SCORE_NAMES)}
        | {"withdrawn_at": "2026-11-20T12:00:00Z"},
    ],
}


OWN = [
    {"rank": 1, "method": "Owl", "team": "T", "visibility": "PRIVATE", "scores": VALUES | {"mid": 1.0}},
    {"rank": 2, "method": "Bat", "team": "T", "visibility": "ANONYMOUS", "pseudonym": "Anonymous 3f9c2a"}
    | {"scores": VALUES},
    {"rank": 2, "method": "Anonymous 77aa00", "team": "Anonymous", "visibility": "ANONYMOUS"}
    | {"scores": VALUES},
]


@pytest.fixture
def board(tsttc: Tsttc, site: RecordedSite, at_site: None) -> Callable[[str], str]:
    site.put("GET /api/v1/splits/test/board", Reply(BOARD))

    def shown(form: str) -> str:
        result = tsttc("board", "--format", form)
        assert (result.exit_code, result.stderr) == (0, "")
        return result.stdout

    return shown


def test_board_as_csv_is_read_back_and_runs_in_no_spreadsheet(board: Callable[[str], str]) -> None:
    rows = list(csv.DictReader(io.StringIO(board("csv"))))
    assert [row["method"] for row in rows] == [
        "'=cmd",
        HOSTILE.replace("\x1b", " ").rstrip(),
        "Late",
    ]
    assert (rows[0]["mid"], rows[0]["rte"], rows[2]["mid"], rows[2]["rank"]) == ("14.50", "20.00", "", "")


def test_board_as_bibtex_is_the_text_of_the_site(
    board: Callable[[str], str], tsttc: Tsttc, site: RecordedSite
) -> None:
    found = Reply("@misc{é,\n}\n".encode(), headers={"Content-Type": "text/x-bibtex; charset=utf-8"})
    site.put("GET /board/test/editions/2.bib", found)
    assert board("bibtex") == "@misc{é,\n}\n"
    assert "--mine does not go with --format bibtex" in tsttc("board", "--mine", "--format", "bibtex").stderr


def test_board_as_latex_marks_the_best_and_takes_the_power_from_names(board: Callable[[str], str]) -> None:
    text = board("latex")
    assert r"\textbf{14.50}" in text
    assert r"\begin{tabular}" in text
    assert r"\input" not in text
    assert "\x1b" not in text


def test_board_as_markdown_is_one_line_for_each_entry(board: Callable[[str], str]) -> None:
    text = board("markdown")
    rows = [line for line in text.splitlines() if line.startswith("|")]
    assert len(rows) == 2 + 2, "what was withdrawn is on the board, not in a table to take along"
    assert "**14.50**" in rows[2]
    assert "<i>" not in text
    assert "\x1b" not in text


@pytest.mark.parametrize("form", ["latex", "markdown"])
def test_rows_that_others_do_not_see_are_marked_and_take_no_mark_of_a_column(
    tsttc: Tsttc, site: RecordedSite, at_site: None, form: str
) -> None:
    site.put("GET /api/v1/splits/test/board", Reply(BOARD | {"entries": [*OWN, *BOARD["entries"]]}))
    text = tsttc("board", "--mine", "--format", form).stdout.replace("\\", "")
    assert "Owl (private) " in text
    assert "Bat (anonymous) " in text
    assert "Anonymous 77aa00 " in text
    assert "Not public: only one team sees rows marked (private)" in text
    best = {"latex": "textbf{{{}}}", "markdown": "**{}**"}[form]
    assert best.format("14.50") in text
    assert best.format("1.00") not in text


def test_spreadsheet_says_who_sees_each_row(tsttc: Tsttc, site: RecordedSite, at_site: None) -> None:
    site.put("GET /api/v1/splits/test/board", Reply(BOARD | {"entries": [*OWN, *BOARD["entries"]]}))
    rows = list(csv.DictReader(io.StringIO(tsttc("board", "--mine", "--format", "csv").stdout)))
    assert [row["visibility"] for row in rows] == ["PRIVATE", "ANONYMOUS", "ANONYMOUS", *["PUBLIC"] * 3]
    assert rows[0]["method"] == "Owl", "a program finds the name as it is"


def test_tables_say_where_they_were_taken_from(tsttc: Tsttc, site: RecordedSite, at_site: None) -> None:
    told = {"protocol": "tsttc-1", "ground_truth": "sha256:" + "9f" * 32, "n_sequences": 28600}
    told |= {"n_recordings": 120, "updated_at": "2026-11-20T12:34:56.789Z"}
    site.put("GET /api/v1/splits/test/board", Reply(BOARD | told))
    assert tsttc("board", "--format", "latex").stdout.splitlines()[:5] == [
        f"% TSTTC leaderboard, test: {site.url}/board/test/editions/2/",
        "% Edition 2, protocol tsttc-1, 28,600 sequences of 120 recordings",
        "% Ground truth sha256:" + "9f" * 32,
        "% As of 2026-11-20 12:34 UTC",
        r"% It needs \usepackage{booktabs}.",
    ]
    asked = ["--at", "2026-11-20", "--sort", "-mid", "--format", "latex"]
    first = tsttc("board", *asked).stdout.splitlines()[0]
    assert first == f"% TSTTC leaderboard, test: {site.url}/board/test/?at=2026-11-20&sort=-mid"


def test_intervals_stand_in_every_form(tsttc: Tsttc, site: RecordedSite, at_site: None) -> None:
    known = {"low": 14.1, "high": 15.0, "rank_low": 1, "rank_high": 1}
    rows = [BOARD["entries"][0] | {"intervals": {"mid": known}}, *BOARD["entries"][1:]]
    site.put("GET /api/v1/splits/test/board", Reply(BOARD | {"entries": rows}))
    latex, markdown, text = (
        tsttc("board", "--intervals", "--format", form).stdout for form in ("latex", "markdown", "csv")
    )
    assert r"1 (1) & =cmd & T & \textbf{14.50} {\scriptsize [14.10, 15.00]} & " in latex
    assert r"| 1 (1) | \=cmd | T | **14.50** [14.10, 15.00] | " in markdown
    first, second, _ = csv.DictReader(io.StringIO(text))
    ends = ("rank_low", "rank_high", "mid_low", "mid_high", "rte_negative_high")
    assert [first[name] for name in ends] == ["1", "1", "14.10", "15.00", ""]
    assert {second[name] for name in ends} == {""}
    assert all(request.path.endswith("&intervals=1") for request in site.requests)


def test_board_as_json_is_the_same_by_both_names(tsttc: Tsttc, board: Callable[[str], str]) -> None:
    assert json.loads(board("json")) == json.loads(tsttc("board", "--json").stdout) == BOARD


# --- convert ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("frame_gap", [1, 2, 3, 4, 5])
def test_ratios_at_any_gap_are_the_seconds_that_they_were_made_of(frame_gap: int) -> None:
    ratios = ttc_to_scale_ratio(TTC_S, fps_hz=10 / frame_gap)
    flat = write_predictions(manifest=MANIFEST, ttc_s=ratios)  # ratios as a flat file has them
    enveloped = write_predictions(manifest=MANIFEST, scale_ratio=ratios, frame_gap=frame_gap)
    for found in (
        convert(flat, frame_gap=frame_gap),
        convert(flat, fps_hz=10 / frame_gap),
        convert(enveloped),
        convert(convert(enveloped, to="scale_ratio", to_frame_gap=6 - frame_gap)),
        convert(convert(PREDICTIONS, to="scale_ratio", to_fps_hz=7.5)),
    ):
        back = read_predictions(found, manifest=MANIFEST)
        np.testing.assert_allclose(back.ttc_s, TTC_S, rtol=1e-9)
        assert back.unit == "ttc"


def test_rate_of_each_key_is_its_own() -> None:
    document = {"unit": "scale_ratio", "frame_gap": {"a": 1, "b": 5}, "predictions": {"a": 0.9, "b": 0.9}}
    found = json.loads(convert(json.dumps(document).encode()))
    assert found["b"] == pytest.approx(5 * found["a"])


@pytest.mark.parametrize(
    ("text", "codes"),
    [
        ('{"a": "x", "b": null}', {"not-a-number"}),
        ('{"a": NaN}', {"nan"}),
        ('{"a": 0.9, "a": 0.8}', {"duplicate-keys"}),
        ('{"unit": "scale_ratio", "fps": 2, "predictions": {"a": -1}}', {"not-positive"}),
        ('{"unit": "scale_ratio", "frame_gap": {"a": 6}, "predictions": {"a": 1}}', {"bad-rate"}),
        ('{"unit": "scale_ratio", "frame_gap": {"b": 1}, "predictions": {"a": 1}}', {"missing-keys"}),
        ('{"unit": "scale_ratio", "fps": "2", "predictions": {"a": 1}}', {"bad-rate"}),
        ('{"a": 0}', {"zero"}),
        ("[]", {"wrong-top-level"}),
    ],
)
def test_what_no_prediction_file_may_hold_is_not_converted(text: str, codes: set[str]) -> None:
    with pytest.raises(Rejected) as caught:
        convert(text.encode())
    assert {found.code for found in caught.value.problems} == codes


def test_convert_writes_a_file_that_scores_the_same(tsttc: Tsttc, tmp_path: Path) -> None:
    ratios, seconds = tmp_path / "ratios.json", tmp_path / "seconds.json"
    original = EXAMPLES / "predictions.json"
    to_ratios = tsttc("convert", original, "--to", "scale_ratio", "--to-frame-gap", 3, "-o", ratios)
    assert to_ratios.stdout == f"{ratios}: scale ratios.\n"
    assert tsttc("convert", ratios, "-o", seconds).exit_code == 0
    truth = EXAMPLES / "truth.csv"
    shown = [
        tsttc("score", path, "--truth", truth).stdout.splitlines()[1] for path in (original, ratios, seconds)
    ]
    assert len(set(shown)) == 1
    piped = tsttc("convert", "-", stdin=original.read_bytes()).stdout_bytes
    assert piped.rstrip() == convert(original.read_bytes())


def test_times_without_a_scale_ratio_are_named_with_a_gap_that_has_one(tsttc: Tsttc, tmp_path: Path) -> None:
    path = tmp_path / "times.json"
    path.write_text(json.dumps({"0": -0.3, "1": 2.0, "2": -0.07}))
    refused = tsttc("convert", path, "--to", "scale_ratio")
    assert refused.exit_code == 1
    assert (
        "The time to contact is -0.3 s, which has no scale ratio at 2 Hz: an object that moves away needs "
        "more than 0.5 s, the time between both frames; --to-frame-gap 2 (or less) has one."
    ) in refused.stderr
    assert "is -0.07 s, which has no scale ratio at 2 Hz" in refused.stderr
    assert "no frame gap has one." in refused.stderr
    path.write_text(json.dumps({"0": -0.3, "1": 2.0}))
    ratios = tsttc("convert", path, "--to", "scale_ratio", "--to-frame-gap", 2)
    assert ratios.exit_code == 0
    back = json.loads(convert(ratios.stdout.encode()))
    assert back == pytest.approx({"0": -0.3, "1": 2.0})


@pytest.mark.parametrize(
    "options",
    [
        ["--frame-gap", "1", "--fps", "2"],
        ["--to-frame-gap", "1"],
        ["--to", "scale_ratio", "--to-frame-gap", "1", "--to-fps", "2"],
        ["--frame-gap", "6"],
        ["--fps", "0"],
    ],
)
def test_rates_that_do_not_fit_together_are_wrong_usage(tsttc: Tsttc, options: list[str]) -> None:
    assert tsttc("convert", EXAMPLES / "predictions.json", *options).exit_code == 2


def test_rate_for_a_file_that_says_its_own_is_wrong_usage(tsttc: Tsttc) -> None:
    result = tsttc("convert", EXAMPLES / "predictions.scale_ratio.json", "--frame-gap", "1")
    assert (result.exit_code, "The file says itself" in result.stderr) == (2, True)


# --- completion, and lightness ------------------------------------------------------------------------------


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_is_a_script_that_the_shell_takes(tsttc: Tsttc, tmp_path: Path, shell: str) -> None:
    text = tsttc("completion", shell).stdout
    assert "_TSTTC_COMPLETE" in text
    script = tmp_path / "completion"
    script.write_text(text)
    if program := shutil.which(shell):
        subprocess.run([program, "-n", script], check=True)


def test_completion_knows_commands_and_options(tmp_path: Path) -> None:
    program = tmp_path / "tsttc"
    program.write_text(f"#!{sys.executable}\nfrom evaluator.cli import main\nmain(prog_name='tsttc')\n")
    program.chmod(0o755)

    def completed(words: str, number: int) -> str:
        return subprocess.run(
            [program],
            capture_output=True,
            text=True,
            check=True,
            env={
                "PYTHONPATH": str(REPOSITORY),
                "_TSTTC_COMPLETE": "bash_complete",
                "COMP_WORDS": words,
                "COMP_CWORD": str(number),
            },
        ).stdout

    assert completed("tsttc s", 1).split() == [
        "plain,score",
        "plain,submit",
        "plain,status",
        "plain,submissions",
    ]
    assert "plain,--fail-if-worse-than" in completed("tsttc submit --fail", 2)
    assert "plain,markdown" in completed("tsttc board --format m", 3)
