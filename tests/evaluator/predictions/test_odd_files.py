"""Files as programs and people write them by mistake: each is refused with what to write instead."""

from __future__ import annotations

import json
import lzma
import struct
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import evaluator
from evaluator import Predictions, Rejected, read_predictions
from evaluator.frames import predictions_from_frame
from tests.evaluator.worlds import Tsttc

MANIFEST = evaluator.read_manifest(
    b"anno_id,bag_stamp,cam_id,ts,track_id\n0,0007,1,1500000000,3\n1,0007,1,2100000000,3\n"
    b"2,day-0012,4,700000000,11\n3,day-0012,4,1300000000,11\n"
)
SECONDS = [5.31, -12.9, 3.2, -4.4]
ROWS = [f"{number},{value}" for number, value in enumerate(SECONDS)]
BODY = "\n".join(ROWS) + "\n"


def refusal(data: str | bytes) -> str:
    """All sentences of the refusal."""
    with pytest.raises(Rejected) as caught:
        read_predictions(data.encode() if isinstance(data, str) else data, manifest=MANIFEST)
    return "\n".join(problem.message for problem in caught.value.problems)


def with_first(value: str) -> str:
    return "\n".join(["anno_id,ttc", f"0,{value}", *ROWS[1:]])


# --- values


NO_ESTIMATE = "A sequence without an estimate needs a value, too"


@pytest.mark.parametrize(
    ("text", "advice"),
    [
        ("5,31", "Write a point, not a comma: 5.31."),
        ("-12,9e1", "Write a point, not a comma: -12.9e1."),
        ("5.31 s", 'Write the number alone, without "s".'),
        ("531%", 'Write the number alone, without "%".'),
        ("5310ms", 'Write the number alone, without "ms".'),
        ("\u221212.9", "Its sign is the character U+2212; expected a hyphen"),
        ("\u201312.9", "Its sign is the character U+2013; expected a hyphen"),
        ("1.#INF", "Write it as Infinity."),
        ("∞", "Write it as Infinity."),
        *((nothing, NO_ESTIMATE) for nothing in ("NA", "N/A", "None", "null", "-", "", "#DIV/0!", "1.#QNAN")),
    ],
)
def test_a_text_for_a_number_says_what_to_write_in_a_table_and_in_json(text: str, advice: str) -> None:
    assert advice in refusal(with_first(f'"{text}"'))
    assert advice in refusal(json.dumps({"0": text, "1": 1.0, "2": 2.0, "3": 3.0}))


@pytest.mark.parametrize("text", ["lorem", "12:30", "0x1p3", "5_1", "5.31D+00", "1,005.31", "٥.31", "x" * 60])
def test_a_text_of_unclear_meaning_is_shown_without_advice(text: str) -> None:
    assert refusal(with_first(f'"{text}"')).endswith("expected a number of seconds.")


@pytest.mark.parametrize(
    ("token", "advice"),
    [
        *((each, NO_ESTIMATE) for each in ("nan", "NAN", "-NaN", "None", "undefined", "NA")),
        ("inf", "Write it as Infinity."),
        ("-inf", "Write it as -Infinity."),
        (".5", "Write the number itself: 0.5."),
        ("5.", "Write the number itself: 5.0."),
        ("+5", "Write the number itself: 5.0."),
        ("05.31", "Write the number itself: 5.31."),
        ("'5.31'", "Write the number itself: 5.31."),
        ("5.31f", 'Write the number alone, without "f".'),
        ("5,31", "Write numbers with a point, not with a comma: 5.31."),
    ],
)
@pytest.mark.parametrize("is_first", [True, False])
def test_a_number_that_json_does_not_know_says_how_it_is_written(
    token: str, advice: str, is_first: bool
) -> None:
    text = f'{{"0": {token}, "1": 1}}' if is_first else f'{{"1": 1, "0": {token}}}'
    assert advice in refusal(text)


@pytest.mark.parametrize(
    ("value", "advice"),
    [([1, 2, 3, 4, 5, 6], "A sequence has one value"), ({"ttc": 5.31}, "Write the number itself.")],
)
def test_several_values_of_a_sequence_are_named_as_such(value: object, advice: str) -> None:
    assert advice in refusal(json.dumps(dict.fromkeys("0123", value)))


# --- tables


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("anno_id,ttc\n" + BODY.replace(".", ","), "Write numbers with a point, not with a comma"),
        ("anno_id,ttc\n0,5.31,\n" + BODY, "Remove the comma at the end of the rows"),
        ("anno_id,ttc\n# half\n" + BODY, "The row has 1 field; expected 2, as the header. Remove comments."),
        (f"anno_id,ttc\n{ROWS[0]}\nanno_id , ttc\n{BODY}", "The row repeats the header"),
        ('"anno_id,ttc"\n"0,5.31"\n', "Whole lines are in quotation marks"),
        ('anno_id,ttc\n0,"5.31\n', "a quotation mark has no second one"),
        ("\ufeff\ufeffanno_id,ttc\n" + BODY, "invisible characters"),
        ("anno\0_id,ttc\n" + BODY, "invisible characters"),
        ("ttc,note\n5.31,a\n", "No column names the sequences"),
        ("anno_id,bag_stamp\n0,a\n", "No column has the predictions."),
        ("anno_id,scale_ratio\n0,1.1\n", "Scale ratios need the column fps or frame_gap."),
    ],
)
def test_a_slip_in_a_table_is_named(table: str, words: str) -> None:
    assert words in refusal(table)


@pytest.mark.parametrize("row", ["", "   ", ",", " , "])
@pytest.mark.parametrize("line", [1, 3, 5])
def test_a_row_without_any_text_is_no_row(row: str, line: int) -> None:
    lines = ["anno_id,ttc", *ROWS]
    lines.insert(line, row)
    read = read_predictions("\n".join(lines).encode(), manifest=MANIFEST)
    assert read.ttc_s.tolist() == SECONDS


@pytest.mark.parametrize(
    ("header", "words"),
    [
        ("anno-id,ttc", 'Rename "anno-id" to anno_id.'),
        ("annoId,ttc [s]", 'Rename "annoId" to anno_id and "ttc [s]" to ttc.'),
        ("anno_id,tau", 'Rename "tau" to ttc.'),
        ("anno_id,ttc_pred", 'Rename "ttc_pred" to ttc.'),
        ("natural_key,ttc", 'Rename "natural_key" to anno_id.'),
        ("anno_id,time_to_contact", 'Rename "time_to_contact" to ttc.'),
        ("anno_id,error", "No column has the predictions."),
    ],
)
def test_a_column_of_another_name_is_to_be_renamed(header: str, words: str) -> None:
    assert words in refusal(f"{header}\n{BODY}")


@pytest.mark.parametrize(
    "name", ["pred", "prediction", "ttc_pred", "predTTC", "ttc_hat", "y_hat", "estimated_ttc_s"]
)
@pytest.mark.parametrize("value", ["ttc", "ttc_s"])
def test_true_times_beside_predictions_are_not_taken_for_them(name: str, value: str) -> None:
    frame = pd.DataFrame({"anno_id": range(4), value: SECONDS, name: SECONDS[::-1]})
    words = refusal(frame.to_csv(index=False))
    assert f'has the columns "{value}" and "{name}"; expected one column of predictions' in words
    with pytest.raises(KeyError, match=name):
        predictions_from_frame(frame, manifest=MANIFEST)
    assert predictions_from_frame(frame, manifest=MANIFEST, column=name).ttc_s.tolist() == SECONDS[::-1]


@pytest.mark.parametrize(
    "name", ["pred_box_width", "predicted_class", "n_predictions", "estimator", "output_path"]
)
def test_other_columns_are_ignored(name: str) -> None:
    frame = pd.DataFrame({"anno_id": range(4), "ttc": SECONDS, name: 1})
    read = read_predictions(frame.to_csv(index=False).encode(), manifest=MANIFEST)
    assert read.ttc_s.tolist() == SECONDS


# --- shapes and keys of JSON


@pytest.mark.parametrize(
    "document",
    [
        {"anno_id": [0, 1, 2, 3], "ttc": SECONDS},
        {"ttc": dict(zip("0123", SECONDS, strict=True))},
        {"columns": ["ttc"], "index": [0, 1, 2, 3], "data": [[1.0]] * 4},
        {"results": dict(zip("0123", SECONDS, strict=True))},
        {"0007": {"1": {"1500000000": {"3": 5.31}}}},
    ],
)
def test_values_one_level_too_deep_are_one_problem(document: object) -> None:
    words = refusal(json.dumps(document))
    assert "No key of the file names a sequence" in words
    assert "\n" not in words


@pytest.mark.parametrize(
    ("ending", "words"),
    [
        ("\0", "Characters that cannot be seen"),
        ("\0" * 512, "Characters that cannot be seen"),
        ("\x1a", "Characters that cannot be seen"),
        ("{}", "several objects"),
        ("x", 'found "x"'),
    ],
)
def test_what_comes_after_the_object_is_named(ending: str, words: str) -> None:
    assert words in refusal(json.dumps(dict(zip("0123", SECONDS, strict=True))) + ending)


def test_a_file_that_ends_early_is_named_as_such_wherever_it_ends() -> None:
    text = json.dumps({"0": 5.31, "10": 1.0})
    assert all("The file ends early" in refusal(text[:n]) for n in range(2, len(text)) if text[n - 1] != "{")


def test_a_comma_too_many_is_named() -> None:
    assert refusal('{"0": 1.0,\n}').endswith("Remove the comma before it.")


@pytest.mark.parametrize(
    "spelled",
    [
        lambda key: key + "/",
        lambda key: "/" + key,
        lambda key: key + ".png",
        lambda key: key.replace("/", "_"),
        lambda key: key.replace("/", "-"),
        lambda key: key.replace("/", " / "),
        lambda key: key.replace("/", "."),
    ],
)
def test_a_natural_key_that_is_spelled_otherwise_is_recognised(spelled: Callable[[str], str]) -> None:
    keys = [spelled(key) for key in MANIFEST.natural_keys]
    words = refusal(json.dumps(dict(zip(keys, SECONDS, strict=True))))
    assert f'means "{MANIFEST.natural_keys[0]}"' in words
    assert "by natural key" in words


@pytest.mark.parametrize(("n_shifted", "words"), [(1, "1 too high"), (2, "2 too high"), (-1, "")])
def test_shifted_anno_ids_are_named_as_shifted_and_not_as_one_that_is_missing(
    n_shifted: int, words: str
) -> None:
    document = {str(number + n_shifted): value for number, value in enumerate(SECONDS)}
    assert ("All anno_ids seem to be" in refusal(json.dumps(document))) == bool(words)
    assert words in refusal(json.dumps(document))


# --- other kinds of files and arrays


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (lzma.compress(b"{}", format=lzma.FORMAT_ALONE), "an LZMA archive"),
        (b"MZ\x90\x00" + bytes(60), "a program of Windows"),
        (struct.pack("<Q", 40) + b'{"ttc":{"dtype":"F64"}}', "a safetensors file"),
        (struct.pack("<Q", 8) + b"\x01\x02\x03\x04" + bytes(8), "binary data"),
        (b"\x08\x07\x12\x07pytorch", "binary data"),
        (b"PARE" + bytes(8), "an encrypted Parquet table"),
    ],
)
def test_binary_files_are_named_and_none_is_called_text(data: bytes, words: str) -> None:
    assert words in refusal(data)


@pytest.mark.parametrize(
    "values",
    [
        np.array([True, False, True, True]),
        [True, False, True, True],
        ["5.31", "1", "2", "3"],
        np.array([b"5.31"] * 4),
        np.array([1.0, 2.0, 3.0, "4.0"], object),
        np.array([1.0, 2.0, 3.0, True], object),
        pd.Series(["5.31", "1", "2", "3"]),
        np.array([(1.0,)] * 4, dtype=[("ttc", "f8")]),
        {1.0, 2.0, 3.0, 4.0},
        iter(SECONDS),
        [10**400, 1, 2, 3],
        [object()] * 4,
        [[1.0], [2.0, 3.0], 4.0, 5.0],
    ],
)
def test_what_is_no_real_number_is_no_prediction(values: Any) -> None:
    for make in (Predictions.from_arrays, evaluator.write_predictions):
        with pytest.raises((TypeError, ValueError), match=r"The values are .*expected"):
            make(ttc_s=values, manifest=MANIFEST)


@pytest.mark.parametrize(
    "values",
    [
        SECONDS,
        tuple(SECONDS),
        np.array(SECONDS, object),
        pd.array(SECONDS, dtype="Float64"),
        np.longdouble(SECONDS),
    ],
)
def test_real_numbers_of_any_container_are_predictions(values: Any) -> None:
    assert Predictions.from_arrays(ttc_s=values, manifest=MANIFEST).ttc_s.tolist() == SECONDS
    fractions = [Fraction(1, 4)] * 4
    assert Predictions.from_arrays(ttc_s=fractions, manifest=MANIFEST).ttc_s.tolist() == [0.25] * 4


def test_check_and_convert_refuse_in_the_same_words(tsttc: Tsttc, tmp_path: Path) -> None:
    (tmp_path / "manifest.csv").write_bytes(MANIFEST.to_csv())
    (tmp_path / "odd.csv").write_text(f"anno_id,ttc,pred\n{BODY}")
    (tmp_path / "odd.json").write_text('{"0": .5}')
    for name, words in (("odd.csv", "expected one column of"), ("odd.json", "Write the number itself: 0.5")):
        for command in (["check"], ["convert", "-o", tmp_path / "out.json"]):
            result = tsttc(command[0], tmp_path / name, "--manifest", tmp_path / "manifest.csv", *command[1:])
            assert result.exit_code == 1
            assert words in " ".join(result.stderr.split())


@pytest.mark.parametrize(
    "values",
    [
        ["5.31", "1", "2", "3"],
        ["5,31", "1", "2", "3"],
        [True, False, True, True],
        np.array(SECONDS) + 1j,
        pd.to_datetime(["2020-01-01"] * 4),
        pd.to_timedelta(SECONDS, unit="s"),
        [[1.0], [2.0], [3.0], [4.0, 5.0]],
    ],
)
@pytest.mark.parametrize("column", ["ttc", "scale_ratio", "fps"])
def test_a_column_of_a_frame_that_has_no_real_numbers_is_named(values: Any, column: str) -> None:
    others = {"anno_id": range(4), "scale_ratio": [0.9] * 4, "fps": [10.0] * 4}
    frame = pd.DataFrame(({"anno_id": range(4)} if column == "ttc" else others) | {column: values})
    with pytest.raises(TypeError, match=f"In the column '{column}': The values are .*expected"):
        predictions_from_frame(frame, manifest=MANIFEST)


@pytest.mark.parametrize("dtype", ["object", "category", "Float64", "float32"])
def test_a_column_of_any_real_type_is_read(dtype: Any) -> None:
    frame = pd.DataFrame({"anno_id": range(4), "ttc": pd.Series([5.5, -12.5, 3.25, -4.5]).astype(dtype)})
    read = predictions_from_frame(frame, manifest=MANIFEST)
    assert read.ttc_s.tolist() == [5.5, -12.5, 3.25, -4.5]
