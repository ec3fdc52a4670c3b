"""The paper's numbers and their forms."""

import csv
import hashlib
import io
import json

import pytest

from evaluator.papers.tables import PublishedTable, published_tables
from evaluator.tables.published import (
    WRITERS,
    as_csv,
    as_latex,
    as_markdown,
    document,
    method_name,
    printed,
    printed_tables,
    setting_text,
)
from tests.services import shared_data


def table(name: str) -> PublishedTable:
    return published_tables().table(name)


def test_numbers_are_those_that_were_compared_with_a_second_copy_typed_from_the_paper() -> None:
    values = [[list(row.values) for row in each.rows] for each in published_tables().tables]
    digest = hashlib.sha256(json.dumps(values).encode()).hexdigest()
    assert digest == "04c9f543ff5cb61686fe04ee9d821e6263fd48ed0ee8b7263fa5f5200132d7a4"


def test_values_are_those_of_the_shared_copy() -> None:
    shared = shared_data()
    if shared is None or not (shared / "published" / "tables-2023.json").is_file():
        pytest.skip("published/tables-2023.json is not here: TSTTC_SHARED_DATA names no folder that has it")
    copy = json.loads((shared / "published" / "tables-2023.json").read_text())
    for theirs, own in zip(copy["tables"], published_tables().tables, strict=True):
        assert own.name == theirs["name"]
        assert [list(row.values) for row in own.rows] == [row["values"] for row in theirs["rows"]]


def test_contradictions_of_the_paper_are_noted_where_they_are() -> None:
    quotes = {
        "main-results": ("15.5", "13.7", "54. 0", "16.7", "40.3"),
        "ablation-nerf-sequences": ("1K", "16.4"),
        "dataset-comparison": ("1M",),
        "ablation-kernel-size": ("kernel of 9",),
        "ablation-plate-blur": ("40.5",),
    }
    for name, words in quotes.items():
        assert all(any(word in note for note in table(name).notes) for word in words), name


def test_values_are_printed_as_the_paper_prints_them() -> None:
    shown = {each.table.name: each for each in printed_tables()}
    assert shown["ablation-frame-gap"].rows[4].cells == ("Pixel MSE", "5", "41.0", "29.9")
    assert shown["ablation-plate-blur"].rows[0].cells[:3] == ("val", "Pixel MSE", "blurred")
    assert shown["dataset-comparison"].rows[5].cells == ("Annotated frames", "15K", "40K", "200K", "1M")
    assert shown["dataset-comparison"].rows[2].cells[2] == "−80 to 80"
    assert sum(each.n_results for each in shown.values()) == 218
    assert all(len(row.cells) == len(each.headings) for each in shown.values() for row in each.rows)


def test_csv_has_numbers_with_method_and_setting() -> None:
    rows = list(csv.DictReader(io.StringIO(as_csv(printed(table("ablation-frame-gap"))))))
    assert rows[4] == {
        "split": "val",
        "method": "pixel-mse",
        "frame_gap": "5",
        "is_default": "true",
        "mid": "41.0",
        "rte": "29.9",
    }
    cameras = list(csv.reader(io.StringIO(as_csv(printed(table("camera-specification"))))))
    assert cameras[0] == ["name", "Camera 1", "Camera 3", "Camera 4", "Camera 8", "Camera 9"]
    assert cameras[1] == ["Half of the field of view", "±63.2°", "±40.4°", "±18.4°", "±63.2°", "±63.2°"]


def test_latex_and_markdown_mark_the_default_and_have_notes_and_source() -> None:
    shown = printed(table("ablation-kernel-size"))
    assert r"\textbf{7} & \textbf{14.4} & \textbf{12.1} \\" in as_latex(shown)
    assert "| **7** | **14.4** | **12.1** |" in as_markdown(shown)
    for text in (as_latex(shown), as_markdown(shown)):
        assert "A kernel of 9 has a lower error" in text
        assert "2309.01539" in text


def test_split_and_method_of_a_table_are_named_where_no_column_has_them() -> None:
    subjects = {shown.table.name: shown.subject for shown in printed_tables()}
    assert subjects["ablation-kernel-size"] == "Split val, Deep Scale"
    assert subjects["ablation-frame-gap"] == "Split val"
    assert subjects["main-results"] == ""


def test_every_table_has_every_format() -> None:
    for shown in printed_tables():
        assert all(WRITERS[name](shown).endswith("\n") for name in WRITERS), shown.table.name
        assert json.loads(WRITERS["json"](shown)) == json.loads(json.dumps(document(shown)))


def test_methods_and_settings_are_written_as_the_paper_prints_them() -> None:
    assert [method_name(row) for row in table("main-results").rows][:2] == ["Detection", "SOT"]
    settings = {setting_text(row) for each in published_tables().tables for row in each.rows}
    assert {"3,000", "blurred", "not blurred"} <= settings
