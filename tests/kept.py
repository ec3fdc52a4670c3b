"""The edition and the entries that most tests begin with, made once for tests that follow each other.

They are made in a transaction that stays open; each test has a savepoint in it and goes back to there. The
files beside the rows are copied to where the test has its own. A fixture asks `is_kept` whether its rows are
there already. What a test does to them nobody else sees, as if it had made them.
"""

import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from django.conf import settings
from django.core.cache import cache
from django.db import connection, transaction
from django.test import override_settings
from pytest_django import DjangoDbBlocker

from tests import spread
from tests.caching import forget_boards

# Who makes a world in a folder, by the name of the fixture that stands for all of it. One is held at a time.
MAKERS: dict[str, Callable[[Path], object]] = {}
# What changes how the world is made, so a test that asks for it makes its own.
_OF_ITS_OWN = {"open_values"}


@dataclass(frozen=True)
class _World:
    file: Path
    name: str
    folder: Path
    block: transaction.Atomic
    blocker: DjangoDbBlocker


_world: _World | None = None


def storages(folder: Path) -> dict[str, Any]:
    """The settings under which a test's files and ground truth are kept in that folder."""
    files = {
        "BACKEND": "leaderboard.storage.files.DurableFileSystemStorage",
        "OPTIONS": {"location": str(folder / "files")},
    }
    return {
        "FILES_DIR": folder / "files",
        "GROUND_TRUTH_DIR": folder / "ground-truth",
        "STORAGES": {**settings.STORAGES, "files": files},
    }


def is_kept(name: str) -> bool:
    """Whether what this fixture makes is there. There is an edition in every world."""
    return _world is not None and name in {_world.name, "edition"}


def has_people() -> bool:
    """Whether the world has an owner with submissions."""
    return _world is not None and _world.name != "edition"


def copy_files(tmp_path: Path) -> None:
    """Copy the files of the world into the folders of this test."""
    assert _world is not None
    for part, target in (("files", settings.FILES_DIR), ("ground-truth", settings.GROUND_TRUTH_DIR)):
        if (_world.folder / part).exists():
            shutil.copytree(_world.folder / part, target, dirs_exist_ok=True)
    for path in _world.folder.glob("*.csv"):
        shutil.copyfile(path, tmp_path / path.name)


def prepare(item: pytest.Item, *, blocker: DjangoDbBlocker) -> None:
    """Before a test's own savepoint or transaction: hold the world that it asks for, and no other."""
    global _world  # noqa: PLW0603 - there is one connection, which has one transaction
    wanted = _wanted(item)
    current = (_world.file, _world.name) if _world is not None and connection.in_atomic_block else None
    if current == (item.path, wanted):
        return
    let_go()
    if wanted is None:
        return
    folder = Path(tempfile.mkdtemp(prefix="tsttc-world-"))
    block = transaction.atomic()
    block._from_testcase = True  # type: ignore[attr-defined] # so a verb's outermost block may be durable
    hashers = ["django.contrib.auth.hashers.MD5PasswordHasher"]
    with blocker.unblock(), override_settings(**storages(folder), PASSWORD_HASHERS=hashers, QUOTAS=True):
        block.__enter__()
        _world = _World(item.path, wanted, folder, block, blocker)
        try:
            MAKERS[wanted](folder)
        except BaseException:
            let_go()
            raise
    connection.run_on_commit = []
    forget_boards()
    cache.clear()


def let_go() -> None:
    """Undo what is held, if anything is."""
    global _world
    if _world is None:
        return
    world, _world = _world, None
    if connection.in_atomic_block:
        with world.blocker.unblock():
            transaction.set_rollback(True)
            world.block.__exit__(None, None, None)
    shutil.rmtree(world.folder, ignore_errors=True)


def let_go_before(item: pytest.Item) -> None:
    """Undo what is held unless this test may go on with it.

    Fixtures of larger scope in another file write rows that are to stay; who asks no database finds no
    transaction either.
    """
    if _world is not None and (_world.file != item.path or not spread.asks_database(item)):
        let_go()


def _wanted(item: pytest.Item) -> str | None:
    names = set(getattr(item, "fixturenames", ()))
    marker = item.get_closest_marker("django_db")
    is_committed = (marker is not None and marker.kwargs) or {"transactional_db", "live_server"} & names
    if is_committed or _OF_ITS_OWN & names:
        return None
    shared = [name for name in MAKERS if name in names and _is_shared(item, name)]
    # What is there beside an edition has one.
    return next((name for name in shared if name != "edition"), "edition" if shared else None)


def _is_shared(item: pytest.Item, name: str) -> bool:
    """Whether the fixture is that of a `conftest.py`, and not one of the file's own by the same name."""
    fixtures = getattr(item, "_fixtureinfo").name2fixturedefs  # noqa: B009 - pytest's own, as pytest-django does
    return all(part in fixtures and ".py" not in fixtures[part][-1].baseid for part in ("edition", name))
