"""Tables for programs and spreadsheets."""

import csv
import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Final

# A spreadsheet takes a cell that begins like this for a formula and runs it; the wide forms as well.
_FORMULA_STARTS: Final = tuple("=+-@\t\r\n＝＋－＠")


def guarded(text: str) -> str:
    """A text that no spreadsheet takes for a formula: an apostrophe stands before what might be one.

    >>> guarded("=1+1"), guarded("Deep Scale")
    ("'=1+1", 'Deep Scale')
    """
    return f"'{text}" if text.lstrip(" ").startswith(_FORMULA_STARTS) else text


def csv_text(rows: Iterable[Mapping[str, object]], *, columns: Sequence[str]) -> str:
    """Rows as CSV with a header (RFC 4180). Texts are guarded, numbers stay, None is an empty cell."""
    return "".join(csv_lines(rows, columns=columns))


def csv_lines(rows: Iterable[Mapping[str, object]], *, columns: Sequence[str]) -> Iterator[str]:
    """The same, one row after the other, for tables that are too long to be held."""
    line = io.StringIO()
    writer = csv.DictWriter(line, fieldnames=columns)
    writer.writeheader()
    for row in rows:
        yield line.getvalue()
        line.seek(0)
        line.truncate()
        writer.writerow({name: guarded(v) if isinstance(v, str) else v for name, v in row.items()})
    yield line.getvalue()
