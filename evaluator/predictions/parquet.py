"""Predictions in a Parquet table, converted to JSON on the participant's machine (ADR 7). Needs pyarrow."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from typing import Any, Final

from evaluator.predictions.headers import columns_of
from evaluator.problems import quoted, reject

_MAGIC: Final = b"PAR1"


def as_sent(data: bytes) -> bytes:
    """Convert a Parquet table to JSON, always the same bytes; other files stay.

    Raises `Rejected` for a damaged table or other columns, `ModuleNotFoundError` without pyarrow.
    """
    if not data.startswith(_MAGIC):
        return data
    if find_spec("pyarrow") is None:
        raise ModuleNotFoundError(
            "Parquet tables need pyarrow, which is not installed: pip install pyarrow", name="pyarrow"
        )
    import pyarrow as pa  # noqa: PLC0415 -- of an extra
    from pyarrow import parquet  # noqa: PLC0415 -- the same

    from evaluator.predictions.loading import document_of  # noqa: PLC0415 -- which asks this module

    try:
        # In this thread alone: one of Arrow's own for reading ahead can abort the process when it ends.
        with parquet.ParquetFile(io.BytesIO(data), pre_buffer=False) as file:
            keys, values = _columns(file.schema_arrow)
            table = file.read(columns=keys + values, use_threads=False)
        return document_of(keys + values, _rows(table, keys, values))
    except (pa.ArrowException, OSError, ValueError, OverflowError, KeyError) as error:
        reason = (str(error).splitlines() or ["it ends early"])[0].removesuffix(".")
        raise reject("unreadable", f"The file is not an intact Parquet table: {quoted(reason)}.") from None


def _columns(schema: Any) -> tuple[list[str], list[str]]:
    keys, value, rate = columns_of(schema.names)
    values = [value] if rate is None else [value, rate]
    for name in (*keys, *values):
        column_type = schema.field(name).type
        if not _is_fitting(column_type, is_key=name in keys):
            expected = "integers or text" if name in keys else "integers or floats"
            message = (
                f"The column {quoted(name)} has the type {quoted(str(column_type))}; expected {expected}."
            )
            raise reject("bad-field", message, f"column {name}")
    return list(keys), values


def _is_fitting(column_type: Any, *, is_key: bool) -> bool:
    from pyarrow import types  # noqa: PLC0415 -- of an extra

    if types.is_dictionary(column_type):
        column_type = column_type.value_type
    is_text = (
        types.is_string(column_type)
        or types.is_large_string(column_type)
        or types.is_string_view(column_type)
    )
    if is_text or types.is_floating(column_type):
        return bool(is_text == is_key)
    return bool(types.is_integer(column_type) or types.is_null(column_type))


def _rows(table: Any, keys: list[str], values: list[str]) -> Iterator[Sequence[str | None]]:
    number = 0
    for batch in table.to_batches():
        columns = [map(_text, batch.column(name).to_pylist()) for name in keys + values]
        for row in zip(*columns, strict=True):
            number += 1
            # A missing value is left to the reader of the JSON.
            if None in row[: len(keys)]:
                message = f"The row has no {keys[row.index(None)]}; expected one in every row."
                raise reject("bad-field", message, f"row {number}")
            yield row


def _text(value: object) -> str | None:
    return value if value is None or isinstance(value, str) else repr(value)
