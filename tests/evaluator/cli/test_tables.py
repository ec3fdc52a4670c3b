"""board in other formats, convert, and completion."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from evaluator import Rejected, read_manifest, read_predictions, write_predictions
from evaluator.metrics.scale import ttc_to_scale_ratio
from evaluator.predictions.conversion import convert
from tests.evaluator.cli.recorded_site import RecordedSite, Reply
from tests.evaluator.worlds import EXAMPLES, REPOSITORY, Tsttc

MANIFEST = read_manifest(EXAMPLES / "manifest.csv")
PREDICTIONS = (EXAMPLES / "predictions.json").read_bytes()
TTC_S = read_predictions(PREDICTIONS, manifest=MANIFEST).ttc_s

BOARD = {"split": "test", "edition": 2, "entries": []}


@pytest.mark.slow
@pytest.mark.usefixtures("at_site")
def test_board_in_another_format_is_the_text_of_the_site(tsttc: Tsttc, site: RecordedSite) -> None:
    site.put("GET /api/v1/splits/test/board", Reply(BOARD))
    for form, suffix in (("csv", "csv"), ("latex", "tex"), ("markdown", "md"), ("bibtex", "bib")):
        reply = Reply("@misc{é,\r\n}\r\n".encode(), headers={"Content-Type": "text/plain; charset=utf-8"})
        site.put(f"GET /board/test/editions/2.{suffix}", reply)
        result = tsttc("board", "--format", form, "--sort", "-mid", "--intervals")
        assert (result.stdout, result.stderr) == ("@misc{é,\n}\n", "")
        assert site.requests[-1].path == f"/board/test/editions/2.{suffix}?sort=-mid&intervals=1"
        refused = tsttc("board", "--mine", "--format", form)
        assert (refused.exit_code, "--mine does not go with" in refused.stderr) == (2, True)
    site.put("GET /board/test.csv", Reply(b"rank\n"))
    assert tsttc("board", "--at", "2026-11-20", "--format", "csv").stdout == "rank\n"
    assert json.loads(tsttc("board", "--format", "json").stdout) == BOARD


# --- convert ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("frame_gap", [1, 2, 3, 4, 5])
def test_ratios_at_any_gap_are_the_seconds_that_they_were_made_of(frame_gap: int) -> None:
    ratios = ttc_to_scale_ratio(TTC_S, fps_hz=10 / frame_gap)
    flat = write_predictions(manifest=MANIFEST, ttc_s=ratios)  # ratios as a flat file has them
    enveloped = write_predictions(manifest=MANIFEST, scale_ratio=ratios, frame_gap=frame_gap)
    for converted in (
        convert(flat, frame_gap=frame_gap),
        convert(flat, fps_hz=10 / frame_gap),
        convert(enveloped),
        convert(convert(enveloped, to="scale_ratio", to_frame_gap=6 - frame_gap)),
        convert(convert(PREDICTIONS, to="scale_ratio", to_fps_hz=7.5)),
    ):
        back = read_predictions(converted, manifest=MANIFEST)
        np.testing.assert_allclose(back.ttc_s, TTC_S, rtol=1e-9)
        assert back.unit == "ttc"


def test_rate_of_each_key_is_its_own() -> None:
    document = {"unit": "scale_ratio", "frame_gap": {"a": 1, "b": 5}, "predictions": {"a": 0.9, "b": 0.9}}
    converted = json.loads(convert(json.dumps(document).encode()))
    assert converted["b"] == pytest.approx(5 * converted["a"])


@pytest.mark.parametrize(
    ("text", "codes"),
    [
        ('{"a": "x", "b": null}', {"not-a-number"}),
        ('{"a": NaN}', {"nan"}),
        ('{"a": 0.9, "a": 0.8}', {"duplicate-keys"}),
        ('{"unit": "scale_ratio", "fps": 2, "predictions": {"a": -1}}', {"not-positive"}),
        ('{"unit": "scale_ratio", "frame_gap": {"a": 6}, "predictions": {"a": 1}}', {"bad-rate"}),
        (
            '{"unit": "scale_ratio", "frame_gap": {"b": 1}, "predictions": {"a": 1}}',
            {"missing-keys", "unknown-keys"},
        ),
        (
            '{"unit": "scale_ratio", "fps": {"a": 2, "b": 2, "a": 10}, "predictions": {"a": 0.8, "b": 1}}',
            {"duplicate-keys"},
        ),
        (
            '{"unit": "scale_ratio", "frame_gap": {"a": 1, "b": 5}, "predictions": {"a": 0.8}}',
            {"unknown-keys"},
        ),
        ('{"unit": "scale_ratio", "fps": "2", "predictions": {"a": 1}}', {"bad-rate"}),
        ('{"a": 0}', {"zero"}),
        ("[]", {"wrong-top-level"}),
    ],
)
def test_what_no_prediction_file_may_hold_is_not_converted(text: str, codes: set[str]) -> None:
    with pytest.raises(Rejected) as caught:
        convert(text.encode())
    assert {problem.code for problem in caught.value.problems} == codes


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
        ["--to-frame-gap", "1"],
        ["--frame-gap", "6"],
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


@pytest.mark.slow
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
