"""`tsttc baseline run` and `list`: from a folder to a file that the other commands take."""

import json
from pathlib import Path

import pytest

from tests.evaluator.worlds import Tsttc
from tests.tsttc_baselines.made_folders import box, made_folder, write_boxes
from tsttc_baselines.methods import METHODS, Method


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "in").mkdir()
    return made_folder(tmp_path / "in")


def test_the_list_names_every_method_with_its_parameters(tsttc: Tsttc) -> None:
    text = tsttc("baseline", "list").stdout
    assert "detection  Detection; as published with --measure area." in text
    documents = json.loads(tsttc("baseline", "list", "--json").stdout)
    assert [document["name"] for document in documents] == [method.name for method in METHODS]
    detection = next(document for document in documents if document["name"] == "detection")
    assert detection["parameters"][0]["choices"] == ["area", "sqrt-area", "height", "width"]
    for method in METHODS:
        assert f"{method.name}  {method.title}; " in text
        for parameter in method.parameters:
            assert f"  {parameter.option} " in text


def test_the_file_of_a_run_is_taken_by_check(tsttc: Tsttc, folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "p.json"
    result = tsttc("baseline", "run", "detection", folder, "--out", out, "--measure", "height")
    assert result.exit_code == 0, result.stderr
    assert result.stdout.startswith(f"{out}: 3 sequences in ")
    assert result.stderr == ""
    assert tsttc("check", out, "--manifest", folder / "manifest.csv").exit_code == 0
    assert json.loads(out.read_text())["meta"]["parameters"] == {"measure": "height"}


def test_fallbacks_are_counted_by_reason_with_an_example(tsttc: Tsttc, folder: Path, tmp_path: Path) -> None:
    write_boxes(folder, changes={(1, 5): (), (2, 5): (50, 10, 20, 60)})
    result = tsttc("baseline", "run", "detection", folder, "--out", tmp_path / "p.json")
    assert result.exit_code == 0
    assert result.stderr.splitlines() == [
        "2 of them have a fallback, from the boxes' areas or 1:",
        "  1  no box in the target frame "
        "(boxes.csv, sequence 1: There is no box for the target; expected one.)",
        "  1  box is reversed "
        "(boxes.csv, sequence 2: The box of the target is (50, 10, 20, 60); expected x1 < x2 and y1 < y2.)",
    ]
    document = json.loads(
        tsttc("baseline", "run", "detection", folder, "--out", tmp_path / "p.json", "--json").stdout
    )
    assert document["n_fallback"] == {"no box in the target frame": 1, "box is reversed": 1}
    assert document["n_sequences"] == 3


def test_a_run_that_is_nearly_all_fallbacks_is_a_fault(tsttc: Tsttc, folder: Path, tmp_path: Path) -> None:
    write_boxes(folder, changes={(anno_id, 5): (50, 30, 51, 60) for anno_id in range(3)})
    out = tmp_path / "p.json"
    result = tsttc("baseline", "run", "detection", folder, "--out", out)
    assert result.exit_code == 1
    assert (
        "boxes.csv, sequence 0: 3 of 3 sequences have no estimate, 3 of them for this reason: The box of "
        "frame 5 is (50, 30, 51, 60); expected sides of at least 4 px." in " ".join(result.stderr.split())
    )
    assert not out.exists()


@pytest.mark.parametrize(("low", "name"), [(0, "x"), (1, "y")])
def test_columns_of_boxes_that_are_swapped_are_named(
    tsttc: Tsttc, folder: Path, tmp_path: Path, low: int, name: str
) -> None:
    boxes = {(anno_id, frame): list(box(frame)) for anno_id in range(3) for frame in range(6)}
    for values in boxes.values():
        values[low], values[low + 2] = values[low + 2], values[low]
    write_boxes(folder, changes=boxes)
    result = tsttc("baseline", "run", "detection", folder, "--out", tmp_path / "p.json")
    assert result.exit_code == 1
    assert (
        f"boxes.csv: {name}1 and {name}2 are swapped: 3 of 3 sequences have a box with {name}2 < {name}1; "
        f"expected {name}1 < {name}2." in " ".join(result.stderr.split())
    )


def test_strict_exits_1_and_writes_nothing(tsttc: Tsttc, folder: Path, tmp_path: Path) -> None:
    write_boxes(folder, changes={(1, 5): ()})
    out = tmp_path / "p.json"
    result = tsttc("baseline", "run", "detection", folder, "--out", out, "--strict", "--json")
    assert result.exit_code == 1
    assert f"{folder} is rejected: 1 problem" in result.stderr
    assert json.loads(result.stdout)["problems"] == [
        {
            "code": "bad-box",
            "where": "boxes.csv, sequence 1",
            "message": "There is no box for the target; expected one.",
        }
    ]
    assert not out.exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["detection", "--bins", "20"], "detection has no option --bins; its options are --measure."),
        (["detection", "--gap", "6"], "Invalid value for '--gap'"),
        (["nothing"], "Invalid value for 'METHOD'"),
        (["detection", "--out", "no/folder/p.json"], "no/folder is not a folder that can be written to."),
        (["pixel-mse", "--expand", "nan"], "--expand is nan; expected a finite number."),
    ],
)
def test_wrong_usage_exits_2_in_words(
    tsttc: Tsttc, folder: Path, tmp_path: Path, words: list[str], message: str
) -> None:
    method, *options = words
    result = tsttc("baseline", "run", method, folder, "--out", tmp_path / "p.json", *options)
    assert result.exit_code == 2
    assert message in " ".join(result.stderr.split())
    assert {path.name for path in tmp_path.iterdir()} == {"in"}


@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)
def test_every_method_needs_no_option_and_is_as_published_or_says_that_it_is_not(method: Method) -> None:
    parameters = method.filled({})
    assert method.estimator(parameters) is not None
    assert set(method.published or {}) <= set(parameters)
    assert method.provenance(parameters) in {"as published", "variant", "unpublished"}
    for parameter in method.parameters:
        if parameter.choices:
            assert parameter.default in parameter.choices
