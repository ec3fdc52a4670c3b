"""The figures in the documentation are those of the report, which `make bench` writes."""

import subprocess
import sys
from datetime import UTC, datetime

import pytest

from benchmarks import __main__ as bench
from benchmarks import _report


def test_every_figure_in_the_documents_stands_in_the_report() -> None:
    measured = _report.figures_in(_report.REPORT.read_text())
    quoted = {path.name: _report.figures_in(path.read_text()) for path in _report.documents()}
    assert quoted, "some document quotes figures"
    for name, figures in quoted.items():
        expected = {figure: measured.get(figure, _report.NOT_MEASURED) for figure in figures}
        assert figures == expected, f"{name}: make bench writes it, or _report.renew()"


def test_a_report_is_read_as_it_was_written() -> None:
    measured = bench.Measured("board", datetime(2026, 11, 22, tzinfo=UTC), 0.5, took_s=3)
    for line in ("board_json = 838 requests/s", "board.200.page_p99 = 12.5 ms", "wrk is not installed", ""):
        measured.hear(line)
    text = _report.text([measured.text()])
    assert _report.figures_in(text) == {"board_json": "838 requests/s", "board.200.page_p99": "12.5 ms"}
    assert "- wrk is not installed" in text
    head = "| | figure | measured |\n|---|---|---|\n"
    row = "| answers | `board_json` | 1 request/s |\n| gone | `board_xml` | 2 |\n"
    assert _report.renewed(row, _report.figures_in(text)) == row, "not a table of figures"
    assert _report.renewed(head + row, _report.figures_in(text)) == head + (
        "| answers | `board_json` | 838 requests/s |\n| gone | `board_xml` | not measured |\n"
    )


def test_all_benchmarks_together_take_fourteen_minutes_at_most() -> None:
    assert set(bench.LIMITS_S) <= {path.stem for path in bench.FOLDER.glob("*.py")}
    assert sum(bench.LIMITS_S.values()) <= 840


@pytest.mark.skipif(sys.platform != "linux", reason="processes are found in /proc")
def test_a_benchmark_that_is_cut_off_takes_what_it_began_along() -> None:
    """Also what has a group of its own, and a child that does not hear of the end, as a worker has."""
    grandchild = "import time; print('up', flush=True); time.sleep(600)"
    child = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {grandchild!r}])"
    benchmark = (
        "import subprocess, sys;"
        f"subprocess.Popen([sys.executable, '-c', {child!r}], start_new_session=True).wait()"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", benchmark], stdout=subprocess.PIPE, text=True, start_new_session=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "up\n"
    bench._end(process)
    # The pipe ends with the last of those that have it.
    assert process.communicate(timeout=60)[0] == ""
