"""Parquet tables: read on one's own machine as the JSON that the leaderboard takes, and by no server."""

import io
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from evaluator import Rejected, convert, read_manifest, read_predictions
from evaluator.predictions import parquet as asking
from evaluator.predictions.loading import json_of, read_sent, sha256_digest
from evaluator.predictions.reader import answer
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
    predictions = read_predictions(GOOD, manifest=MANIFEST)
    assert predictions.ttc_s.tolist() == VALUES
    assert predictions.digest == sha256_digest(sent) == read_sent(sent, manifest=MANIFEST).digest
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
    "other columns": (table(x=[1]), "missing-columns", 'has the columns "x"; expected anno_id, or', "line 1"),
    "numbers as text": (
        table(anno_id=[0], ttc=["1.5"]),
        "bad-field",
        'The column "ttc" has the type "string"; expected integers or floats.',
        "column ttc",
    ),
    "nested": (table(anno_id=[0], ttc=[[1.5]]), "bad-field", 'has the type "list<', "column ttc"),
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
def test_what_cannot_be_read_is_refused_in_words(name: str) -> None:
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


def test_the_server_reads_no_parquet_and_says_what_to_do() -> None:
    text = answer(GOOD, manifest=MANIFEST).decode()
    assert '"verdict": "rejected"' in text
    assert "The file is a Parquet table; expected " in text
    assert "tsttc submit sends one, and tsttc convert makes JSON of it." in text
    with pytest.raises(Rejected):
        json_of(GOOD)


def test_a_machine_without_pyarrow_says_what_to_install(
    tsttc: Tsttc, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(asking, "find_spec", lambda _name: None)
    path = tmp_path / "mine.parquet"
    path.write_bytes(GOOD)
    refused = tsttc("check", path, "--manifest", EXAMPLES / "manifest.csv")
    assert (refused.exit_code, refused.stdout) == (2, "")
    assert "mine.parquet, a Parquet table, needs pyarrow, which is not installed." in refused.stderr
    assert refused.stderr.endswith("Install it with: pip install pyarrow\n")


def test_tables_of_results_keep_numbers_texts_and_what_is_missing() -> None:
    rows: list[dict[str, object]] = [{"a": 1.5, "b": "x"}, {"a": None, "b": "=y"}]
    written = pq.read_table(io.BytesIO(parquet_of(rows, columns=["a", "b"])))
    assert written.to_pylist() == rows


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="the system does not list threads")
def test_reading_a_table_starts_no_thread_that_could_abort_the_end_of_the_process(tmp_path: Path) -> None:
    path = tmp_path / "x.parquet"
    path.write_bytes(GOOD)
    program = f"""
import os
from pathlib import Path
from pyarrow import parquet
from evaluator.predictions.parquet import as_sent
before = len(os.listdir("/proc/self/task"))
as_sent(Path({str(path)!r}).read_bytes())
print(len(os.listdir("/proc/self/task")) - before)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "0\n"
