"""The formats in which a board is exported: the site and `tsttc board` offer what `FORMATS` has."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from evaluator.tables.escaping import csv_line
from evaluator.tables.layouts import Export, as_latex, as_markdown


@dataclass(frozen=True, slots=True, kw_only=True)
class Format:
    name: str
    """What the command calls it."""
    title: str
    """What a page calls it."""
    suffix: str
    """The end of its address and of its file."""
    media_type: str
    write: Callable[[Export], str] | None
    """None where it is the API's own document, with the rows of the team that asks."""
    has_values: bool = True
    """Whether it can have confidence intervals."""
    is_pasted: bool = False
    """Whether people paste it into a text of theirs: then a page offers to copy it as well."""


def csv_lines(rows: Iterable[Mapping[str, object]], *, columns: Sequence[str]) -> Iterator[str]:
    """Write rows as CSV with a header (RFC 4180): texts guarded and quoted, None empty."""
    yield ",".join(columns) + "\r\n"
    for row in rows:
        yield csv_line(row.get(name) for name in columns)


def as_csv(export: Export) -> str:
    return "".join(csv_lines(export.records, columns=export.columns))


FORMATS: Final = (
    Format(name="csv", title="CSV", suffix="csv", media_type="text/csv", write=as_csv),
    Format(name="json", title="JSON", suffix="json", media_type="application/json", write=None),
    Format(
        name="latex",
        title="LaTeX",
        suffix="tex",
        media_type="application/x-tex",
        write=as_latex,
        is_pasted=True,
    ),
    Format(
        name="markdown",
        title="Markdown",
        suffix="md",
        media_type="text/markdown",
        write=as_markdown,
        is_pasted=True,
    ),
    Format(
        name="bibtex",
        title="BibTeX",
        suffix="bib",
        media_type="application/x-bibtex",
        write=lambda export: "\n".join(export.references),
        has_values=False,
        is_pasted=True,
    ),
    Format(
        name="hf-eval",
        title="Hugging Face",
        suffix="yaml",
        media_type="application/yaml",
        write=lambda export: "\n".join([*export.eval_results, ""]),
        has_values=False,
        is_pasted=True,
    ),
)
"""In the order in which they are offered."""


def parquet_of(rows: Iterable[Mapping[str, object]], *, columns: Sequence[str]) -> bytes:
    """Write rows as a Parquet table. Raises `ModuleNotFoundError` without pyarrow."""
    try:
        import pyarrow as pa  # noqa: PLC0415 -- of an extra
        from pyarrow import parquet  # noqa: PLC0415 -- of an extra
    except ImportError as error:
        raise ModuleNotFoundError(
            "Parquet tables need pyarrow, which is not installed: pip install pyarrow", name="pyarrow"
        ) from error
    row_list = list(rows)
    table = pa.table({name: pa.array([row.get(name) for row in row_list]) for name in columns})
    out = io.BytesIO()
    parquet.write_table(table, out)
    return out.getvalue()
