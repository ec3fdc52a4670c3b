"""A store belongs to one site, and after a restore nothing is removed that a newer database may name."""

import json
import os
import random
import threading
from datetime import datetime, timedelta
from pathlib import Path

import pytest
from django.core.files.base import ContentFile
from django.core.management import call_command
from django.utils import timezone
from pytest_django import Settings

from leaderboard import audit
from leaderboard.errors.refusals import Refused
from leaderboard.models import AuditEvent, Installation
from leaderboard.ops import health
from leaderboard.storage import files, orphans, ownership
from leaderboard.upkeep import pollers

pytestmark = pytest.mark.django_db
DAY = timedelta(days=1)


@pytest.fixture
def now() -> datetime:
    return timezone.now()


@pytest.fixture
def orphan(settings: Settings, now: datetime) -> Path:
    """A file of two days ago that no submission names."""
    kept = files.save_predictions(ContentFile(b'{"0": 1.5}'), now=now)
    path = Path(settings.FILES_DIR, files.predictions_name(kept.digest))
    then_s = (now - 2 * DAY).timestamp()
    os.utime(path, (then_s, then_s))
    return path


def clean(now: datetime) -> int:
    return sum(orphans.remove(each, now=now) for each in orphans.orphans(now=now))


def marker(settings: Settings) -> dict[str, object]:
    document: dict[str, object] = json.loads(Path(settings.FILES_DIR, ownership.NAME).read_text())
    return document


def test_a_new_store_becomes_the_sites_own_at_its_first_use(settings: Settings, now: datetime) -> None:
    assert ownership.may_remove_files(now=now)
    assert marker(settings)["site_id"] == str(Installation.objects.get().site_id)
    assert ownership.may_remove_files(now=now)


def test_nothing_is_removed_for_weeks_after_a_restore_and_then_it_is(
    orphan: Path, settings: Settings, now: datetime
) -> None:
    ownership.may_remove_files(now=now)
    site = ownership.note_restore(now=now)
    ownership.claim(reason="The former site is switched off.")
    assert clean(now) == clean(now + 55 * DAY) == 0
    assert orphan.exists()
    settings.KEEP_AFTER_RESTORE_D = 90
    assert clean(now + 57 * DAY) == 0
    settings.KEEP_AFTER_RESTORE_D = 56
    assert clean(now + 57 * DAY) == 1
    assert Installation.objects.get().site_id == site.site_id


def test_a_restored_site_cleans_no_store_of_another_and_says_so(
    orphan: Path, settings: Settings, now: datetime
) -> None:
    ownership.may_remove_files(now=now)
    first = marker(settings)
    site = ownership.note_restore(now=now)
    assert ownership.take_if_new(site, is_new=True) == first["site_id"]
    assert clean(now + 100 * DAY) == 0
    assert orphan.exists()
    assert marker(settings) == first
    assert Installation.objects.get().store_is_of == first["site_id"]


@pytest.mark.django_db(transaction=True)
def test_health_says_that_the_store_is_of_another_and_not_whose() -> None:
    for store_is_of, is_ok in (("", True), ("another", False)):
        Installation.objects.update_or_create(pk=1, defaults={"store_is_of": store_is_of})
        [check] = [check for check in health.checks() if check.name == "file store owner"]
        assert (check.is_ok, check.is_vital) == (is_ok, False)
        assert ("belongs to another site" in check.detail) == (not is_ok)


def test_a_store_that_says_nothing_is_left_alone_by_a_restored_site_unless_it_is_new(
    orphan: Path, settings: Settings, now: datetime
) -> None:
    site = ownership.note_restore(now=now)
    assert ownership.take_if_new(site, is_new=False) == ownership.UNKNOWN
    assert clean(now + 100 * DAY) == 0
    assert not Path(settings.FILES_DIR, ownership.NAME).exists()
    assert ownership.take_if_new(site, is_new=True) == ""
    assert clean(now + 100 * DAY) == 1


def test_a_database_that_is_older_than_its_store_counts_as_restored(
    orphan: Path, settings: Settings, now: datetime
) -> None:
    """An operator put an older copy in its place by other means than `restore`."""
    audit.record(verb="edited", noun="Page", noun_id="rules")
    audit.seal()
    assert ownership.may_remove_files(now=now)
    before = Installation.objects.get()
    assert marker(settings)["seal_number"] == 1
    Path(settings.FILES_DIR, ownership.NAME).write_text(json.dumps(marker(settings) | {"seal_number": 9}))
    assert clean(now) == clean(now + 100 * DAY) == 0
    after = Installation.objects.get()
    assert (after.restored_at, after.store_is_of) == (now, str(before.site_id))


@pytest.mark.parametrize("text", ["", "{", "[]", "{}", '{"site_id": "x", "seal_number": "9"}', "\xff"])
def test_a_damaged_mark_is_no_licence_to_remove_files(orphan: Path, settings: Settings, text: str) -> None:
    Path(settings.FILES_DIR, ownership.NAME).write_bytes(text.encode("latin-1"))
    assert clean(timezone.now()) == 0
    assert orphan.exists()


def test_the_command_takes_the_store_over_and_the_log_says_from_whom(
    orphan: Path, settings: Settings, now: datetime, capsys: pytest.CaptureFixture[str]
) -> None:
    ownership.may_remove_files(now=now)
    before = str(Installation.objects.get().site_id)
    ownership.note_restore(now=now)
    call_command("claim_store", reason="The first host is switched off.")
    assert f"and no more to {before}" in capsys.readouterr().out
    event = AuditEvent.objects.get(noun="FileStore")
    assert event.details == {"reason": "The first host is switched off.", "before": before}
    assert clean(now + 57 * DAY) == 1
    call_command("claim_store", reason="Again.")
    assert "already" in capsys.readouterr().out


def test_a_refused_upload_stays_where_a_newer_database_may_name_its_bytes(
    settings: Settings, now: datetime
) -> None:
    """The same bytes may be a submission that was sent after the backup."""
    kept = files.save_predictions(ContentFile(b'{"0": 2.5}'), now=now)
    path = Path(settings.FILES_DIR, files.predictions_name(kept.digest))
    ownership.may_remove_files(now=now)
    ownership.note_restore(now=now)
    ownership.claim(reason="The first host is switched off.")
    with pytest.raises(Refused), orphans.unless_refused(Refused, digest=kept.digest):
        raise Refused("quota-exceeded", "No slot is left.")
    assert path.exists()
    Installation.objects.update(restored_at=None)
    with pytest.raises(Refused), orphans.unless_refused(Refused, digest=kept.digest):
        raise Refused("quota-exceeded", "No slot is left.")
    assert not path.exists()


def test_workers_clean_everything_else_while_the_store_is_of_another(orphan: Path, now: datetime) -> None:
    ownership.may_remove_files(now=now)
    ownership.note_restore(now=now)
    pollers.keep_up(rng=random.Random(0), stopping=threading.Event())
    assert orphan.exists()
