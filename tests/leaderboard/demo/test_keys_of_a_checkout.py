"""The private folder and the keys that a checkout makes for itself when it is started first."""

import stat
from pathlib import Path
from secrets import token_urlsafe

from leaderboard.ops import environment


def test_a_key_is_made_once_and_its_owners_alone(tmp_path: Path) -> None:
    key = environment.key_of_checkout(tmp_path / "key", token_urlsafe)
    assert stat.S_IMODE((tmp_path / "key").stat().st_mode) == 0o600
    assert environment.key_of_checkout(tmp_path / "key", token_urlsafe) == key


def test_data_folder_is_closed_to_other_accounts_also_where_it_was_open(tmp_path: Path) -> None:
    made, old, shared = tmp_path / "made", tmp_path / "old", tmp_path / "shared"
    old.mkdir(mode=0o755)
    shared.mkdir()
    shared.chmod(0o1777)
    for folder in (made, old, shared):
        environment.make_private(folder)
    modes = [stat.S_IMODE(folder.stat().st_mode) for folder in (made, old, shared)]
    assert modes == [0o700, 0o700, 0o1777]
