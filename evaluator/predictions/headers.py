"""The header of a table of predictions: which columns are read, and what is wrong with a first line."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

from evaluator.predictions import slips
from evaluator.problems import Rejected, quoted, reject
from evaluator.truth.csv_tables import require_one_column

NATURAL_KEY: Final = ("bag_stamp", "cam_id", "ts", "track_id")
VALUES: Final = {"ttc": "ttc", "ttc_s": "ttc", "scale_ratio": "scale_ratio"}
RATES: Final = ("fps", "frame_gap")
PREDICTED: Final = "predicted_ttc_s"
"""In the table of `tsttc score --per-sequence`, beside the true times."""

NAMES: Final = frozenset({"anno_id", *NATURAL_KEY, *VALUES, *RATES})
EXPECTED: Final = (
    "expected anno_id, or bag_stamp, cam_id, ts and track_id, and either ttc (seconds) or scale_ratio with "
    "fps or frame_gap"
)
_SHORT: Final = (
    'expected JSON text, {"KEY": NUMBER, …}, or a CSV table with the header anno_id,ttc or '
    "bag_stamp,cam_id,ts,track_id,ttc"
)
_SEPARATORS: Final = {";": "semicolons", "\t": "tabs", "|": "vertical bars", " ": "spaces"}
_NUMBER: Final = re.compile(r"[+-]?[0-9.]+(?:[eE][+-]?[0-9]+)?|[+-]?(?:nan|inf)", re.IGNORECASE)
_FIRST_LINE: Final = re.compile(rb"\s*([^\r\n]{0,2000})")


def first_line(data: bytes) -> str:
    """Return the first line with text, of 2,000 bytes at most."""
    match = _FIRST_LINE.match(data.removeprefix(b"\xef\xbb\xbf"))
    return match[1].decode("utf-8", "replace") if match else ""


def is_header(line: str, *, separator: str = ",") -> bool:
    """Say whether a line names columns of a table; no JSON text begins so."""
    fields = _fields(line, separator)
    return len(fields) > 1 and not line.startswith(("{", "[")) and not NAMES.isdisjoint(fields)


def require_commas(line: str) -> None:
    """Raise `Rejected` for a header with known names between other separators than commas."""
    for separator, name in _SEPARATORS.items():
        if is_header(line, separator=separator) and not is_header(line):
            raise reject(
                "bad-csv", f"The fields of the table are separated by {name}; expected commas.", "line 1"
            )


def columns_of(header: Sequence[str]) -> tuple[Sequence[str], str, str | None]:
    """Return key columns, value column and rate column of a table; raises `Rejected` for others."""
    keys = NATURAL_KEY if set(NATURAL_KEY) <= set(header) else ("anno_id",)
    values = [name for name in VALUES if name in header]
    rates = [name for name in RATES if name in header]
    if not set(keys) <= set(header) or not values or (values == ["scale_ratio"] and not rates):
        message = f"The table has the columns {quoted(','.join(header))}; {EXPECTED}.{_slip(header)}"
        raise reject("missing-columns", message, "line 1")
    require_one_column(header, (*keys, *values, *rates), where="line 1")
    _require_one_meaning(values, rates)
    _require_no_other_predictions(header, values[0])
    return keys, values[0], rates[0] if rates else None


def _require_no_other_predictions(header: Sequence[str], value: str) -> None:
    """Refuse a table that has true times next to its predictions: nobody can tell which of them are meant."""
    others = slips.predicted_among([name for name in header if name not in NAMES])
    if not others:
        return
    whose = ", as tsttc score --per-sequence writes them" if others == [PREDICTED] else ""
    own, other, name = quoted(value), quoted(others[0]), "ttc" if value == "ttc_s" else value
    message = (
        f"The table has the columns {own} and {other}{whose}; expected one column of predictions. If {other} "
        f"has them, remove {own} and rename {other} to {name}. If {own} has them, remove {other}."
    )
    raise reject("bad-field", message, "line 1")


def _require_one_meaning(values: Sequence[str], rates: Sequence[str]) -> None:
    if len(values) > 1:
        fault = f"The table has {len(values)} columns of values, {' and '.join(map(quoted, values))}"
        ratios = [*(["scale_ratio"] if "scale_ratio" in values else []), *rates]
        seconds = [name for name in values if name != "scale_ratio"]
        if ratios and len(seconds) == 1:
            choice = (
                f"For seconds, remove {' and '.join(map(quoted, ratios))}. "
                f"For scale ratios, remove {quoted(seconds[0])}{'' if rates else ' and add fps'}."
            )
        else:
            choice = f"Keep the column that you mean, and remove {' or '.join(map(quoted, values))}."
        raise reject("bad-field", f"{fault}; expected one. {choice}", "line 1")
    if len(rates) > 1:
        message = 'The table has the columns "fps" and "frame_gap"; expected one. Remove one of them.'
        raise reject("bad-rate", message, "line 1")
    if rates and values != ["scale_ratio"]:
        message = (
            f"The table has the columns {quoted(values[0])} and {quoted(rates[0])}, but seconds have no "
            f"rate. If the values are seconds, remove {quoted(rates[0])}. If they are scale ratios, rename "
            f"{quoted(values[0])} to scale_ratio."
        )
        raise reject("bad-rate", message, "line 1")


def slip_of_row(row: Sequence[str], header: Sequence[str]) -> str:
    """Name what is probably wrong with a row of another length; starts with a space unless empty."""
    if row[0].startswith(("#", "//", "%")):
        return " Remove comments."
    if len(row) == len(header) + 1 and not row[-1].strip():
        return " Remove the comma at the end of the rows, or add one to the header."
    if len(row) > len(header) and all(map(_NUMBER.fullmatch, row[1:])):
        return " Write numbers with a point, not with a comma: 5.31."
    return ""


def refusal_of_text(line: str) -> Rejected | None:
    """Make the rejection of a text that is no JSON, by its first line; None where it begins as JSON does."""
    if not line or line.startswith(("{", "[")):
        return None
    if line.lower().startswith("sep=") or line.startswith(("#", "//", "%")):
        message = f"Line 1 is {quoted(line)}; expected the header of the table, such as anno_id,ttc."
        return reject("bad-csv", f"{message} {_of_comment(line)}", "line 1")
    separator = "," if "," in line else next((each for each in _SEPARATORS if each in line), "")
    fields = _fields(line, separator) if separator else [line]
    # Words of a sentence are no columns.
    if not separator or (separator == " " and not _are_numbers(fields)):
        return reject("not-json", f"The file begins with {quoted(line)}; {_SHORT}.", "line 1")
    message = f"The first line is {quoted(line)}; {_SHORT}.{_slip(fields)}"
    if separator != ",":
        message += f" The fields are separated by {_SEPARATORS[separator]}; a CSV table has commas."
    return reject("missing-columns", message, "line 1")


def _of_comment(line: str) -> str:
    if is_header(line.lstrip("#/% \t")):
        return "Remove the characters before the name of the first column."
    return "Remove this line."


def _fields(line: str, separator: str) -> list[str]:
    return [field.strip().strip('"') for field in line.split(separator)]


def _are_numbers(fields: Sequence[str]) -> bool:
    return bool(fields[0]) and all(map(_NUMBER.fullmatch, filter(None, fields)))


def _slip(header: Sequence[str]) -> str:
    """Name what is probably wrong with names of columns; starts with a space unless empty."""
    lower = [name.lower() for name in header]
    if _are_numbers(header):
        return " The first line has numbers, no names: add the header as the first line."
    if header[0].startswith("#") and header[0].lstrip("# ") in NAMES:
        return ' Remove the "#" before the name of the first column.'
    if any(name not in NAMES and name.strip().lower() in NAMES for name in header):
        return f" Names of columns are in lower case: {','.join(lower)}."
    if not header[0] and len(header) == 2:
        return (
            " The first column has no name: pandas writes such a file. "
            'Write it with series.to_csv(FILE, index_label="anno_id", header=["ttc"]).'
        )
    return _slip_of_names(header)


def _slip_of_names(header: Sequence[str]) -> str:
    if not all(name.isprintable() for name in header):
        return " Names of columns contain invisible characters: remove them."
    if len(header) == 1 and "," in header[0]:
        return " Whole lines are in quotation marks: remove these."
    return _slip_of_kinds(header)


def _slip_of_kinds(header: Sequence[str]) -> str:
    has_keys = "anno_id" in header or set(NATURAL_KEY) <= set(header)
    has_values = not set(VALUES).isdisjoint(header)
    if renamed := slips.renaming(header, has_keys=has_keys, has_values=has_values):
        return f" Rename {renamed}."
    if has_values and not has_keys:
        return " No column names the sequences; pandas writes an index with frame.reset_index()."
    if has_keys and not has_values:
        return " No column has the predictions."
    if "scale_ratio" in header and set(RATES).isdisjoint(header):
        return " Scale ratios need the column fps or frame_gap."
    return ""
