"""`tsttc baseline simulate` and `render`: the same options give the same split, and `run` takes it."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.evaluator.worlds import Tsttc
from tsttc_baselines import simulation
from tsttc_baselines.rendering.folders import PART, write_folder

SPLIT = ("--sequences", "12", "--recordings", "3", "--seed", "7")


def content(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@pytest.mark.slow
def test_a_rendered_folder_is_run_checked_and_scored(tsttc: Tsttc, tmp_path: Path) -> None:
    folder, out = tmp_path / "frames", tmp_path / "p.json"
    result = tsttc("baseline", "render", folder, *SPLIT, "--jobs", "1")
    assert (result.exit_code, result.stdout) == (0, f"{folder}: 12 of 12 sequences.\n")
    assert tsttc("baseline", "run", "detection", folder, "--out", out, "--strict").exit_code == 0
    assert tsttc("check", out, "--manifest", folder / "manifest.csv").exit_code == 0
    assert tsttc("score", out, "--truth", folder / "truth.csv").exit_code == 0


@pytest.mark.slow
def test_a_part_of_a_split_is_rendered_as_in_the_whole_by_any_number_of_processes(
    tsttc: Tsttc, tmp_path: Path
) -> None:
    whole, part = tmp_path / "whole", tmp_path / "part"
    assert tsttc("baseline", "render", whole, *SPLIT, "--jobs", "2").exit_code == 0
    first_and_count = ("--first", "4", "--count", "2")
    assert tsttc("baseline", "render", part, *SPLIT, *first_and_count, "--jobs", "1").exit_code == 0
    images = {name: data for name, data in content(part).items() if name.endswith(".jpg")}
    assert len(images) == 2 * 6
    assert images.items() <= content(whole).items()
    assert set((part / "boxes.csv").read_text().splitlines()) <= set(
        (whole / "boxes.csv").read_text().splitlines()
    )


@pytest.mark.slow
def test_an_interrupted_rendering_continues_with_the_same_options_alone(tsttc: Tsttc, tmp_path: Path) -> None:
    whole, ended = tmp_path / "whole", tmp_path / "ended"
    split = simulation.split(rng=np.random.default_rng(7), n_sequences=12, n_recordings=3)

    def end(n_done: int) -> None:
        if n_done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_folder(split, seed=7, path=ended, rows=range(6), progress=end)
    with (ended / PART).open("a") as part:
        part.write("[3, [[")  # as it is when a machine stops in the midst of a line
    untouched = next(ended.rglob("*.jpg"))
    before = untouched.stat().st_mtime_ns
    other = tsttc("baseline", "render", ended, *SPLIT, "--count", "5", "--jobs", "1")
    assert other.exit_code == 2
    assert "has an interrupted rendering of other options; expected these, or a new folder." in " ".join(
        other.stderr.split()
    )
    for folder in (whole, ended):
        result = tsttc("baseline", "render", folder, *SPLIT, "--count", "6", "--jobs", "1")
        assert result.exit_code == 0, result.stderr
    assert content(ended) == content(whole)
    assert untouched.stat().st_mtime_ns == before, "what was there is not rendered again"


@pytest.mark.slow
def test_simulate_and_render_draw_the_same_split(tsttc: Tsttc, tmp_path: Path) -> None:
    folder, truth, tracks = tmp_path / "frames", tmp_path / "truth.csv", tmp_path / "tracks.csv"
    assert tsttc("baseline", "simulate", truth, *SPLIT, "--tracks", tracks).exit_code == 0
    part = ("--first", "11", "--jobs", "1")
    assert tsttc("baseline", "render", folder, *SPLIT, *part).exit_code == 0
    assert (folder / "truth.csv").read_text().splitlines()[1] == truth.read_text().splitlines()[12]
    assert len(tracks.read_text().splitlines()) == 1 + 12 * 6


@pytest.mark.slow
def test_the_scripts_can_be_simulated_with_closed_and_half_open_triples(tsttc: Tsttc, tmp_path: Path) -> None:
    counts = []
    for triples in ((), ("--half-open",)):
        result = tsttc("baseline", "simulate", tmp_path / "t.csv", "--like", "scripts", *triples, "--json")
        counts.append(json.loads(result.stdout)["n_sequences"])
    assert counts[0] > counts[1] > 1_000


def test_a_folder_with_something_in_it_is_left_alone(tsttc: Tsttc, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    result = tsttc("baseline", "render", tmp_path, *SPLIT)
    assert result.exit_code == 2
    assert "has notes.txt in it; expected a new or empty folder." in " ".join(result.stderr.split())
    assert content(tmp_path) == {"notes.txt": b"mine"}


def test_a_first_sequence_beyond_the_split_is_named(tsttc: Tsttc, tmp_path: Path) -> None:
    result = tsttc("baseline", "render", tmp_path / "frames", *SPLIT, "--first", "12")
    assert result.exit_code == 2
    assert "12; expected an anno_id of the split, 0 to 11." in " ".join(result.stderr.split())
    assert not (tmp_path / "frames").exists()
