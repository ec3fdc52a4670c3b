"""`tsttc baseline ablate` and `show`, on rendered frames."""

import json
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from tests.evaluator.worlds import Tsttc


@pytest.fixture
def frames(tsttc: Tsttc, tmp_path: Path) -> Path:
    """A rendered folder of four sequences."""
    folder = tmp_path / "frames"
    assert tsttc("baseline", "render", folder, "--sequences", "4", "--jobs", "1").exit_code == 0
    return folder


def test_the_papers_table_stands_beside_the_own_scores(tsttc: Tsttc, frames: Path) -> None:
    result = tsttc("baseline", "ablate", "frame-gap", frames, "--jobs", "1")
    assert result.exit_code == 0
    head, first, *_ = result.stdout.splitlines()
    assert " ".join(head.split()) == "frame gap MiD paper MiD here RTE paper RTE here fallbacks"
    assert first.split()[:2] == ["1", "102.1"]
    assert "5 (default)" in result.stdout
    assert "validation split" in result.stdout


def test_the_table_is_a_document_too(tsttc: Tsttc, frames: Path) -> None:
    options = ("--truth", frames / "truth.csv", "--jobs", "1", "--json")
    document = json.loads(tsttc("baseline", "ablate", "shift", frames, *options).stdout)
    assert document["published_table"] == "ablation-center-shift"
    assert document["rows"][0]["published"] == {"mid": 73.3, "rte": 37.6}
    assert document["rows"][0]["scores"]["mid"] > 0


def test_a_folder_without_a_truth_needs_one(tsttc: Tsttc, frames: Path) -> None:
    (frames / "truth.csv").unlink()
    result = tsttc("baseline", "ablate", "bins", frames)
    assert result.exit_code == 1
    assert (
        "The folder has neither truth.csv nor annotation files (*.pkl); expected its ground truth."
        in result.stderr
    )


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["svg", "png"])
def test_a_sequence_is_drawn(tsttc: Tsttc, frames: Path, tmp_path: Path, suffix: str) -> None:
    figure = tmp_path / f"2.{suffix}"
    result = tsttc("baseline", "show", frames, "2", "-o", figure)
    assert result.exit_code == 0
    assert result.stdout.startswith(f"{figure}: Sequence 2: α = ")
    assert "true TTC" in result.stdout
    if suffix == "svg":
        assert ET.fromstring(figure.read_text()).get("role") == "img"
    else:
        assert figure.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("anno_id", "name", "sentence"),
    [
        ("9", "9.svg", "has no sequence 9; expected one of its 4 anno_ids, from 0 to 3."),
        ("1", "1.pdf", "1.pdf ends in .pdf; expected .svg or .png."),
    ],
)
def test_what_cannot_be_drawn_is_refused_in_a_sentence(
    tsttc: Tsttc, frames: Path, tmp_path: Path, anno_id: str, name: str, sentence: str
) -> None:
    result = tsttc("baseline", "show", frames, anno_id, "-o", tmp_path / name)
    assert result.exit_code == 2
    assert sentence in result.stderr
    assert not (tmp_path / name).exists()
