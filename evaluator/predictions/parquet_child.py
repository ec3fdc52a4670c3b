"""The child process in which Parquet tables are read: `python -m evaluator.predictions.parquet_child`.

It reads a table from its standard input and writes one line, `good` or `rejected`, and behind it the JSON of
the same predictions, or that of the problems. Some damaged tables make pyarrow end its process, and small
ones can unpack to all memory: so it is not the process that asks, and on Linux it has limits and may open
nothing.
"""

from __future__ import annotations

import io
import json
import mmap
import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import pyarrow as pa
from pyarrow import parquet, types

from evaluator.predictions.parquet import EXIT_OUT_OF_MEMORY
from evaluator.predictions.predictions import MAX_UNPACKED_BYTES, columns_of, document_of
from evaluator.problems import Rejected, quoted, reject

GOOD: Final = b"good\n"
REJECTED: Final = b"rejected\n"
MAX_ROWS: Final = 1_000_000
"""Rows of a table, far above what the largest split needs."""
MEMORY_BYTES: Final = 2 * 1024**3
"""What reading may take beside what Python and pyarrow have taken before."""
CPU_S: Final = 60

# What pyarrow raises for a table that is damaged, depending on where.
_FAULTS: Final = (pa.ArrowException, OSError, ValueError, OverflowError, KeyError)


def json_of(data: bytes) -> bytes:
    """The JSON of a table's predictions; raises `Rejected` for a table that is at fault."""
    try:
        table = parquet.ParquetFile(io.BytesIO(data))
        keys, values = _columns(table.schema_arrow)
        _require_size(table.metadata, keys + values)
        return document_of(keys + values, _rows(table, keys, values))
    except MemoryError:
        raise
    except _FAULTS as error:
        said = (str(error).splitlines() or ["it ends early"])[0].removesuffix(".")
        raise reject("unreadable", f"The file is not an intact Parquet table: {quoted(said)}.") from None


def _columns(schema: Any) -> tuple[list[str], list[str]]:
    """The columns of the key and those of the numbers, each of a type that can be what its name says."""
    keys, value, rate = columns_of(schema.names)
    values = [value] if rate is None else [value, rate]
    for name in (*keys, *values):
        n_columns = schema.names.count(name)
        if n_columns > 1:
            message = f"The table has {n_columns} columns {quoted(name)}; expected one."
            raise reject("bad-field", message, f"column {name}")
        found = schema.field(name).type
        if not _is_fitting(found, is_key=name in keys):
            expected = "integers or text" if name in keys else "integers or floats"
            message = f"The column {quoted(name)} has the type {quoted(str(found))}; expected {expected}."
            raise reject("bad-field", message, f"column {name}")
    return list(keys), values


def _is_fitting(found: Any, *, is_key: bool) -> bool:
    if types.is_dictionary(found):
        found = found.value_type
    if is_key and (types.is_string(found) or types.is_large_string(found) or types.is_string_view(found)):
        return True
    return types.is_integer(found) or types.is_null(found) or (types.is_floating(found) and not is_key)


def _require_size(metadata: Any, names: Sequence[str]) -> None:
    """Raise `Rejected` for what says itself that it is too large, before anything is unpacked."""
    if metadata.num_rows > MAX_ROWS:
        message = f"The table has {metadata.num_rows:,} rows; expected at most {MAX_ROWS:,}."
        raise reject("too-many-members", message)
    groups = map(metadata.row_group, range(metadata.num_row_groups))
    columns = (group.column(i) for group in groups for i in range(group.num_columns))
    n_bytes = sum(one.total_uncompressed_size for one in columns if one.path_in_schema in names)
    if n_bytes > MAX_UNPACKED_BYTES:
        message = f"The table unpacks to {n_bytes:,} bytes; expected at most {MAX_UNPACKED_BYTES:,}."
        raise reject("too-large", message)


def _rows(table: Any, keys: list[str], values: list[str]) -> Iterator[Sequence[str | None]]:
    """The fields as text, of numbers the shortest that means the same; None where a value is missing."""
    number = 0
    for batch in table.iter_batches(columns=keys + values, use_threads=False):
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


def _give_up_rights() -> None:
    """Take the limits of a reader of foreign bytes, once all is loaded: nothing can be opened afterwards."""
    from evaluator.limits import limit, obey_the_parent_alone  # noqa: PLC0415 -- nothing of it is on Windows

    obey_the_parent_alone()
    sample = io.BytesIO()
    parquet.write_table(pa.table({"anno_id": ["0"], "ttc": [1.0]}), sample)
    for data in (sample.getvalue(), b"PAR1"):
        try:
            json_of(data)
        except Rejected as rejected:
            json.dumps(rejected.as_dict())
    n_pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    limit(memory_bytes=n_pages * mmap.PAGESIZE + MEMORY_BYTES, cpu_s=CPU_S)


def main() -> None:
    """Read standard input, answer, end."""
    if sys.platform == "linux":
        _give_up_rights()
    try:
        answer = GOOD + json_of(sys.stdin.buffer.read())
    except Rejected as rejected:
        answer = REJECTED + json.dumps(rejected.as_dict()).encode()
    except MemoryError:
        sys.exit(EXIT_OUT_OF_MEMORY)
    sys.stdout.buffer.write(answer)
    sys.stdout.buffer.flush()
    # Without its farewells: pyarrow's threads may end this process by a signal when it takes its time.
    os._exit(0)


if __name__ == "__main__":
    main()
