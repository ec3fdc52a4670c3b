"""The keys that a checkout makes for itself when it is started first."""

import stat
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from secrets import token_urlsafe

import pytest

from leaderboard import settings


def test_many_that_start_at_once_read_one_whole_key(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(settings, "DATA_DIR", tmp_path)
    barrier = threading.Barrier(16)

    def start(_: int) -> str:
        barrier.wait(60)
        return settings.embedded_key("key", token_urlsafe)

    with ThreadPoolExecutor(16) as pool:
        [key] = set(pool.map(start, range(16)))
    assert len(key) > 40
    assert [path.name for path in tmp_path.iterdir()] == ["key"]
    assert stat.S_IMODE((tmp_path / "key").stat().st_mode) == 0o600
    assert settings.embedded_key("key", token_urlsafe) == key
