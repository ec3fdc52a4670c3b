"""`tsttc baseline train --start`: the weights are used as their card says."""

import json
import re
from importlib.util import find_spec
from pathlib import Path

import pytest

from baselines.deep_scale.weights import Use, Weights, read_weights, write_weights
from baselines.methods import OWN_WEIGHTS
from tests.baselines.deep_scale.made_weights import checkpoint, random_tensors, written
from tests.evaluator.worlds import Tsttc


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


def test_the_toolkit_s_weights_refuse_a_cosine(tsttc: Tsttc, tmp_path: Path) -> None:
    start = written(tmp_path / "Deep_TTC.pth", checkpoint(random_tensors()))
    options = ("--out", tmp_path / "w.npz", "--start", start, "--similarity", "cosine")
    result = tsttc("baseline", "train", *options)
    assert result.exit_code == 2
    assert "--similarity cosine contradicts the weights of --start" in result.stderr


def rendered(tsttc: Tsttc, folder: Path, *, n: int, seed: int) -> Path:
    options = ("--sequences", str(n), "--recordings", "1", "--seed", str(seed), "--jobs", "1")
    assert tsttc("baseline", "render", folder, *options).exit_code == 0
    return folder


@pytest.mark.slow
@pytest.mark.skipif(find_spec("torch") is None, reason="torch is not installed: pip install '.[train]'")
@pytest.mark.parametrize("decoding", ["head", "fit"])
def test_a_start_is_used_as_its_card_says_and_scored_before_epoch_1(
    tsttc: Tsttc, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, decoding: str
) -> None:
    # Batches move the running means whatever the rate is.
    monkeypatch.setattr("baselines.deep_scale.torch_layers.BN_MOMENTUM", 0.0)
    use = Use(similarity="cosine", n_cells=10, max_box_px=16.0, margin_px=4.0, decoding=decoding)
    start = tmp_path / "start.npz"
    write_weights(start, Weights(read_weights(OWN_WEIGHTS).tensors, use))
    folder, out = rendered(tsttc, tmp_path / "frames", n=4, seed=5), tmp_path / "w.npz"
    options = ("--val", folder, "--out", out, "--start", start, "--epochs", "1", "--batch", "2", "--json")
    result = tsttc("baseline", "train", folder, *options, "--rate", "1e-12")
    assert result.exit_code == 0, result.stderr
    before, after = json.loads(result.stdout)["epochs"]
    assert (before["number"], before["loss"], after["number"]) == (0, None, 1)
    assert json.loads(result.stdout)["best"] == 1
    assert after["mid"] == pytest.approx(before["mid"], rel=1e-4)
    lines = [line for line in result.stderr.splitlines() if "MiD" in line]
    assert lines[0] == f"before epoch 1: MiD {before['mid']:.1f}, RTE {before['rte']:.1f} %"
    assert re.fullmatch(r"epoch 1: loss \d+\.\d{3}, MiD \d+\.\d, RTE \d+\.\d %", lines[1])
    trained = read_weights(out)
    assert trained.use == use
    assert trained.card["recipe"]["fit_weight"] == (1.0 if decoding == "fit" else 0.0)
