"""Fixtures that everybody shares."""

import os
from pathlib import Path

import pytest
from celery import current_app
from django.core.cache import cache
from django.db import connection
from pytest_django import DjangoDbBlocker
from pytest_django.fixtures import Settings

from leaderboard import benchmark as benchmark_verbs
from leaderboard.web.health import readiness
from leaderboard.web.kept import memory

# Playwright's own loop makes Django's guard against blocking calls in async code misfire.
os.environ.setdefault("DJANGO_ALLOW_ASYNC_UNSAFE", "true")


# Files whose tests score many predictions, each in a child process as a worker does, or make whole worlds.
SLOW_FILES = {
    "test_admin_retry.py",
    "test_past.py",
    "test_api_outcome.py",
    "test_standings.py",
    "test_api_conditional.py",
    "test_exports_of_ones_own.py",
    "test_foreseen.py",
    "test_first_visit.py",
    "test_anonymity.py",
    "test_deadlines.py",
    "test_receipts.py",
    "test_names.py",
    "test_logs.py",
    "test_api_compare.py",
    "test_attempts.py",
    "test_broker.py",
    "test_inference.py",
    "test_comparisons.py",
    "test_analyses.py",
    "test_conformance.py",
    "test_canaries.py",
    "test_badges_and_feeds.py",
    "test_clean_files.py",
    "test_cli_against_server.py",
    "test_demo.py",
    "test_exports.py",
    "test_files_s3.py",
    "test_headers.py",
    "test_hostile_files.py",
    "test_hostile_names.py",
    "test_lifecycle_states.py",
    "test_pages_board.py",
    "test_pages_board_views.py",
    "test_pages_charts.py",
    "test_pages_compare.py",
    "test_pages_editions.py",
    "test_pages_maintainers.py",
    "test_pages_method.py",
    "test_pages_outcome.py",
    "test_pages_publishing.py",
    "test_pages_queue.py",
    "test_pages_quotas.py",
    "test_pages_submission.py",
    "test_pages_withdrawing.py",
    "test_non_interference.py",
    "test_permissions.py",
    "test_preview.py",
    "test_quarantine.py",
    "test_quotas.py",
    "test_quarantine_runs.py",
    "test_rescoring.py",
    "test_rescoring_batches.py",
    "test_schema.py",
    "test_scoring.py",
    "test_invitations.py",
    "test_method_details.py",
    "test_quota_follows_people.py",
    "test_visibility.py",
    "test_snapshots.py",
}


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests of whole files as slow."""
    for item in items:
        if item.path.name in SLOW_FILES and "evaluator" not in item.path.parts:
            item.add_marker(pytest.mark.slow)


@pytest.fixture(scope="session")
def django_db_setup(django_db_setup: None, django_db_blocker: DjangoDbBlocker) -> None:
    """The test database, in which a transactional test may empty the audit trail when it ends."""
    if connection.vendor == "postgresql":
        with django_db_blocker.unblock(), connection.cursor() as cursor:
            cursor.execute("ALTER TABLE leaderboard_auditevent DISABLE TRIGGER audit_no_truncate")


@pytest.fixture
def benchmark(db: None) -> None:
    """The splits and published rows, which a transactional test may have flushed since `migrate`."""
    benchmark_verbs.ensure_splits()


@pytest.fixture(autouse=True)
def private_directories(tmp_path: Path, settings: Settings) -> None:
    """Files and ground truth of each test live in its own directory."""
    settings.FILES_DIR = tmp_path / "files"
    settings.GROUND_TRUTH_DIR = tmp_path / "ground-truth"
    settings.STORAGES = {
        **settings.STORAGES,
        "files": {
            "BACKEND": "leaderboard.files.DurableFileSystemStorage",
            "OPTIONS": {"location": str(settings.FILES_DIR)},
        },
    }


@pytest.fixture(autouse=True)
def nothing_remembered() -> None:
    """Each test has a database of its own; what was answered from another one holds no more.

    Nor does what the test before has found out about this machine, or done too often within a minute.
    """
    memory.clear()
    readiness.forget()
    cache.clear()


@pytest.fixture(scope="session", autouse=True)
def own_broker(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Messages of this process go to folders of its own, and not to those of `make demo`.

    Not by a setting: Celery reads those once in a process.
    """
    folders = {
        "data_folder_in": "messages",
        "data_folder_out": "messages",
        "processed_folder": "processed",
        "control_folder": "control",
    }
    made = tmp_path_factory.mktemp("broker")
    for name in set(folders.values()):
        (made / name).mkdir()
    options = current_app.conf.broker_transport_options
    current_app.conf.broker_transport_options = {
        **options,
        **{option: str(made / name) for option, name in folders.items()},
    }


@pytest.fixture(autouse=True)
def quick_passwords(settings: Settings) -> None:
    """A hash that is slow on purpose protects passwords that are worth something; here it costs minutes."""
    settings.PASSWORD_HASHERS = ["django.contrib.auth.hashers.MD5PasswordHasher"]


@pytest.fixture(autouse=True)
def quotas_hold(settings: Settings) -> None:
    """Tests meet the stricter world, whatever the default is."""
    settings.QUOTAS = True
