"""Ground truth and manifests: reading, refusing, naming, keeping."""

import hashlib
import io
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evaluator import GroundTruth, Manifest, Problem, Rejected, read_manifest, read_truth
from evaluator.predictions.revisions import rows_in
from evaluator.truth.csv_tables import name_fault, read_csv
from tests.evaluator.worlds import make_truth

HEADER = "anno_id,bag_stamp,cam_id,ts,track_id,ttc"
ROWS = ["4,0007,1,1500000000,3,2.5", "1,0007,1,2100000000,3,-8.125", "9,0003,cam8,700000000,11,25"]

Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def write_csv(*rows: str, header: str = HEADER) -> Path:
        path = tmp_path / "truth.csv"
        path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
        return path

    return write_csv


def rejection(path: Path, read: Callable[[Path], object] = read_truth) -> Rejected:
    with pytest.raises(Rejected) as rejected:
        read(path)
    return rejected.value


# --- what is read ----------------------------------------------------------------------------------------


def test_a_table_is_read_in_file_order(write: Write) -> None:
    truth = read_truth(write(*ROWS))
    manifest = truth.manifest
    assert truth.ttc_s.tolist() == [2.5, -8.125, 25.0]
    assert manifest.anno_id.tolist() == [4, 1, 9]
    assert manifest.bag_stamp == ("0007", "0007", "0003")
    assert manifest.cam_id == ("1", "1", "cam8")
    assert manifest.ts_ns.tolist() == [1_500_000_000, 2_100_000_000, 700_000_000]
    assert manifest.track_id == ("3", "3", "11")
    assert manifest.natural_keys[0] == "0007/1/1500000000/3"
    assert (truth.n_sequences, manifest.n_sequences, manifest.n_recordings) == (3, 3, 2)


def test_columns_are_matched_by_name_and_others_ignored(write: Write) -> None:
    path = write('2.5,x,0007,4,"1",1500000000,3', header="ttc,note,bag_stamp,anno_id,cam_id,ts,track_id")
    truth = read_truth(path)
    assert truth.ttc_s.tolist() == [2.5]
    assert truth.manifest.natural_keys == ("0007/1/1500000000/3",)


def test_spreadsheets_line_ends_and_byte_order_marks_are_tolerated(tmp_path: Path, write: Write) -> None:
    plain = read_truth(write(*ROWS))
    path = tmp_path / "excel.csv"
    path.write_bytes(b"\xef\xbb\xbf" + "\r\n".join([HEADER, ROWS[0], "", *ROWS[1:], ""]).encode())
    assert read_truth(path).digest == plain.digest


def test_a_manifest_is_read_from_its_own_table_or_from_the_truths(tmp_path: Path, write: Write) -> None:
    truth = read_truth(write(*ROWS))
    path = tmp_path / "manifest.csv"
    path.write_bytes(truth.manifest.to_csv())
    assert read_manifest(path).digest == truth.manifest.digest
    assert read_manifest(write(*[row.replace("25", "nan") for row in ROWS[2:]])).n_sequences == 1


# --- what is refused -------------------------------------------------------------------------------------

WHOLE = "expected a whole number from 0 to 2^63 - 1."

FAULTS = {
    "duplicate id": (
        "4,0009,1,5,3,2.5",
        "duplicate-ids",
        'The anno_id "4" is already used at line 2; expected it once.',
    ),
    "duplicate target frame": (
        "5,0007,1,1500000000,3,2.5",
        "duplicate-natural-keys",
        'The natural key "0007/1/1500000000/3" is already used at line 2; expected it once.',
    ),
    "NaN": ("5,a,1,5,3,nan", "truth-not-finite", "ttc is nan; expected a finite number."),
    "infinite": (
        "5,a,1,5,3,-inf",
        "truth-not-finite",
        "ttc is -inf; expected a finite number.",
    ),
    "beyond float64": (
        "5,a,1,5,3,1e400",
        "truth-not-finite",
        "ttc is inf; expected a finite number.",
    ),
    "zero": (
        "5,a,1,5,3,0",
        "truth-near-zero",
        "ttc is 0.0, where the errors are undefined; expected ttc >= 1e-200 or ttc < -0.1.",
    ),
    "no time": ("5,a,1,5,3,", "bad-field", 'ttc is ""; expected a number of seconds.'),
    "underscores": (
        "5,a,1,5,3,1_0",
        "bad-field",
        'ttc is "1_0"; expected a number of seconds.',
    ),
    "negative id": ("-5,a,1,5,3,1", "bad-field", f'anno_id is "-5"; {WHOLE}'),
    "large id": (
        "9223372036854775808,a,1,5,3,1",
        "bad-field",
        f'anno_id is "9223372036854775808"; {WHOLE}',
    ),
    "fraction of a nanosecond": ("5,a,1,5.5,3,1", "bad-field", f'ts is "5.5"; {WHOLE}'),
    "other digits": ("٥,a,1,5,3,1", "bad-field", f'anno_id is "\\u0665"; {WHOLE}'),
    "no recording": ("5,,1,5,3,1", "bad-field", 'bag_stamp is "": it is empty.'),
    "slash": ("5,a/b,1,5,3,1", "bad-field", 'bag_stamp is "a/b": it contains "/".'),
    "comma": ('5,"a,b",1,5,3,1', "bad-field", 'bag_stamp is "a,b": it contains ",".'),
    "quotation mark": (
        '5,a,"1""",5,3,1',
        "bad-field",
        'cam_id is "1\\"": it contains a quotation mark.',
    ),
    "white space": (
        "5,a,1,5, 3,1",
        "bad-field",
        'track_id is " 3": it has control characters, or spaces at an end.',
    ),
    "long name": (
        f"5,{'a' * 201},1,5,3,1",
        "bad-field",
        f'bag_stamp is "{"a" * 60}…": it is longer than 200 characters.',
    ),
    "short row": ("5,a,1", "bad-csv", "The row has 3 fields; expected 6."),
    "open quotation": (
        '5,"a,1,5,3,1',
        "bad-csv",
        "This is not a CSV table: unexpected end of data.",
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_faulty_row_is_refused_by_its_line(write: Write, name: str) -> None:
    row, code, message = FAULTS[name]
    assert rejection(write(*ROWS, row)).problems == (Problem(code, message, "line 5"),)


@pytest.mark.parametrize("ttc", ["5e-324", "1e-310", "-0.05", "-0.0999999", "-0.1", "-0", "1e-201"])
def test_times_without_finite_errors_are_refused(write: Write, ttc: str) -> None:
    assert [p.code for p in rejection(write(f"5,a,1,5,3,{ttc}")).problems] == ["truth-near-zero"]


def test_missing_columns_are_named(write: Write) -> None:
    path = write("1,a,1,5,3", header="anno_id,bag_stamp,cam_id,ts,track_id")
    assert read_manifest(path).n_sequences == 1
    assert rejection(path).problems == (
        Problem(
            "missing-columns",
            'The table has no column ttc; found "anno_id,bag_stamp,cam_id,ts,track_id", '
            "expected anno_id,bag_stamp,cam_id,ts,track_id,ttc.",
            "line 1",
        ),
    )


@pytest.mark.parametrize(
    ("content", "code"),
    [
        (b"", "missing-columns"),
        (HEADER.encode() + b"\n", "empty"),
        (b"\xff\xfe", "not-utf8"),
        (b"a\x00b\n", "missing-columns"),
        (HEADER.encode() + b"\n5,a,1,5,3\x00,1\n", "bad-field"),
        (HEADER.encode() + b"\n5," + b"a" * 200_000 + b",1,5,3,1\n", "bad-csv"),
        (b'"', "bad-csv"),
    ],
)
def test_what_is_no_table_is_refused(tmp_path: Path, content: bytes, code: str) -> None:
    path = tmp_path / "truth.csv"
    path.write_bytes(content)
    assert [problem.code for problem in rejection(path).problems] == [code]


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    problem = rejection(tmp_path / "nothing.csv").problems[0]
    assert problem == Problem(
        "unreadable", "The file cannot be read: No such file or directory.", "nothing.csv"
    )
    assert rejection(tmp_path / "nothing.npz").problems[0].code == "unreadable"


@pytest.mark.slow
@settings(max_examples=200)
@given(data=st.binary(max_size=200) | st.text(max_size=100).map(lambda text: (HEADER + "\n" + text).encode()))
def test_no_bytes_raise_anything_but_a_rejection(
    tmp_path_factory: pytest.TempPathFactory, data: bytes
) -> None:
    path = tmp_path_factory.getbasetemp() / "hostile.csv"
    path.write_bytes(data)
    try:
        n_rows = len(read_csv(path, with_ttc=True).anno_id)
    except Rejected as rejected:
        n_rows = -len(rejected.problems)
    assert n_rows <= data.count(b"\n") + data.count(b"\r")


# --- digests ---------------------------------------------------------------------------------------------


def test_the_digest_is_that_of_the_canonical_text(write: Write) -> None:
    canonical = "\n".join(
        [
            HEADER,
            "1,0007,1,2100000000,3,-8.125",
            "4,0007,1,1500000000,3,2.5",
            "9,0003,cam8,700000000,11,25.0",
            "",
        ]
    )
    truth = read_truth(write(*ROWS))
    assert truth.digest == "sha256:" + hashlib.sha256(canonical.encode()).hexdigest()
    without_times = "\n".join(line.rpartition(",")[0] for line in canonical.split("\n"))
    assert truth.manifest.digest == "sha256:" + hashlib.sha256(without_times.encode()).hexdigest()


def test_the_digest_knows_no_row_order_but_every_value(write: Write) -> None:
    digest = read_truth(write(*ROWS)).digest
    assert read_truth(write(*reversed(ROWS))).digest == digest
    assert read_truth(write(*ROWS[:2], ROWS[2].replace("25", "25.000000000000004"))).digest != digest
    assert read_truth(write(*ROWS[:2], ROWS[2].replace("25", "2.5e1"))).digest == digest
    assert read_truth(write(*ROWS[:2], ROWS[2].replace("cam8", "8"))).digest != digest


def test_tables_of_one_digest_are_matched_row_by_row(write: Write) -> None:
    old = read_truth(write(*ROWS)).manifest
    for rows in (ROWS, ROWS[::-1], ROWS[1:] + ROWS[:1]):
        new = read_truth(write(*rows)).manifest
        assert new.digest == old.digest
        assert [old.natural_keys[row] for row in rows_in(old, new)] == list(new.natural_keys)


# --- keeping ---------------------------------------------------------------------------------------------


def test_what_is_saved_reads_back_exactly(tmp_path: Path, write: Write) -> None:
    truth = read_truth(write(*ROWS))
    path = tmp_path / "kept"
    truth.save(path)
    loaded = GroundTruth.load(path)
    assert loaded.digest == truth.digest
    assert loaded.manifest.digest == truth.manifest.digest
    assert loaded.to_csv() == truth.to_csv()
    truth.manifest.save(path)
    assert Manifest.load(path).to_csv() == truth.manifest.to_csv()


def repacked(path: Path, **changes: object) -> Path:
    with np.load(path) as store:
        arrays = {name: store[name] for name in store.files} | {k: np.asarray(v) for k, v in changes.items()}
    np.savez(path, **{name: array for name, array in arrays.items() if array.dtype != object})
    return path


@pytest.mark.parametrize(
    ("changes", "code"),
    [
        ({"ttc_s": [2.5, -8.125, 24.0]}, "bad-digest"),
        ({"cam_id": ["1", "1", "2"]}, "bad-digest"),
        ({"ttc_s": [2.5, -8.125, 0.0]}, "truth-near-zero"),
        ({"anno_id": [4, 4, 9]}, "duplicate-ids"),
        ({"anno_id": [-4, 1, 9]}, "bad-field"),
        ({"cam_id": ["1", "1", "a/b"]}, "bad-field"),
        ({"ttc_s": [1.0, 2.0]}, "unreadable"),
        ({"ttc_s": 1.0}, "unreadable"),
        ({"anno_id": [4.0, 1.0, 9.0]}, "unreadable"),
        ({"truth_digest": None}, "unreadable"),
        ({"track_id": None}, "unreadable"),
    ],
)
def test_a_changed_file_is_refused(
    tmp_path: Path, write: Write, changes: dict[str, object], code: str
) -> None:
    path = tmp_path / "kept.npz"
    read_truth(write(*ROWS)).save(path)
    assert rejection(repacked(path, **changes)).problems[0].code == code


@pytest.mark.slow
@settings(max_examples=100)
@given(at=st.integers(0, 3_000), n_removed=st.integers(0, 30), piece=st.binary(max_size=8))
def test_a_damaged_file_raises_nothing_but_a_rejection(
    tmp_path_factory: pytest.TempPathFactory, at: int, n_removed: int, piece: bytes
) -> None:
    truth = make_truth([4.0, 5.0])
    path = tmp_path_factory.getbasetemp() / "damaged.npz"
    truth.save(path)
    data = path.read_bytes()
    path.write_bytes(data[:at] + piece + data[at + n_removed :])
    try:
        digest = GroundTruth.load(path).digest
    except Rejected:
        return
    assert digest == truth.digest


def test_pickled_objects_in_a_saved_file_are_not_read(tmp_path: Path) -> None:
    path = tmp_path / "kept.npz"
    make_truth([4.0]).save(path)
    inner = io.BytesIO()
    np.save(inner, np.array([{}], dtype=object), allow_pickle=True)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("extra.npy", inner.getvalue())
    assert rejection(path).problems[0].code == "unreadable"


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("0007", None),
        ("cam 8", None),
        ("", "it is empty"),
        ("a/b", 'it contains "/"'),
        ("a,b", 'it contains ","'),
        ('a"b', "it contains a quotation mark"),
        (" a", "it has control characters, or spaces at an end"),
        ("a\tb", "it has control characters, or spaces at an end"),
        ("a" * 1_000, "it is longer than"),
    ],
)
def test_a_name_in_a_key_has_a_fault_or_none(text: str, fault: str | None) -> None:
    answer = name_fault(text)
    assert answer is None if fault is None else answer and answer.startswith(fault)
