"""Fixtures that everybody shares."""

import gc
import itertools
import os
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import hypothesis
import pytest
from django.core.cache import cache
from django.db import connection
from django.db.backends.postgresql.operations import DatabaseOperations
from pytest_django import DjangoDbBlocker
from pytest_django.fixtures import Settings

from leaderboard.editions import splits
from tests import emptying, kept, prepared, services, spread
from tests.caching import forget_boards

# How long an example takes says more about the machine than about the code, and what is found by chance is
# not found in the change that fails: `--hypothesis-profile=default` looks further.
hypothesis.settings.register_profile(
    "suite",
    derandomize=True,
    deadline=None,
    suppress_health_check=[hypothesis.HealthCheck.too_slow],
)
hypothesis.settings.load_profile("suite")

# Playwright's own loop makes Django's guard against blocking calls in async code misfire.
os.environ.setdefault("DJANGO_ALLOW_ASYNC_UNSAFE", "true")


_NUMBERS = itertools.count()

NEED_TORCH = {"test_torch.py", "test_lightning.py", "test_threads.py"}


def pytest_make_parametrize_id(val: object, argname: str) -> str | None:
    """Bytes are named by their argument: all processes agree on it, and a gzip header holds the time."""
    return argname if isinstance(val, bytes) else None


def pytest_configure() -> None:
    """What is made once is shared by all processes of the run: the first of them begins it."""
    prepared.begin()


def pytest_ignore_collect(collection_path: Path) -> bool | None:
    """Without torch, files whose imports need it are left alone: `make test-torch` runs them."""
    return True if collection_path.name in NEED_TORCH and find_spec("torch") is None else None


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Without torch, tests that are marked so are left out. See also `tests/spread.py`."""
    if find_spec("torch") is None:
        config.hook.pytest_deselected(items=[item for item in items if item.get_closest_marker("torch")])
        items[:] = [item for item in items if not item.get_closest_marker("torch")]
    spread.sort(items)


def pytest_collection_finish() -> None:
    """What all tests share stays: no collection of garbage needs to look at half a million objects again."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """See `tests/kept.py`."""
    kept.let_go_before(item)


@pytest.fixture(scope="session")
def django_db_modify_db_settings(
    django_db_modify_db_settings: None, pytestconfig: pytest.Config
) -> Iterator[None]:
    """The test database is a copy of the one that was migrated already.

    On SQLite only where several processes need one: a single one migrates its own as quickly.
    """
    settings = connection.settings_dict
    if connection.vendor == "postgresql" and services.is_on_test_server(settings):
        settings["TEST"]["TEMPLATE"] = prepared.template()
        # Nothing here must outlive the server, so no transaction waits for the disk.
        settings["OPTIONS"] = {**settings.get("OPTIONS", {}), "options": "-c synchronous_commit=off"}
    is_one_of_many = "PYTEST_XDIST_WORKER" in os.environ and not pytestconfig.getoption("nomigrations")
    if connection.vendor == "sqlite" and is_one_of_many:
        # Django's name of it.
        with prepared.sqlite_in_memory(f"file:memorydb_{connection.alias}?mode=memory&cache=shared"):
            yield
    else:
        yield


@pytest.fixture(scope="session")
def django_db_setup(django_db_setup: None, django_db_blocker: DjangoDbBlocker) -> Iterator[None]:
    """The test database, in which a transactional test may empty the audit log when it ends."""
    if connection.vendor == "postgresql":
        with django_db_blocker.unblock(), connection.cursor() as cursor:
            cursor.execute(f"ALTER TABLE {emptying.AUDIT_TRAIL} DISABLE TRIGGER audit_no_truncate")
        DatabaseOperations.sql_flush = emptying.statements  # type: ignore[method-assign, assignment]
    yield
    kept.let_go()


@pytest.fixture(scope="session")
def kitti() -> Path:
    """The folder of real drives."""
    shared = services.shared_data()
    if shared is None or not (shared / "kitti-dev").is_dir():
        pytest.skip("kitti-dev is not here: TSTTC_SHARED_DATA names no folder that has it")
    return shared / "kitti-dev"


@pytest.fixture
def production(tmp_path: Path) -> dict[str, str]:
    """The environment of a production process; none of its services needs to exist for the checks."""
    return {
        "TSTTC_PROFILE": "production",
        "TSTTC_SECRET_KEY": "k" * 30 + "0123456789" * 3,
        "TSTTC_RECEIPT_KEY": "A" * 43,
        "TSTTC_ALLOWED_HOSTS": "board.example.org",
        "TSTTC_SITE_URL": "https://board.example.org",
        "TSTTC_DATABASE_URL": "postgres://tsttc:secret@127.0.0.1:1/tsttc",
        "TSTTC_BROKER_URL": "redis://127.0.0.1:1/0",
        "TSTTC_EMAIL_URL": "smtp://127.0.0.1:1",
        "TSTTC_DATA_DIR": str(tmp_path),
    }


@pytest.fixture
def benchmark(db: None) -> None:
    """The splits and published rows, which a transactional test may have flushed since `migrate`."""
    splits.ensure_splits()


@pytest.fixture
def own_folder(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the test may write: its `tmp_path` if it asks for one, or what is there once it writes.

    Half of the tests write nothing, and to make folders for them takes longer than most of them.
    """
    if "tmp_path" in request.fixturenames:
        return Path(request.getfixturevalue("tmp_path"))
    return tmp_path_factory.getbasetemp() / "unasked" / str(next(_NUMBERS))


@pytest.fixture(autouse=True)
def private_directories(own_folder: Path, settings: Settings) -> None:
    """Files and ground truth of each test live in its own directory."""
    for name, value in kept.storages(own_folder).items():
        setattr(settings, name, value)


@pytest.fixture(autouse=True)
def nothing_remembered() -> None:
    """Each test has a database of its own; what was answered from another one holds no more.

    Nor does what the test before has found out about this machine, or done too often within a minute.
    """
    forget_boards()
    cache.clear()


@pytest.fixture(scope="session", autouse=True)
def no_power_cut() -> Iterator[None]:
    """Nothing that this process writes must outlive the machine: on a slow disk it waits for minutes.

    Other processes flush as in earnest; what a test puts in the place of `os.fsync` is called as ever.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", os.fstat)  # which refuses what is no open file, too
        yield


@pytest.fixture(autouse=True)
def quick_passwords(settings: Settings) -> None:
    """A hash that is slow on purpose protects passwords that are worth something; here it costs minutes."""
    settings.PASSWORD_HASHERS = ["django.contrib.auth.hashers.MD5PasswordHasher"]


@pytest.fixture(autouse=True)
def quotas_hold(settings: Settings) -> None:
    """Tests meet the stricter world, whatever the default is."""
    settings.QUOTAS = True
