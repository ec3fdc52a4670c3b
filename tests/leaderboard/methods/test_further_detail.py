"""A method detail is added in one place."""

import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.slow


def test_a_detail_is_a_field_and_a_row_of_the_registry() -> None:
    """In a process of its own: what follows from the registry follows when it is imported."""
    completed = subprocess.run(
        [
            *(sys.executable, "-m", "pytest", "-q", "-p", "no:xdist", "-p", "no:cacheprovider"),
            *("--nomigrations", "-p", "tests.leaderboard.methods.further_detail"),
            "tests/leaderboard/methods/with_further_detail.py",
        ],
        env={name: value for name, value in os.environ.items() if name != "TSTTC_DATABASE_URL"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert completed.returncode == 0, completed.stdout + completed.stderr
    assert "5 passed" in completed.stdout
