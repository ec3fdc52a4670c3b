"""The check of the file store: it can be written to, and it is the site's own."""

import socket
from datetime import timedelta
from pathlib import Path

import pytest
from django.utils import timezone
from pytest_django import Settings

from leaderboard.models import Edition, Fault
from leaderboard.ops import faults, health
from leaderboard.storage import files
from leaderboard.upkeep import store_check
from tests import builders


@pytest.fixture
def two_editions(edition: Edition, tmp_path: Path) -> list[Edition]:
    """An edition of each of two splits."""
    return [edition, builders.import_truth(tmp_path, split="val", seed=1)]


def manifest(edition: Edition) -> Path:
    return Path(files.store().path(files.manifest_name(edition.ground_truth.manifest_digest)))


def is_well() -> bool:
    """Whether files can be stored, once a worker has looked."""
    store_check.check(now=timezone.now())
    return health.can_store(now=timezone.now())


def test_a_directory_that_is_not_mounted_is_named_although_it_can_be_written_to(
    two_editions: list[Edition], settings: Settings, tmp_path: Path
) -> None:
    assert is_well()
    mounted = settings.STORAGES
    for other in ("first", "second"):
        options = {**mounted["files"].get("OPTIONS", {}), "location": str(tmp_path / other)}
        settings.STORAGES = {**mounted, "files": {**mounted["files"], "OPTIONS": options}}
        assert not is_well()
        reason = Fault.objects.get(kind=faults.STORE).reason
        assert "has no manifest of this site; is another directory or bucket mounted?" in reason
        assert list((tmp_path / other).rglob("*.json")) == []
        settings.STORAGES = mounted
        assert is_well()


def test_one_lost_manifest_of_two_is_no_other_store(two_editions: list[Edition]) -> None:
    first, second = map(manifest, two_editions)
    first.unlink()
    assert is_well()
    second.unlink()
    assert not is_well()


def test_a_new_site_has_nothing_to_look_for(benchmark: None) -> None:
    assert is_well()


def test_the_fault_of_one_machine_lasts_until_that_machine_is_well_or_silent(
    two_editions: list[Edition], settings: Settings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mounted = settings.STORAGES
    options = {**mounted["files"].get("OPTIONS", {}), "location": str(tmp_path / "other")}
    astray = {**mounted, "files": {**mounted["files"], "OPTIONS": options}}
    now = timezone.now()

    def look(machine: str, *, has_store: bool, minutes: int) -> bool:
        monkeypatch.setattr(socket, "gethostname", lambda: machine)
        settings.STORAGES = mounted if has_store else astray
        store_check.check(now=now + timedelta(minutes=minutes))
        return health.can_store(now=now + timedelta(minutes=minutes))

    assert not look("one", has_store=False, minutes=0)
    assert not look("two", has_store=True, minutes=1)
    assert not look("one", has_store=False, minutes=2)
    assert not look("two", has_store=True, minutes=3)
    assert Fault.objects.get(kind=faults.STORE, subject="one").n_times == 2
    assert look("one", has_store=True, minutes=4)
    assert not look("one", has_store=False, minutes=5)
    assert not look("two", has_store=True, minutes=14)
    # It was taken away: nobody can say that it is well.
    assert look("two", has_store=True, minutes=15)
