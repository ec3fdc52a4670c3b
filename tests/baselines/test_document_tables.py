"""The table of docs/baselines.md has the numbers that its commands give."""

from pathlib import Path

import pytest

from tests.baselines.document_tables import documented, measured, rendered

pytestmark = pytest.mark.slow


def test_table_of_the_baselines_has_a_row_for_each_command_of_rendered_frames() -> None:
    commands = set(documented())
    assert {"detection", "pixel-mse", "pixel-mse --variant toolkit", "alignment", "deep-scale"} <= commands
    assert "deep-scale --decoding head" in commands


def test_rows_that_are_quickly_measured_are_those_of_the_document(tmp_path: Path) -> None:
    table = documented()
    frames = rendered(tmp_path)
    quick = ("detection", "detection --measure height", "pixel-mse", "pixel-mse --variant toolkit")
    assert {command: measured(command, frames=frames) for command in quick} == {
        command: table[command] for command in quick
    }
