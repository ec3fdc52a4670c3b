"""The private folder and the keys that a checkout makes for itself when it is started first."""

import os
import stat
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from secrets import token_urlsafe

from leaderboard.ops import environment


def test_many_that_start_at_once_read_one_whole_key(tmp_path: Path) -> None:
    barrier = threading.Barrier(16)

    def start(_: int) -> str:
        barrier.wait(180)
        return environment.key_of_checkout(tmp_path / "key", token_urlsafe)

    with ThreadPoolExecutor(16) as pool:
        [key] = set(pool.map(start, range(16)))
    assert len(key) > 40
    assert [path.name for path in tmp_path.iterdir()] == ["key"]
    assert stat.S_IMODE((tmp_path / "key").stat().st_mode) == 0o600
    assert environment.key_of_checkout(tmp_path / "key", token_urlsafe) == key


def test_data_folder_is_closed_to_other_accounts_also_where_it_was_open(tmp_path: Path) -> None:
    made, old, shared = tmp_path / "made", tmp_path / "old", tmp_path / "shared"
    old.mkdir(mode=0o755)
    shared.mkdir()
    shared.chmod(0o1777)
    for folder in (made, old, shared):
        environment.make_private(folder)
    found = [stat.S_IMODE(folder.stat().st_mode) for folder in (made, old, shared)]
    assert found == [0o700, 0o700, 0o1777]


def test_settings_of_the_embedded_profile_close_their_data_folder(tmp_path: Path) -> None:
    (tmp_path / "var").mkdir(mode=0o755)
    (tmp_path / "var" / "leaderboard.sqlite3").write_bytes(b"")
    (tmp_path / "var" / "leaderboard.sqlite3").chmod(0o644)
    environ = {**os.environ, "TSTTC_PROFILE": "embedded", "TSTTC_DATA_DIR": str(tmp_path / "var")}
    environ.pop("TSTTC_DATABASE_URL", None)
    subprocess.run([sys.executable, "-c", "import leaderboard.settings"], env=environ, check=True)
    assert stat.S_IMODE((tmp_path / "var").stat().st_mode) == 0o700
