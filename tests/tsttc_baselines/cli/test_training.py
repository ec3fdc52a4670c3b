"""`tsttc baseline train --start`: the weights are used as their card says."""

import csv
import re
import shutil
from pathlib import Path

import pytest

from tests.evaluator.worlds import EXAMPLES, Tsttc
from tsttc_baselines.methods import OWN_WEIGHTS


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (
            ("--cells", "15"),
            "--cells 15 contradicts the weights of --start, which were trained with 25 cells",
        ),
        (
            ("--box", "120"),
            "--box 120 contradicts the weights of --start, which were trained with boxes of 48",
        ),
        (("--margin", "16"), "--margin 16 contradicts .*, which were trained with a margin of 8 pixels"),
        (("--similarity", "dot"), "--similarity dot contradicts .* trained with the similarity cosine"),
        (("--cells", "25", "--box", "48.5"), "Error: --box 48.5 contradicts"),
        (("--cells", "15", "--box", "40"), "--cells 15 contradicts .* --box 40 contradicts"),
    ],
)
def test_an_option_that_contradicts_the_weights_of_the_start_is_refused(
    tsttc: Tsttc, tmp_path: Path, options: tuple[str, ...], words: str
) -> None:
    out = tmp_path / "w.npz"
    result = tsttc("baseline", "train", "--out", out, "--start", OWN_WEIGHTS, *options)
    assert result.exit_code == 2
    assert re.search(words, " ".join(result.stderr.split()))
    assert "; leave it out, or start without weights." in result.stderr
    assert not out.exists()


@pytest.mark.torch
@pytest.mark.slow
def test_a_training_tells_its_plan_its_rate_and_where_it_continues_and_keeps_a_log(
    tsttc: Tsttc, tmp_path: Path
) -> None:
    out, log = tmp_path / "w.npz", tmp_path / "log.csv"
    folder = EXAMPLES / "baseline"
    words = ("baseline", "train", folder, "--val", folder, "--out", out, "--log", log)
    options = ("--epochs", 2, "--batch", 12, "--cells", 5, "--box", 16, "--margin", 4)
    result = tsttc(*words, *options)
    assert result.exit_code == 0, result.stderr
    plan, *epochs = [line for line in result.stderr.splitlines() if " of 24 " not in line]
    assert plan == "2 epochs of 12 sequences, scored on 12 sequences; learning rate up to 0.0012."
    with log.open() as file:
        rows = list(csv.DictReader(file))
    assert [row["epoch"] for row in rows] == ["1", "2"]
    for line, row in zip(epochs, rows, strict=True):
        mid, rate = float(row["mid"]), float(row["learning_rate"])
        assert line.startswith(f"epoch {row['epoch']}: loss {float(row['loss']):.3f}, MiD {mid:.1f}, RTE ")
        assert line.endswith(f"%, learning rate {rate:.3g}")


@pytest.mark.torch
def test_a_folder_without_ground_truth_says_so(tsttc: Tsttc, tmp_path: Path) -> None:
    folder = shutil.copytree(EXAMPLES / "baseline", tmp_path / "frames")
    (folder / "truth.csv").unlink()
    result = tsttc("baseline", "train", folder, "--out", tmp_path / "w.npz")
    expected = "The folder has neither truth.csv nor annotation files (*.pkl); expected its ground truth."
    assert expected in " ".join(result.stderr.split())
