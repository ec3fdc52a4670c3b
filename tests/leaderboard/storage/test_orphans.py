"""Cleaning removes what no submission names, and nothing else."""

import os
import random
import threading
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from django.core.files.base import ContentFile
from django.utils import timezone
from pytest_django import Settings
from structlog.testing import capture_logs

from leaderboard.models import AuditEvent, Edition, Submission, User
from leaderboard.ops import prometheus
from leaderboard.storage import files, orphans
from leaderboard.upkeep import pollers
from tests import builders


def clean() -> int:
    """Remove all that is to be removed now; how many files that were."""
    now = timezone.now()
    return sum(orphans.remove(orphan, now=now) for orphan in orphans.orphans(now=now))


def keep(data: bytes) -> files.StoredFile:
    return files.save_predictions(ContentFile(data, name="p.json"), now=timezone.now())


def path_of(digest: str, settings: Settings) -> Path:
    return Path(settings.FILES_DIR, files.predictions_name(digest))


def age(path: Path, *, hours: float) -> None:
    """Let the file have been written so long ago."""
    then_s = (timezone.now() - timedelta(hours=hours)).timestamp()
    os.utime(path, (then_s, then_s))


@pytest.fixture
def orphan(settings: Settings, db: None) -> Path:
    """A file of two days ago that no submission names."""
    path = path_of(keep(b'{"0": 1.5}').digest, settings)
    age(path, hours=48)
    return path


def test_an_orphan_that_cannot_be_removed_keeps_no_other(orphan: Path, settings: Settings) -> None:
    second = path_of(keep(b'{"0": 2.5}').digest, settings)
    age(second, hours=48)
    stuck, other = sorted([orphan, second])
    # Where it is put aside, a folder stands in its way.
    Path(settings.FILES_DIR, files.INCOMING, f"removed-{stuck.name}").mkdir(parents=True)
    with pytest.raises(OSError, match="directory"):
        pollers.clean(now=timezone.now())
    assert stuck.exists()
    assert not other.exists()


def test_orphan_and_its_values_are_removed_and_that_is_recorded(orphan: Path, settings: Settings) -> None:
    values = files.aligned_name(manifest_digest="sha256:" + "a" * 64, digest="sha256:" + "b" * 64)
    files.store().save(values, ContentFile(b"12345678"))
    strange = orphan.with_name("README.txt")
    strange.write_text("keep me")
    for path in (Path(settings.FILES_DIR, values), strange):
        age(path, hours=48)
    assert clean() == 2
    assert not orphan.exists()
    assert strange.exists()
    event = AuditEvent.objects.get(noun_id=f"sha256:{orphan.stem}")
    assert (event.verb, event.noun) == ("removed", "File")
    assert event.details == {"name": f"predictions/{orphan.parent.name}/{orphan.name}", "size_bytes": 10}
    assert clean() == 0


def test_young_file_stays_for_its_row_may_be_about_to_be_written(db: None, settings: Settings) -> None:
    path = path_of(keep(b'{"0": 1.5}').digest, settings)
    age(path, hours=23)
    assert clean() == 0
    assert path.exists()


@pytest.mark.parametrize("is_withdrawn", [False, True])
def test_file_of_a_submission_stays_for_ever(
    edition: Edition, owner: User, settings: Settings, is_withdrawn: bool
) -> None:
    submission = builders.submit(owner, builders.predictions(edition))
    builders.score_all()
    if is_withdrawn:
        Submission.objects.update(withdrawn_at=timezone.now())
    kept = [path for path in Path(settings.FILES_DIR).rglob("*") if path.is_file()]
    assert len(kept) == 3, "the file, its values, the manifest"
    for path in kept:
        age(path, hours=1000)
    assert clean() == 0
    assert all(path.exists() for path in kept)
    assert path_of(submission.digest, settings) in kept


def test_bytes_that_come_again_while_cleaning_are_not_lost(
    orphan: Path, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The last moment: the cleaner has found no row, and the same bytes come before it removes them."""
    rename = Path.rename

    def upload_first(self: Path, target: Any) -> Path:
        keep(b'{"0": 1.5}')
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", upload_first)
    assert clean() == 0
    assert orphan.read_bytes() == b'{"0": 1.5}'
    assert not AuditEvent.objects.exists(), "nothing happened, so nothing is recorded"
    assert list((Path(settings.FILES_DIR) / files.INCOMING).iterdir()) == []


def test_row_that_came_meanwhile_saves_its_file(edition: Edition, owner: User, settings: Settings) -> None:
    data = builders.predictions(edition)
    path = path_of(keep(data).digest, settings)
    age(path, hours=48)
    now = timezone.now()
    [row] = orphans.orphans(now=now)
    builders.submit(owner, data)
    age(path, hours=48)
    assert not orphans.remove(row, now=now)
    assert path.exists()


# --- by itself ---------------------------------------------------------------------------------------------


def test_the_workers_clean_by_themselves_and_say_what_they_removed(orphan: Path, settings: Settings) -> None:
    incoming = Path(settings.FILES_DIR) / files.INCOMING
    incoming.mkdir(exist_ok=True)
    half = incoming / "tmpold"
    half.write_bytes(b'{"0": 1')
    age(half, hours=2)
    with capture_logs() as lines:
        pollers.keep_up(rng=random.Random(0), stopping=threading.Event())
    [line] = [line for line in lines if line["event"] == "cleaned"]
    assert (line["n_files"], line["n_bytes"], line["n_leftovers"]) == (1, 10, 1)
    assert not orphan.exists()
    assert not half.exists()
    assert AuditEvent.objects.filter(verb="removed", noun="File").count() == 1
    assert "tsttc_last_clean_age_seconds NaN" not in prometheus.exposition().decode()


def test_two_that_clean_at_once_remove_a_file_once(orphan: Path) -> None:
    now = timezone.now()
    listings = [list(orphans.orphans(now=now)) for _ in range(2)]
    assert [[orphans.remove(row, now=now) for row in rows] for rows in listings] == [[True], [False]]
    assert AuditEvent.objects.filter(verb="removed", noun="File").count() == 1
