"""An installation of an older release, with rows in its tables, is brought up to date."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.services import ServiceMissing, skip_or_fail, throwaway_database

pytestmark = [pytest.mark.slow, pytest.mark.services]


@pytest.fixture
def empty_database() -> Iterator[str]:
    """The URL of a PostgreSQL database without a table."""
    try:
        with throwaway_database() as url:
            yield url
    except ServiceMissing as missing:
        skip_or_fail(missing)


def test_rows_of_an_older_release_survive_every_migration(empty_database: str, tmp_path: Path) -> None:
    """On PostgreSQL, which alters no table that has rows to be checked at COMMIT."""
    environment = {**os.environ, "TSTTC_DATABASE_URL": empty_database, "TSTTC_DATA_DIR": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-m", "tests.upgrade"], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-3000:]
    assert json.loads(done.stdout.splitlines()[-1]) == {
        "manifests": ["manifest 1", "manifest 2", "manifest 1", "manifest 1"],
        "n_added": [1],
        "decimals": [1, 2, 2],
        "rules": [30, 3650, None],
        "is_shown": [True],
        "mailboxes": ["ada@example.org"],
        "audit": [4, []],
    }
