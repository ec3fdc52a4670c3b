"""Files of other kinds are named, with what to do; so are tables with a wrong first line."""

import bz2
import gzip
import io
import lzma
import pickle
import tarfile
import zipfile
import zlib
from collections.abc import Mapping

import numpy as np
import pytest

from evaluator import Problem, Rejected
from evaluator.predictions.conversion import convert
from evaluator.predictions.loading import read_sent
from tests.evaluator.faulty_files import GOOD, MANIFEST
from tests.evaluator.worlds import flat

JSON = flat(GOOD)
TEXT = JSON.decode()
CSV = "anno_id,ttc\n0,5.31\n1,-12.9\n2,0.4\n3,100\n"


def first_problem(data: bytes) -> Problem:
    with pytest.raises(Rejected) as rejected:
        read_sent(data, manifest=MANIFEST)
    return rejected.value.problems[0]


def packed(*names: str) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        for name in names:
            archive.writestr(name, JSON)
    return file.getvalue()


def tar(mode: str = "w") -> bytes:
    file = io.BytesIO()
    with tarfile.open(fileobj=file, mode=mode) as archive:  # type: ignore[call-overload]  # any mode
        member = tarfile.TarInfo("predictions.json")
        member.size = len(JSON)
        archive.addfile(member, io.BytesIO(JSON))
    return file.getvalue()


def npy() -> bytes:
    file = io.BytesIO()
    np.save(file, np.array(list(GOOD.values())))
    return file.getvalue()


def npz() -> bytes:
    file = io.BytesIO()
    np.savez(file, ttc=np.array(list(GOOD.values())))
    return file.getvalue()


KINDS: Mapping[str, bytes] = {
    "a tar archive": tar(),
    "a ZIP archive": packed("predictions.json"),
    "an Excel workbook": packed("[Content_Types].xml", "xl/workbook.xml"),
    "a NumPy .npz file": npz(),
    "a PyTorch file": packed("archive/data.pkl"),
    "a NumPy .npy file": npy(),
    "an xz archive": lzma.compress(JSON),
    "a bzip2 archive": bz2.compress(JSON),
    "a Zstandard (zstd) archive": b"\x28\xb5\x2f\xfd\x24\x10" + JSON,
    "an LZ4 archive": b"\x04\x22\x4d\x18" + JSON,
    "a 7z archive": b"7z\xbc\xaf\x27\x1c\x00\x04",
    "a RAR archive": b"Rar!\x1a\x07\x01\x00",
    "a zlib stream": zlib.compress(JSON),
    "an HDF5 file": b"\x89HDF\r\n\x1a\n\x00",
    "a MATLAB file": b"MATLAB 5.0 MAT-file, Platform: GLNXA64",
    "a Feather (Arrow) table": b"ARROW1\x00\x00",
    "an SQLite database": b"SQLite format 3\x00",
    "a web page (HTML)": b"\n<!DOCTYPE html>\n<html>",
    "XML text": b'<?xml version="1.0"?><a/>',
    "a Git LFS pointer": b"version https://git-lfs.github.com/spec/v1\noid sha256:1\nsize 12\n",
    "a git-annex pointer": b"/annex/objects/SHA256E-s12--1\n",
    "an AppleDouble file of macOS": b"\x00\x05\x16\x07\x00\x02\x00\x00Mac OS X",
    "a .DS_Store file of macOS": b"\x00\x00\x00\x01Bud1\x00",
    "empty but for zero bytes": bytes(100),
}


@pytest.mark.parametrize("name", KINDS)
@pytest.mark.parametrize("is_packed", [False, True])
def test_a_file_of_another_kind_is_named(name: str, is_packed: bool) -> None:
    data = gzip.compress(KINDS[name]) if is_packed else KINDS[name]
    problem = first_problem(data)
    what = "The gzip archive contains" if is_packed else "The file is"
    assert problem.message.startswith(f"{what} {name}")
    assert "; expected JSON text or a CSV table, in UTF-8. " in problem.message
    assert problem.code in {"not-json", "not-utf8"}
    with pytest.raises(Rejected):
        convert(data)


def test_gzip_twice_is_named() -> None:
    message = first_problem(gzip.compress(gzip.compress(JSON))).message
    assert message.startswith("The gzip archive contains a gzip archive")
    assert message.endswith("Compress the file once.")


@pytest.mark.parametrize("protocol", range(6))
@pytest.mark.parametrize("content", [GOOD, list(GOOD.values()), np.array([1.5])])
def test_a_pickle_of_any_protocol_is_named(protocol: int, content: object) -> None:
    assert "is a Python pickle" in first_problem(pickle.dumps(content, protocol)).message


@pytest.mark.parametrize("text", [TEXT, CSV, "\n" + TEXT, "id,prediction\n0,1\n"])
@pytest.mark.parametrize("encoding", ["utf-16", "utf-32"])
@pytest.mark.parametrize("order", ["", "-le", "-be"])
def test_text_in_a_wide_encoding_is_named_with_and_without_its_mark(
    text: str, encoding: str, order: str
) -> None:
    problem = first_problem(text.encode(encoding + order))
    assert problem.message.startswith(f"The file is text in {encoding.upper()}; expected ")
    assert problem.code == "not-utf8"


def test_a_printed_dict_and_json_lines_are_named() -> None:
    assert "json.dump writes JSON" in first_problem(repr(GOOD).encode()).message
    assert "json.dump writes JSON" in first_problem(b"{0: 5.31, 1: 2}").message
    assert "as JSON Lines" in first_problem(b'{"anno_id": 0}\n{"anno_id": 1}\n').message


FIRST_LINES = {
    "Anno_ID,TTC": "in lower case: anno_id,ttc.",
    '"Anno_ID","TTC"': "in lower case: anno_id,ttc.",
    "ANNO_ID,ttc": "in lower case: anno_id,ttc.",
    "Bag_Stamp,Cam_ID,TS,Track_ID,TTC": "in lower case: bag_stamp,cam_id,ts,track_id,ttc.",
    "id,prediction": "with the header anno_id,ttc or",
    "sequence,value,extra": "with the header anno_id,ttc or",
    "0,5.31": "add the header as the first line.",
    "0007/1/5/3,-5.3e-1": "with the header anno_id,ttc or",
    "0.000e+00 5.310e+00": "add the header as the first line.",
    "sep=,": "Remove this line.",
    "SEP=;": "Remove this line.",
    "# my predictions": "Remove this line.",
    "% matlab": "Remove this line.",
    "# anno_id,ttc": 'Remove the "#"',
    "#anno_id;ttc": "separated by semicolons; expected commas.",
    ",0": 'index_label="anno_id"',
    ",ttc": 'index_label="anno_id"',
    "anno_id|ttc": "separated by vertical bars; expected commas.",
    "anno_id\tttc": "separated by tabs; expected commas.",
    "anno_id;ttc": "separated by semicolons; expected commas.",
    "anno_id ttc": "separated by spaces; expected commas.",
    "id|prediction": "separated by vertical bars",
    "id;prediction": "separated by semicolons",
    "ttc": "with the header anno_id,ttc or",
    "Traceback (most recent call last):": "with the header anno_id,ttc or",
}


@pytest.mark.parametrize("line", FIRST_LINES)
@pytest.mark.parametrize("mark", ["", "\ufeff"])
def test_a_wrong_first_line_of_a_table_is_answered_with_the_expected_header(line: str, mark: str) -> None:
    problem = first_problem(f"{mark}{line}\n0,5.31\n1,-12.9\n".encode())
    assert FIRST_LINES[line] in problem.message
    assert "anno_id" in problem.message or "commas" in problem.message
    assert problem.where == "line 1"


def test_a_long_table_without_a_known_header_is_named_as_one() -> None:
    data = b"id,a,b,c\n" + b"0,1,2,3\n" * 40_000
    assert first_problem(data).code == "missing-columns"


TOO_MANY = {
    "anno_id,ttc,fps": ("bad-rate", 'remove "fps"'),
    "anno_id,ttc_s,frame_gap": ("bad-rate", 'remove "frame_gap"'),
    "anno_id,scale_ratio,ttc,fps": ("bad-field", 'For seconds, remove "scale_ratio" and "fps".'),
    "anno_id,scale_ratio,ttc_s": ("bad-field", 'For scale ratios, remove "ttc_s"'),
    "anno_id,ttc,ttc_s": ("bad-field", 'remove "ttc" or "ttc_s"'),
    "anno_id,scale_ratio,fps,frame_gap": ("bad-rate", "Remove one of them."),
}


@pytest.mark.parametrize("header", TOO_MANY)
def test_a_column_too_many_is_named_for_removal(header: str) -> None:
    code, words = TOO_MANY[header]
    n_fields = header.count(",") + 1
    problem = first_problem(f"{header}\n{','.join(['1'] * n_fields)}\n".encode())
    assert problem.code == code
    assert words in problem.message
