"""score with its breakdowns, and plot: one's own results without the leaderboard."""

import csv
import json
from pathlib import Path
from typing import Any

import pytest

from evaluator import evaluate, read_predictions, read_truth
from evaluator.cli.scores import KINDS
from tests.evaluator.worlds import EXAMPLES, Tsttc

GOOD = EXAMPLES / "predictions.json"
RATIOS = EXAMPLES / "predictions.scale_ratio.json"
TRUTH = EXAMPLES / "truth.csv"


def document(tsttc: Tsttc, *arguments: object) -> Any:
    result = tsttc("score", *arguments, "--truth", TRUTH, "--json")
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


def test_groups_stand_in_the_document_of_a_file_and_as_rows_of_its_table(tsttc: Tsttc) -> None:
    report = document(tsttc, GOOD, "--by", "camera")
    assert report["by"] == "camera"
    assert sum(group["n_sequences"] for group in report["groups"]) == report["n_sequences"]
    lines = tsttc("score", GOOD, "--truth", TRUTH, "--by", "camera").stdout.splitlines()
    assert lines[0].split()[:3] == ["camera", "MiD", "MiD_c"]
    assert [line.split()[1] for line in lines[1:4]] == [f"{g['scores']['mid']:.2f}" for g in report["groups"]]


def test_several_files_are_rows_of_one_table_and_one_document(tsttc: Tsttc) -> None:
    lines = tsttc("score", GOOD, RATIOS, "--truth", TRUTH).stdout.splitlines()
    assert [line.split()[0] for line in lines[:3]] == ["file", GOOD.name, RATIOS.name]
    files = document(tsttc, GOOD, RATIOS)["files"]
    assert [each["file"] for each in files] == [GOOD.name, RATIOS.name]
    assert {"file": GOOD.name, **document(tsttc, GOOD)} == files[0]


def test_a_gate_of_several_files_names_the_one_that_fails(tsttc: Tsttc) -> None:
    result = tsttc("score", GOOD, RATIOS, "--truth", TRUTH, "--fail-if", "mid > 5")
    assert result.exit_code == 6
    assert f"Error: {GOOD.name}: The gate fails: mid is 11.99" in result.stderr


@pytest.mark.parametrize(
    ("form", "start", "separator"),
    [("csv", "file,", ","), ("markdown", "| file |", "|"), ("latex", "%", "&")],
)
def test_other_formats_have_a_row_for_each_file(tsttc: Tsttc, form: str, start: str, separator: str) -> None:
    text = tsttc("score", GOOD, RATIOS, "--truth", TRUTH, "--format", form).stdout
    rows = [line for line in text.splitlines() if GOOD.name in line]
    assert text.startswith(start)
    assert len(rows) == 1
    assert rows[0].count(separator) >= 10
    assert "11.9" in rows[0]


def test_sequences_are_written_with_true_and_predicted_times(tsttc: Tsttc, tmp_path: Path) -> None:
    path = tmp_path / "sequences.csv"
    result = tsttc("score", GOOD, "--truth", TRUTH, "--per-sequence", path)
    assert result.exit_code == 0
    rows = list(csv.DictReader(path.read_text().splitlines()))
    truth = read_truth(TRUTH)
    report = evaluate(read_predictions(GOOD.read_bytes(), manifest=truth.manifest), truth)
    assert [float(row["ttc_s"]) for row in rows] == truth.ttc_s.tolist()
    assert sum(float(row["mid"]) for row in rows) / len(rows) == pytest.approx(report.scores["overall"].mid)
    assert {row["file"] for row in rows} == {GOOD.name}
    away = tsttc("score", GOOD, "--truth", TRUTH, "--per-sequence", tmp_path / "no" / "x.csv")
    assert away.exit_code == 2
    assert "--per-sequence" in away.stderr


def test_intervals_that_do_not_exist_are_reported_as_missing(tsttc: Tsttc) -> None:
    result = tsttc("score", GOOD, "--truth", TRUTH, "--intervals")
    assert result.exit_code == 0
    assert "There are no confidence intervals: one needs 8 recordings of equal size" in result.stderr
    assert set(document(tsttc, GOOD, "--intervals")["intervals"].values()) == {None}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--by", "lane"), "does not state same_lane; expected a table with this column"),
        (("--by", "weather"), "'weather' is not one of"),
        (("--format", "csv", "--json"), "--json and --format exclude each other"),
        ((GOOD,), "A file is named twice"),
    ],
)
def test_what_cannot_be_done_is_refused(tsttc: Tsttc, arguments: tuple[object, ...], words: str) -> None:
    result = tsttc("score", GOOD, "--truth", TRUTH, *arguments)
    assert result.exit_code == 2
    assert words in " ".join(result.stderr.split())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "suffix", "start"),
    [("error", "svg", b"<?xml"), ("scatter", "pdf", b"%PDF"), ("distribution", "png", b"\x89PNG")],
)
def test_plot_draws_two_files_into_one_figure(
    tsttc: Tsttc, tmp_path: Path, kind: str, suffix: str, start: bytes
) -> None:
    plots = pytest.importorskip("evaluator.scoring.plots", reason="matplotlib is not installed")
    assert tuple(plots.KINDS) == KINDS
    path = tmp_path / f"figure.{suffix}"
    result = tsttc("plot", GOOD, RATIOS, "--truth", TRUTH, "--kind", kind, "-o", path)
    assert result.exit_code == 0, result.output
    assert path.read_bytes().startswith(start)
    if suffix == "svg":
        assert all(word in path.read_text() for word in ("true TTC (s)", "predictions.scale_ratio"))


@pytest.mark.slow
def test_plot_names_the_endings_that_it_can_write(tsttc: Tsttc, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    result = tsttc("plot", GOOD, "--truth", TRUTH, "-o", tmp_path / "figure.jpg")
    assert result.exit_code == 2
    assert "found 'figure.jpg', expected a name that ends in .svg, .pdf, .png." in " ".join(
        result.stderr.split()
    )
