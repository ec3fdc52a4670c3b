"""`tsttc baseline train --start`: the weights are used as their card says."""

import re
from pathlib import Path

import pytest

from tests.evaluator.worlds import Tsttc
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
