"""What a file is that people send by mistake, by its first bytes, and what to do with it."""

from __future__ import annotations

import re
from typing import Final, NamedTuple

from evaluator.problems import reject

_SEND: Final = "Unpack it and send the JSON or CSV file in it, or compress that file with gzip."
_JSON: Final = "Write the values as JSON: evaluator.write_predictions makes the file."
_UTF8: Final = "Save it as UTF-8; in PowerShell, Out-File -Encoding utf8 does this."
_AGAIN: Final = "Download the file itself, not the page that shows it."
_HIDDEN: Final = "Such files are hidden and hold no predictions; send the file without “._” before its name."


class Kind(NamedTuple):
    name: str
    advice: str


_BY_START: Final[dict[bytes, Kind]] = {
    b"\x1f\x8b": Kind("a gzip archive", "Compress the file once."),
    b"\xfd7zXZ\x00": Kind("an xz archive", _SEND),
    b"]\x00\x00": Kind("an LZMA archive", _SEND),
    b"BZh": Kind("a bzip2 archive", _SEND),
    b"\x28\xb5\x2f\xfd": Kind("a Zstandard (zstd) archive", _SEND),
    b"\x04\x22\x4d\x18": Kind("an LZ4 archive", _SEND),
    b"\x1f\x9d": Kind("a compress (.Z) archive", _SEND),
    b"LZIP": Kind("an lzip archive", _SEND),
    b"7z\xbc\xaf\x27\x1c": Kind("a 7z archive", _SEND),
    b"Rar!\x1a\x07": Kind("a RAR archive", _SEND),
    b"PK\x05\x06": Kind("an empty ZIP archive", _SEND),
    b"\x93NUMPY": Kind("a NumPy .npy file", _JSON),
    b"\x89HDF\r\n\x1a\n": Kind("an HDF5 file", _JSON),
    b"MATLAB 5.0 MAT-file": Kind("a MATLAB file", _JSON),
    b"ARROW1": Kind("a Feather (Arrow) table", _JSON),
    b"FEA1": Kind("a Feather table", _JSON),
    b"ORC": Kind("an ORC table", _JSON),
    b"Obj\x01": Kind("an Avro file", _JSON),
    b"SQLite format 3\x00": Kind("an SQLite database", _JSON),
    b"PARE": Kind("an encrypted Parquet table", _JSON),
    b"PAR1": Kind("a Parquet table", "tsttc submit sends one, and tsttc convert makes JSON of it."),
    b"\xd0\xcf\x11\xe0": Kind("an old Excel or Word document", "Save the sheet as CSV, UTF-8."),
    b"\x89PNG": Kind("a PNG image", "Send the file with the predictions."),
    b"\xff\xd8\xff": Kind("a JPEG image", "Send the file with the predictions."),
    b"GIF8": Kind("a GIF image", "Send the file with the predictions."),
    b"%PDF": Kind("a PDF document", "Send the file with the predictions."),
    b"MZ": Kind("a program of Windows", "Send the file with the predictions."),
    b"\x00asm": Kind("a program (WebAssembly)", "Send the file with the predictions."),
    b"\x7fELF": Kind("a program", "Send the file with the predictions."),
    b"\x00\x05\x16\x07": Kind("an AppleDouble file of macOS", _HIDDEN),
    b"\x00\x00\x00\x01Bud1": Kind("a .DS_Store file of macOS", "Send the file with the predictions."),
    b"version https://git-lfs.github.com/spec/": Kind(
        "a Git LFS pointer, not the file itself", "Get the file with: git lfs pull"
    ),
    b"/annex/objects/": Kind("a git-annex pointer, not the file itself", "Get the file with: git annex get"),
}

# In a .zip file, the name of the first member stands behind its head of thirty bytes.
_ZIP: Final = b"PK\x03\x04"
_OF_ZIP: Final[dict[bytes, Kind]] = {
    b".npy": Kind("a NumPy .npz file", _JSON),
    b"/data.pkl": Kind("a PyTorch file", _JSON),
    b"[Content_Types].xml": Kind(
        "an Excel workbook or another Office document", "Save the sheet as CSV, UTF-8."
    ),
    b"xl/": Kind("an Excel workbook", "Save the sheet as CSV, UTF-8."),
    b"mimetype": Kind("an OpenDocument sheet or text", "Save the sheet as CSV, UTF-8."),
}

_TAR_MARK: Final = slice(257, 262)
_TAR: Final = Kind("a tar archive", _SEND)
_BY_PATTERN: Final[dict[re.Pattern[bytes], Kind]] = {
    re.compile(rb"\x00+\Z"): Kind(
        "empty but for zero bytes, as an interrupted copy leaves it", "Copy or write it again."
    ),
    re.compile(
        rb"\xff\xfe\x00\x00|\x00\x00\xfe\xff|(?:[^\x00]\x00\x00\x00){2}|(?:\x00\x00\x00[^\x00]){2}"
    ): Kind("text in UTF-32", _UTF8),
    re.compile(rb"\xff\xfe|\xfe\xff|[^\x00]\x00[^\x00]\x00|\x00[^\x00]\x00[^\x00]"): Kind(
        "text in UTF-16", _UTF8
    ),
    re.compile(rb"\x80[\x02-\x05]|\((?:[dlt]p[0-9]+\n|[FIV])|[\]})]q\x00|c[a-z_.]+\n[a-zA-Z_]+\n"): Kind(
        "a Python pickle", _JSON
    ),
    re.compile(rb"[\s\S]{2}[\s\S]\x00{5}\{"): Kind("a safetensors file", _JSON),
    re.compile(rb"x[\x01\x5e\x9c\xda]"): Kind("a zlib stream", _SEND),
    re.compile(rb"(?i)(?:\xef\xbb\xbf)?\s*<(?:!doctype\s+html|html|head|body|script)\b"): Kind(
        "a web page (HTML)", _AGAIN
    ),
    re.compile(rb"(?:\xef\xbb\xbf)?\s*<(?:\?xml|[A-Za-z!])"): Kind("XML text", _JSON),
    # The last one: bytes of all kinds that no text begins with.
    re.compile(rb"(?!\s*[\[{])[\s\S]{0,7}[\x00-\x08\x0e-\x1f]"): Kind("binary data, not text", _JSON),
}
_PYTHON: Final = re.compile(r"\s*\{\s*(?:'|-?[0-9]|np\.|\()")


def kind_of_file(data: bytes) -> Kind | None:
    """Recognise a file that is neither JSON text nor a CSV table in UTF-8; None for all others."""
    if data.startswith(_ZIP):
        return _kind_of_zip(data)
    if data[_TAR_MARK] == b"ustar":
        return _TAR
    by_start = (kind for start, kind in _BY_START.items() if data.startswith(start))
    by_pattern = (kind for pattern, kind in _BY_PATTERN.items() if pattern.match(data))
    return next(by_start, None) or next(by_pattern, None)


def _kind_of_zip(data: bytes) -> Kind:
    n_bytes = int.from_bytes(data[26:28], "little")
    name = data[30 : 30 + n_bytes]
    for part, kind in _OF_ZIP.items():
        if name.startswith(part) or name.endswith(part):
            return kind
    return Kind("a ZIP archive", _SEND)


def is_printed_dict(text: str) -> bool:
    """Say whether a text that is no JSON begins as Python prints a dict."""
    return _PYTHON.match(text) is not None


def require_no_other_kind(data: bytes, *, is_unpacked: bool) -> None:
    """Raise `Rejected` for a file of another kind; `is_unpacked` for the content of a gzip archive."""
    kind = kind_of_file(data)
    if kind is None:
        return
    what = "The gzip archive contains" if is_unpacked else "The file is"
    message = f"{what} {kind.name}; expected JSON text or a CSV table, in UTF-8. {kind.advice}"
    raise reject("not-json" if _is_utf8(data) else "not-utf8", message)


def _is_utf8(data: bytes) -> bool:
    try:
        return "\x00" not in data.decode("utf-8")
    except UnicodeDecodeError:
        return False
