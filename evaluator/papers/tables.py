"""All tables of the paper of 2023, as printed.

    table = published_tables().table("ablation-frame-gap")
    table.value(method="pixel-mse", setting=5, column="mid")  # 41.0

The notes of a table name contradictions of the paper.
"""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from typing import Any

import msgspec

Setting = bool | int | float | str | None


class PublishedRow(msgspec.Struct, frozen=True):
    """A row: `values` by column of a `method`, and in an ablation of a `setting`."""

    key: str | int | float
    values: tuple[Any, ...]
    method: str | None = None
    split: str | None = None
    setting: Setting = None
    is_default: bool = False
    printed_as: str | None = None
    printed: tuple[str, ...] | None = None  # the paper's spelling of `values`, where numbers differ from it


class PublishedTable(msgspec.Struct, frozen=True):
    """A table: `units` by column, the paper's `section` and `caption`, an ablation's `parameter`."""

    name: str
    section: str
    caption: str
    columns: tuple[str, ...]
    units: dict[str, str]
    rows: tuple[PublishedRow, ...]
    is_result: bool  # of measured numbers
    parameter: str | None = None
    notes: tuple[str, ...] = ()

    def value(self, *, method: str, setting: Setting, column: str, split: str = "val") -> float | None:
        """Return a method's number at a setting, None if absent; raises `KeyError` for an unknown column."""
        if column not in self.columns:
            raise KeyError(column)
        for row in self.rows:
            if (row.method, row.setting, row.split) == (method, setting, split):
                return float(row.values[self.columns.index(column)])
        return None


class PublishedTables(msgspec.Struct, frozen=True):
    """The tables of a paper: `source`, `metrics` with units, printed names of `methods`."""

    source: dict[str, Any]
    metrics: dict[str, str]
    methods: dict[str, str]
    tables: tuple[PublishedTable, ...]

    def table(self, name: str) -> PublishedTable:
        """Return the table with this name; raises `KeyError`."""
        return {table.name: table for table in self.tables}[name]


@cache
def published_tables() -> PublishedTables:
    """Load "TSTTC: A Large-Scale Dataset for Time-to-Contact Estimation in Driving Scenarios"."""
    data = files(__package__).joinpath("tables-2023.json").read_bytes()
    return msgspec.json.decode(data, type=PublishedTables)
