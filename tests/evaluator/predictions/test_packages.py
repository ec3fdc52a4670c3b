"""JSON in gzip and CSV tables: read as the JSON of the same predictions, within limits."""

import gzip
import zlib
from typing import Any

import numpy as np
import pytest

from evaluator import Problem, Rejected, convert, read_predictions, scale_ratio_to_ttc
from evaluator.predictions import headers, loading
from evaluator.predictions.loading import sha256_digest
from tests.evaluator.worlds import flat, make_truth

TRUTH = make_truth([1.0, 4.0, -10.0])
MANIFEST = TRUTH.manifest
GOOD = flat([1.5, -2.25, 30.0])


def table(*columns: str, end: str = "\n", rows: dict[str, list[str]] | None = None) -> bytes:
    names = {"ts": "ts_ns"}
    keys = {name: getattr(MANIFEST, names.get(name, name)) for name in (*headers.NATURAL_KEY, "anno_id")}
    values = {"ttc": ["1.5", "-2.25", "3e1"], "scale_ratio": ["0.9", "1.1", "1"], "frame_gap": [5, 5, 1]}
    cells: dict[str, Any] = keys | values | {"note": ["a", '"b,c"', ""]} | (rows or {})
    lines = [",".join(columns), *(",".join(str(cells[name][row]) for name in columns) for row in range(3))]
    return end.join([*lines, ""]).encode()


@pytest.mark.parametrize(
    "columns", [("anno_id", "ttc"), (*headers.NATURAL_KEY, "ttc"), ("note", "ttc", "anno_id")]
)
@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize("start", [b"", b"\xef\xbb\xbf"])
def test_a_table_means_what_its_json_means(columns: tuple[str, ...], end: str, start: bytes) -> None:
    predictions = read_predictions(start + table(*columns, end=end), manifest=MANIFEST)
    assert predictions.ttc_s.tolist() == [1.5, -2.25, 30.0]
    assert predictions.keys == ("natural_key" if "ts" in columns else "anno_id")


def test_a_table_of_scale_ratios_has_a_rate_for_each_row() -> None:
    predictions = read_predictions(table("anno_id", "scale_ratio", "frame_gap"), manifest=MANIFEST)
    expected = scale_ratio_to_ttc([0.9, 1.1, 1.0], fps_hz=[2.0, 2.0, 10.0])
    assert predictions.ttc_s.tolist() == expected.tolist()
    assert predictions.unit == "scale_ratio"


def test_gzip_is_unpacked_all_its_members_and_named_by_the_bytes_that_were_sent() -> None:
    for data in (gzip.compress(GOOD), gzip.compress(GOOD[:9]) + gzip.compress(GOOD[9:])):
        predictions = read_predictions(data, manifest=MANIFEST)
        assert predictions.ttc_s.tolist() == [1.5, -2.25, 30.0]
        assert predictions.digest == sha256_digest(data)
    assert convert(gzip.compress(GOOD)) == convert(GOOD)
    assert read_predictions(gzip.compress(table("anno_id", "ttc")), manifest=MANIFEST).ttc_s[0] == 1.5


@pytest.mark.parametrize(
    ("data", "code", "words", "where"),
    [
        (
            gzip.compress(GOOD, mtime=0)[:-9],
            "not-json",
            "not an intact gzip archive: it ends too early.",
            "",
        ),
        (b"\x1f\x8b\x08\x00", "not-json", "not an intact gzip archive", ""),
        (gzip.compress(GOOD, mtime=0) + b"more", "not-json", "incorrect header check", "byte 48"),
        (table("anno_id", "note"), "missing-columns", 'has the columns "anno_id,note"; expected', "line 1"),
        (table("anno_id", "scale_ratio"), "missing-columns", "scale_ratio with fps or frame_gap", "line 1"),
        (table("ttc", "note"), "missing-columns", "expected anno_id, or bag_stamp", "line 1"),
        (b"anno_id;ttc\n0;1\n", "bad-csv", "are separated by semicolons; expected commas.", "line 1"),
        (b"anno_id\tttc\n0\t1\n", "bad-csv", "are separated by tabs; expected commas.", "line 1"),
        (b"anno_id,ttc\n0,1,2\n", "bad-csv", "The row has 3 fields; expected 2, as the header.", "line 2"),
        (
            b'anno_id,ttc\n0,"1\n',
            "bad-csv",
            "This is not a CSV table: a quotation mark has no second one.",
            "line 2",
        ),
        (b"anno_id,ttc\n0,\xff\n", "not-utf8", "Byte 14 of the table is not UTF-8", "byte 14"),
    ],
)
def test_what_cannot_be_read_is_refused_in_words(data: bytes, code: str, words: str, where: str) -> None:
    with pytest.raises(Rejected) as caught:
        read_predictions(data, manifest=MANIFEST)
    [problem] = caught.value.problems
    assert (problem.code, problem.where) == (code, where)
    assert words in problem.message


def test_a_bomb_is_refused_before_it_is_unpacked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(loading, "MAX_UNPACKED_BYTES", 10_000)
    bomb = gzip.compress(b" " * 10_001)
    for data in (bomb, gzip.compress(b" " * 9_000) * 3):
        with pytest.raises(Rejected) as caught:
            read_predictions(data, manifest=MANIFEST)
        assert [problem.code for problem in caught.value.problems] == ["too-large"]
    assert len(zlib.decompress(gzip.compress(b" " * 10_000), wbits=31)) == 10_000
    with pytest.raises(Rejected) as caught:
        loading.json_of(b"anno_id,ttc\n" + b"0,1\n" * 6, max_rows=5)
    assert [problem.code for problem in caught.value.problems] == ["too-many-members"]


def refusal(data: bytes) -> Problem:
    with pytest.raises(Rejected) as caught:
        read_predictions(data, manifest=MANIFEST)
    [problem] = caught.value.problems
    return problem


def test_members_may_be_longer_than_what_is_read_at_once_and_have_zeros_between() -> None:
    long = np.random.default_rng(0).integers(32, 127, 300_000, dtype=np.uint8).tobytes()
    data = gzip.compress(long) + b"\x00" * 200_000 + gzip.compress(GOOD) + b"\x00" * 512
    assert loading.json_of(data) == long + GOOD
    assert refusal(gzip.compress(long)[:-1]).message.endswith("it ends too early. Copy or write it again.")


def test_an_archive_of_too_many_members_is_refused_with_the_byte_of_the_first_too_many() -> None:
    empty = gzip.compress(b"", mtime=0)
    good = gzip.compress(GOOD) + empty * (loading.MAX_GZIP_MEMBERS - 1)
    assert read_predictions(good, manifest=MANIFEST).ttc_s[0] == 1.5
    assert refusal(good + empty) == Problem(
        "too-many-members",
        "The gzip archive has more than 2,000 members; expected at most 2,000, as gzip, pigz and bgzip write "
        "them.",
        f"byte {len(good)}",
    )


def test_a_table_may_have_other_columns_but_not_any_number_of_them() -> None:
    wide = b"".join(b",c%d" % i for i in range(loading.MAX_COLUMNS - 2))
    rows = b"".join(b"%d,1.5%b\n" % (i, b"," * (len(wide.split(b",")) - 1)) for i in range(3))
    assert read_predictions(b"anno_id,ttc" + wide + b"\n" + rows, manifest=MANIFEST).ttc_s[0] == 1.5
    assert refusal(b"anno_id,ttc" + wide + b",more\n" + rows) == Problem(
        "too-many-members", "The line has up to 1,001 fields; expected at most 1,000.", "line 1"
    )
    assert refusal(b"anno_id,ttc\n0,1\n1," + b"," * 2000).where == "line 3"


def test_empty_lines_are_no_rows_but_not_any_number_of_them() -> None:
    spaced = table("anno_id", "ttc", end="\n\n")
    assert read_predictions(spaced, manifest=MANIFEST).ttc_s[0] == 1.5
    assert refusal(spaced + b"\n" * 200_000).code == "too-many-members"


def test_the_line_of_a_faulty_row_counts_empty_lines() -> None:
    data = b"\n\nanno_id,ttc\n\n0,1\n\n\n1,2,3\n"
    with pytest.raises(Rejected) as rejected:
        read_predictions(data, manifest=MANIFEST)
    assert rejected.value.problems[0].where == "line 8"
