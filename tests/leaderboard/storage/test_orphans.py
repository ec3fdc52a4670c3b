"""`manage.py clean_files`: removes what no submission names, and nothing else."""

import io
import os
import random
import threading
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from django.core.files.base import ContentFile
from django.core.management import CommandError, call_command
from django.utils import timezone
from pytest_django import Settings
from structlog.testing import capture_logs

from leaderboard.models import AuditEvent, Edition, Submission, User
from leaderboard.ops import prometheus
from leaderboard.storage import files, orphans
from leaderboard.workers import queue
from tests import builders

pytestmark = pytest.mark.slow


def clean(*arguments: str) -> str:
    """What the command prints."""
    printed = io.StringIO()
    call_command("clean_files", *arguments, stdout=printed)
    return printed.getvalue()


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


def test_nothing_stored_is_nothing_found(db: None) -> None:
    assert clean() == "0 files without a submission, 0 bytes; nothing was removed (--remove does).\n"


def test_orphan_is_listed_and_stays_unless_asked(orphan: Path) -> None:
    printed = clean()
    assert f"predictions/{orphan.parent.name}/{orphan.name}  10 bytes, written " in printed
    assert "1 file without a submission, 10 bytes; nothing was removed" in printed
    assert orphan.exists()
    assert not AuditEvent.objects.exists()


def test_orphan_is_removed_on_demand_and_that_is_recorded(orphan: Path) -> None:
    assert clean("--remove").endswith("1 file without a submission, 10 bytes; removed 1.\n")
    assert not orphan.exists()
    event = AuditEvent.objects.get(verb="removed", noun="File")
    assert event.noun_id == f"sha256:{orphan.stem}"
    assert event.details == {"name": f"predictions/{orphan.parent.name}/{orphan.name}", "size_bytes": 10}
    assert "0 files" in clean("--remove")


def test_young_file_stays_for_its_row_may_be_about_to_be_written(db: None, settings: Settings) -> None:
    path = path_of(keep(b'{"0": 1.5}').digest, settings)
    age(path, hours=23)
    assert "0 files" in clean("--remove")
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
    assert "0 files" in clean("--remove")
    assert all(path.exists() for path in kept)
    assert path_of(submission.digest, settings) in kept


def test_values_of_an_orphan_are_orphans_too(edition: Edition, owner: User, settings: Settings) -> None:
    name = files.aligned_name(manifest_digest="sha256:" + "a" * 64, digest="sha256:" + "b" * 64)
    files.store().save(name, ContentFile(b"12345678"))
    age(Path(settings.FILES_DIR, name), hours=48)
    assert name in clean()


def test_file_of_another_shape_is_left_alone(orphan: Path, settings: Settings) -> None:
    strange = orphan.with_name("README.txt")
    strange.write_text("keep me")
    age(strange, hours=1000)
    clean("--remove")
    assert strange.exists()


def test_bytes_that_come_again_while_cleaning_are_not_lost(
    orphan: Path, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The last moment: the cleaner has found no row, and the same bytes come before it removes them."""
    rename = Path.rename

    def upload_first(self: Path, target: Any) -> Path:
        keep(b'{"0": 1.5}')
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", upload_first)
    assert clean("--remove").endswith("removed 0.\n")
    assert orphan.read_bytes() == b'{"0": 1.5}'
    assert not AuditEvent.objects.exists(), "nothing happened, so nothing is recorded"
    assert list((Path(settings.FILES_DIR) / files.INCOMING).iterdir()) == []


def test_row_that_came_meanwhile_saves_its_file(edition: Edition, owner: User, settings: Settings) -> None:
    data = builders.predictions(edition)
    path = path_of(keep(data).digest, settings)
    age(path, hours=48)
    now = timezone.now()
    [found] = orphans.orphans(now=now)
    builders.submit(owner, data)
    age(path, hours=48)
    assert not orphans.remove(found, now=now)
    assert path.exists()


def test_old_bytes_that_come_again_are_young_again(orphan: Path) -> None:
    before_s = orphan.stat().st_mtime
    keep(b'{"0": 1.5}')
    assert orphan.stat().st_mtime > before_s
    assert "0 files" in clean("--remove")


def test_half_written_files_of_killed_processes_are_removed(orphan: Path, settings: Settings) -> None:
    incoming = Path(settings.FILES_DIR) / files.INCOMING
    old, young = incoming / "tmpold", incoming / "tmpyoung"
    for path in (old, young):
        path.write_bytes(b'{"0": 1')
    age(old, hours=2)
    assert "half-written: tmpold\n" in clean()
    assert old.exists()
    clean("--remove")
    assert not old.exists()
    assert young.exists(), "somebody may be writing it"


def test_store_that_does_not_answer_is_said_in_a_sentence(db: None, settings: Settings) -> None:
    url = "s3://bucket?endpoint=http://127.0.0.1:1"
    settings.STORAGES = {
        **settings.STORAGES,
        "files": {"BACKEND": "leaderboard.storage.s3.S3FileStore", "OPTIONS": {"url": url}},
    }
    with pytest.raises(CommandError, match="The file store does not answer: the file store does not answer"):
        clean()


# --- by itself ---------------------------------------------------------------------------------------------


def test_the_workers_clean_by_themselves_and_say_what_they_removed(orphan: Path, settings: Settings) -> None:
    incoming = Path(settings.FILES_DIR) / files.INCOMING
    incoming.mkdir(exist_ok=True)
    half = incoming / "tmpold"
    half.write_bytes(b'{"0": 1')
    age(half, hours=2)
    with capture_logs() as lines:
        queue.keep_up(rng=random.Random(0), stopping=threading.Event())
    [line] = [line for line in lines if line["event"] == "cleaned"]
    assert (line["n_files"], line["n_bytes"], line["n_leftovers"]) == (1, 10, 1)
    assert not orphan.exists()
    assert not half.exists()
    assert AuditEvent.objects.filter(verb="removed", noun="File").count() == 1
    printed = prometheus.exposition().decode()
    assert "tsttc_unnamed_files_removed_total 1.0" in printed
    assert "tsttc_unnamed_bytes_removed_total 10.0" in printed
    assert "tsttc_last_clean_age_seconds NaN" not in printed


def test_two_that_clean_at_once_remove_a_file_once(orphan: Path) -> None:
    now = timezone.now()
    found = [list(orphans.orphans(now=now)) for _ in range(2)]
    assert [[orphans.remove(row, now=now) for row in rows] for rows in found] == [[True], [False]]
    assert AuditEvent.objects.filter(verb="removed", noun="File").count() == 1
