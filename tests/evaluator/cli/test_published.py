"""`tsttc published`: the paper's tables, without a server."""

import json

from evaluator.cli.published import FORMATS
from evaluator.tables.published import WRITERS
from tests.evaluator.worlds import Tsttc


def test_the_tables_are_listed(tsttc: Tsttc) -> None:
    lines = tsttc("published").stdout.splitlines()
    assert len(lines) == 1 + 12
    assert lines[2].split() == ["main-results", "Main", "results", "100"]
    assert len(json.loads(tsttc("published", "--json").stdout)) == 12


def test_a_table_is_printed_in_other_formats(tsttc: Tsttc) -> None:
    assert tuple(WRITERS) == FORMATS
    for name, start in (
        ("csv", '"split","method","mid"'),
        ("latex", "% Main results."),
        ("markdown", "| Split |"),
    ):
        assert tsttc("published", "main-results", "--format", name).stdout.startswith(start)
    document = json.loads(tsttc("published", "main-results", "--json").stdout)
    assert document["rows"][3]["values"][0] == 14.4


def test_an_unknown_table_and_a_format_without_a_table_are_refused(tsttc: Tsttc) -> None:
    result = tsttc("published", "nowhere")
    assert result.exit_code == 2
    assert "There is no table 'nowhere'; expected one of dataset-comparison, main-results," in " ".join(
        result.stderr.split()
    )
    result = tsttc("published", "--format", "latex")
    assert result.exit_code == 2
    assert "--format latex prints one table; name it" in " ".join(result.stderr.split())
