"""The paper's numbers, against a copy that was typed from the paper by itself, and their forms."""

import csv
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
    printed,
    printed_tables,
)
from tests.services import shared_data

# By table, method and column, in the order of the settings.
ABLATIONS = {
    ("ablation-scale-bins-pixel-mse", "pixel-mse"): {
        "mid": "42.5 41.8 41.3 41.0 41.0",
        "rte": "31.9 31.9 30.8 29.9 30.0",
        "time_ms": "10.0 13.6 15.5 18.5 21.2",
    },
    ("ablation-scale-bins-deep-scale", "deep-scale"): {
        "mid": "16.8 14.9 14.4 14.4 14.4",
        "rte": "13.5 12.7 12.1 12.4 12.2",
        "time_ms": "11.7 11.9 12.0 12.2 12.4",
    },
    ("ablation-frame-gap", "pixel-mse"): {
        "mid": "102.1 61.2 46.4 41.2 41.0",
        "rte": "95.7 59.0 42.8 35.1 29.9",
    },
    ("ablation-frame-gap", "deep-scale"): {
        "mid": "31.5 22.7 18.1 15.8 14.4",
        "rte": "29.5 20.1 15.9 13.5 12.1",
    },
    ("ablation-center-shift", "pixel-mse"): {"mid": "41.0 73.3", "rte": "29.9 37.6", "time_ms": "18.5 17.4"},
    ("ablation-center-shift", "deep-scale"): {"mid": "14.4 17.2", "rte": "12.1 14.6", "time_ms": "12.0 10.8"},
    ("ablation-nerf-sequences", "deep-scale"): {
        "mid": "14.4 14.5 14.3 14.6",
        "mid_crucial": "27.1 27.1 26.5 26.7",
        "mid_small": "15.5 15.4 15.2 15.4",
        "mid_large": "10.9 10.8 10.8 11.2",
        "mid_negative": "13.5 13.6 13.7 13.8",
    },
    ("ablation-plate-blur", "pixel-mse"): {"mid": "41.0 41.0 40.3 40.3", "rte": "29.9 30.0 28.7 28.7"},
    ("ablation-plate-blur", "deep-scale"): {"mid": "14.4 14.4 14.8 14.8", "rte": "12.1 12.1 12.3 12.3"},
    ("ablation-target-size", "deep-scale"): {
        "mid": "20.0 14.9 14.4 14.8 14.9",
        "rte": "16.3 12.4 12.1 12.3 12.7",
    },
    ("ablation-kernel-size", "deep-scale"): {
        "mid": "18.5 15.1 14.8 14.4 14.0",
        "rte": "15.2 12.3 12.3 12.1 11.8",
    },
}
MAIN = {
    "val": """
        213.9 675.4 305.1 112.4 115.3 54.2 58.1 56.3 55.0 50.2
        200.8 641.1 261.1  77.4 158.8 52.8 57.1 50.9 48.1 58.4
         41.0  57.4  36.5  32.5  48.4 29.9 11.3 13.0 31.0 44.3
         14.4  27.1  16.4  10.9  13.5 12.1  6.3  8.7 13.0 14.8
         14.3  26.5  15.2  10.8  13.5 12.0  6.2  8.4 12.9 14.6""",
    "test": """
        214.5 682.0 305.0 112.1 114.1 54.0 58.2 56.0 55.2 49.6
        197.6 636.4 258.5  72.1 157.0 52.0 57.6 51.1 46.8 57.7
         40.5  54.5  34.3  32.2  49.6 28.7 10.9 13.6 29.2 42.6
         14.8  27.6  15.6  11.5  13.7 12.3  6.5  8.8 13.1 15.0
         14.9  27.7  15.6  11.5  13.8 12.4  6.5  8.7 13.3 15.3""",
}
# Bins, gap, shift, NeRF sequences, blurred plates, target size, kernel.
DEFAULTS = {125, 20, 5, 3, 1, 5_000, 50, 7}


def table(name: str) -> PublishedTable:
    return published_tables().table(name)


def numbers(text: str) -> list[float]:
    return list(map(float, text.split()))


def test_every_number_of_the_ablations_is_the_papers() -> None:
    n_numbers = 0
    for (name, method), columns in ABLATIONS.items():
        rows = [row for row in table(name).rows if row.method == method]
        for column, text in columns.items():
            place = table(name).columns.index(column)
            assert [row.values[place] for row in rows] == numbers(text), (name, column)
            n_numbers += len(numbers(text))
    assert n_numbers == 118
    settings = {row.setting for name, _ in ABLATIONS for row in table(name).rows if row.is_default}
    assert settings == DEFAULTS


def test_every_number_of_the_main_table_is_the_papers() -> None:
    for split, text in MAIN.items():
        found = [value for row in table("main-results").rows if row.split == split for value in row.values]
        assert found == numbers(text)


def test_values_are_those_of_the_shared_copy() -> None:
    shared = shared_data()
    if shared is None or not (shared / "published" / "tables-2023.json").is_file():
        pytest.skip("published/tables-2023.json is not here: TSTTC_SHARED_DATA names no folder that has it")
    copy = json.loads((shared / "published" / "tables-2023.json").read_text())
    for theirs, own in zip(copy["tables"], published_tables().tables, strict=True):
        assert own.name == theirs["name"]
        assert [list(row.values) for row in own.rows] == [row["values"] for row in theirs["rows"]]


def test_contradictions_of_the_paper_are_noted_where_they_are() -> None:
    said = {
        "main-results": ("15.5", "13.7", "54. 0", "16.7", "40.3"),
        "ablation-nerf-sequences": ("1 K", "16.4"),
        "dataset-comparison": ("1 M",),
        "ablation-kernel-size": ("kernel of 9",),
        "ablation-plate-blur": ("40.5",),
    }
    for name, words in said.items():
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
    assert cameras[1] == ["Half of the field of view", "±63.2°", "±40.4°", "±18.4°", "±63.2°", "±63.2°"]


def test_latex_and_markdown_mark_the_default_and_have_notes_and_source() -> None:
    shown = printed(table("ablation-kernel-size"))
    assert r"\textbf{7} & \textbf{14.4} & \textbf{12.1} \\" in as_latex(shown)
    assert "| **7** | **14.4** | **12.1** |" in as_markdown(shown)
    for text in (as_latex(shown), as_markdown(shown)):
        assert "A kernel of 9 has a lower error" in text
        assert "2309.01539" in text


def test_every_table_has_every_format() -> None:
    for shown in printed_tables():
        assert all(WRITERS[name](shown).endswith("\n") for name in WRITERS), shown.table.name
        assert json.loads(WRITERS["json"](shown)) == json.loads(json.dumps(document(shown)))
