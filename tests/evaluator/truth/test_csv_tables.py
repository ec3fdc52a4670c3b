"""Tables are read by columns where nothing is unusual: the same table as row by row."""

import csv
import io

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evaluator.truth import csv_tables
from tests.evaluator.truth.test_truth import HEADER, ROWS

FIELDS = st.sampled_from(
    ["0", "007", " 5 ", "1e3", "-.5", "a", "a b", "", " ", "x/y", '"q"', "1_0", "٥", "nan"]
)


@pytest.mark.slow
@settings(max_examples=300)
@given(
    rows=st.lists(st.lists(FIELDS, min_size=5, max_size=7), max_size=3),
    plain=st.integers(0, 2),
    end=st.sampled_from(["\n", "\r\n", "\r", "\n\n"]),
)
def test_columns_and_rows_read_the_same_table(rows: list[list[str]], plain: int, end: str) -> None:
    lines = [HEADER, *ROWS[:plain], *(",".join(row) for row in rows)]
    text = end.join(lines) + end
    quick = csv_tables._read_columns(text, csv_tables.COLUMNS)
    if quick is not None:
        careful = csv.reader(io.StringIO(text, newline=""), strict=True)
        assert quick == csv_tables._read_rows(careful, csv_tables.COLUMNS)
    assert quick is not None or rows or not plain or end not in ("\n", "\r\n")
