"""Tables of one's own as Parquet, for pandas and its like; needs pyarrow, `pip install '.[parquet]'`."""

from __future__ import annotations

import io
from collections.abc import Iterable, Mapping, Sequence


def parquet_of(rows: Iterable[Mapping[str, object]], *, columns: Sequence[str]) -> bytes:
    """Rows as a Parquet table with these columns; None where there is no value.

    Raises `ModuleNotFoundError` where pyarrow is not installed.
    """
    try:
        import pyarrow as pa  # noqa: PLC0415 -- of an extra
        from pyarrow import parquet  # noqa: PLC0415 -- of an extra
    except ImportError as error:
        raise ModuleNotFoundError(
            "Parquet tables need pyarrow, which is not installed: pip install pyarrow", name="pyarrow"
        ) from error
    held = list(rows)
    table = pa.table({name: pa.array([row.get(name) for row in held]) for name in columns})
    out = io.BytesIO()
    parquet.write_table(table, out)
    return out.getvalue()
