"""Parquet tables: read on one's own machine as the JSON that the leaderboard takes, and by no server."""

import io
from pathlib import Path
from typing import Any

import pytest

from evaluator import Rejected, convert, read_manifest, read_predictions
from evaluator.predictions import parquet as asking
from evaluator.predictions import predictions
from evaluator.predictions.predictions import json_of, read_sent, sha256_digest
from evaluator.predictions.sandbox import answer
from evaluator.tables.formats import parquet_of
from tests.evaluator.worlds import EXAMPLES, Tsttc, flat

pa: Any = pytest.importorskip("pyarrow", reason="pyarrow is not installed: pip install '.[parquet]'")
pq: Any = pytest.importorskip("pyarrow.parquet")

MANIFEST = read_manifest(EXAMPLES / "manifest.csv")
VALUES = [1.5 + row for row in range(MANIFEST.n_sequences)]
IDS = list(range(MANIFEST.n_sequences))
KEYS = {
    "bag_stamp": list(MANIFEST.bag_stamp),
    "cam_id": list(MANIFEST.cam_id),
    "ts": list(MANIFEST.ts_ns),
    "track_id": list(MANIFEST.track_id),
}


def table(**columns: Any) -> bytes:
    out = io.BytesIO()
    pq.write_table(pa.table(columns), out, row_group_size=16)
    return out.getvalue()


GOOD = table(anno_id=IDS, note=["x"] * len(IDS), ttc=VALUES)


def test_a_table_is_what_its_json_is() -> None:
    sent = asking.as_sent(GOOD)
    found = read_predictions(GOOD, manifest=MANIFEST)
    assert found.ttc_s.tolist() == VALUES
    assert found.digest == sha256_digest(sent) == read_sent(sent, manifest=MANIFEST).digest
    assert convert(GOOD) == convert(flat(VALUES))
    assert asking.as_sent(sent) is sent


@pytest.mark.parametrize(
    "columns",
    [
        {**KEYS, "anno_id": [None] * len(IDS), "ttc": VALUES},
        {"anno_id": pa.array([str(row) for row in IDS]).dictionary_encode(), "ttc_s": pa.array(VALUES, "f4")},
        {"anno_id": pa.array(IDS, "u2"), "ttc": pa.array(VALUES, "f2")},
    ],
    ids=["natural keys", "dictionary", "small types"],
)
def test_tables_of_other_types_say_the_same(columns: dict[str, Any]) -> None:
    assert read_sent(asking.as_sent(table(**columns)), manifest=MANIFEST).ttc_s.tolist() == VALUES


def test_ratios_have_the_rate_of_their_row() -> None:
    data = table(anno_id=[0, 1], scale_ratio=[0.9, 1.1], frame_gap=[5, 1])
    expected = '{"unit":"scale_ratio","frame_gap":{"0":5.0,"1":1.0},"predictions":{"0":0.9,"1":1.1}}'
    assert asking.as_sent(data).decode() == expected


FAULTS: dict[str, tuple[bytes, str, str, str]] = {
    "magic alone": (b"PAR1", "unreadable", "not an intact Parquet table", ""),
    "cut off": (GOOD[:-9], "unreadable", "not an intact Parquet table", ""),
    "other columns": (table(x=[1]), "missing-columns", 'has the columns "x"; expected anno_id, or', "line 1"),
    "numbers as text": (
        table(anno_id=[0], ttc=["1.5"]),
        "bad-field",
        'The column "ttc" has the type "string"; expected integers or floats.',
        "column ttc",
    ),
    "nested": (table(anno_id=[0], ttc=[[1.5]]), "bad-field", 'has the type "list<', "column ttc"),
    "objects": (table(anno_id=[0], ttc=[{"s": 1.5}]), "bad-field", 'the type "struct<', "column ttc"),
    "keys that pandas has made floats": (
        table(anno_id=[0.0], ttc=[1.5]),
        "bad-field",
        'The column "anno_id" has the type "double"; expected integers or text.',
        "column anno_id",
    ),
    "key that is missing": (
        table(anno_id=[0, None], ttc=[1.5, 2.5]),
        "bad-field",
        "The row has no anno_id; expected one in every row.",
        "row 2",
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_what_cannot_be_read_is_said_in_words(name: str) -> None:
    data, code, words, where = FAULTS[name]
    with pytest.raises(Rejected) as caught:
        asking.as_sent(data)
    [problem] = caught.value.problems
    assert (problem.code, problem.where) == (code, where)
    assert words in problem.message


def test_two_columns_of_one_name_are_refused() -> None:
    out = io.BytesIO()
    pq.write_table(pa.Table.from_arrays([[0], [1.5], [2.5]], names=["anno_id", "ttc", "ttc"]), out)
    with pytest.raises(Rejected, match='2 columns "ttc"; expected one'):
        asking.as_sent(out.getvalue())


def test_values_that_are_missing_are_the_problems_of_json() -> None:
    data = table(anno_id=IDS, ttc=[None, float("nan"), 0.0, *VALUES[3:]])
    with pytest.raises(Rejected) as caught:
        read_sent(asking.as_sent(data), manifest=MANIFEST)
    found = {problem.where: problem.code for problem in caught.value.problems}
    assert found == {"/0": "not-a-number", "/1": "nan", "/2": "zero"}


def test_a_bomb_is_refused_by_what_it_says_of_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(predictions, "MAX_UNPACKED_BYTES", 100)
    with pytest.raises(Rejected, match=r"unpacks to [\d,]+ bytes; expected at most 100"):
        asking.as_sent(table(anno_id=IDS, ttc=VALUES))
    monkeypatch.setattr(asking, "MAX_ROWS", 59)
    with pytest.raises(Rejected, match="has 60 rows; expected at most 59"):
        asking.as_sent(GOOD)


def test_the_server_reads_no_parquet_and_says_what_to_do() -> None:
    said = answer(GOOD, manifest=MANIFEST).decode()
    assert '"verdict": "rejected"' in said
    assert "The file looks like a Parquet table; tsttc submit sends one, and tsttc convert makes JSON" in said
    assert json_of(GOOD) == GOOD


def test_every_command_takes_them(tsttc: Tsttc, tmp_path: Path) -> None:
    path = tmp_path / "mine.parquet"
    path.write_bytes(GOOD)
    scored = tsttc("score", path, "--truth", EXAMPLES / "truth.csv")
    assert scored.exit_code == 0, scored.output
    path.write_bytes(b"PAR1")
    told = tsttc("check", path, "--manifest", EXAMPLES / "manifest.csv")
    assert told.exit_code == 1
    assert "not an intact Parquet table" in told.stderr


def test_a_machine_without_pyarrow_says_what_to_install(
    tsttc: Tsttc, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(asking, "find_spec", lambda _name: None)
    path = tmp_path / "mine.parquet"
    path.write_bytes(GOOD)
    told = tsttc("check", path, "--manifest", EXAMPLES / "manifest.csv")
    assert (told.exit_code, told.stdout) == (2, "")
    assert "mine.parquet, a Parquet table, needs pyarrow, which is not installed." in told.stderr
    assert told.stderr.endswith("Install it with: pip install pyarrow\n")


def test_tables_of_results_keep_numbers_texts_and_what_is_missing() -> None:
    rows: list[dict[str, object]] = [{"a": 1.5, "b": "x"}, {"a": None, "b": "=y"}]
    found = pq.read_table(io.BytesIO(parquet_of(rows, columns=["a", "b"])))
    assert found.to_pylist() == rows
