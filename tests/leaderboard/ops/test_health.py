"""`/healthz`, `/readyz` and `/healthy`: alive without a database, ready with one, healthy with all."""

import random
import re
import socket
from collections.abc import Iterator
from datetime import datetime, timedelta
from pathlib import Path

import pytest
from django.core.cache import caches
from django.core.files.uploadedfile import SimpleUploadedFile
from django.db import connection, connections
from django.db.models.functions import Now
from django.test import Client
from django.utils import timezone
from django.utils.connection import ConnectionDoesNotExist
from pytest_django import Settings

from leaderboard.models import AuditEvent, Edition, Fault, Mail, MailKind, SweepBeat, User
from leaderboard.ops import backup_runs, faults, health, prometheus
from leaderboard.upkeep import pollers, store_check
from tests import builders


@pytest.fixture(autouse=True)
def _no_hurry(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(health, "CHECK_TIMEOUT_S", 60)


@pytest.fixture
def silent_port() -> Iterator[int]:
    """A port that accepts connections and never says a word, like a stopped server."""
    with socket.create_server(("127.0.0.1", 0)) as listening:
        yield listening.getsockname()[1]


def _swept(*, seconds_ago: float) -> None:
    """A sweep, so long ago by the database's clock."""
    at = Now() - timedelta(seconds=seconds_ago)
    SweepBeat.objects.update_or_create(id=SweepBeat.THE_ONE, defaults={"swept_at": at})


def test_alive_needs_no_database() -> None:
    # Without the mark `django_db`, any question to the database fails the test.
    client = Client()
    client.cookies["sessionid"] = "x" * 32
    response = client.get("/healthz")
    assert (response.status_code, response.json()) == (200, {"status": "alive"})


@pytest.mark.django_db(transaction=True)
def test_ready_when_database_broker_and_sweep_are_well() -> None:
    pollers.sweep(rng=random.Random(0))
    response = Client().get("/healthy")
    assert response.status_code == 200
    assert response.json()["status"] == "healthy"
    assert {name: check["ok"] for name, check in response.json()["checks"].items()} == {
        "database": True,
        "sweep": True,
        "ground truth": True,
        "audit log": True,
        "file store owner": True,
        "file store": True,
        "free space": True,
        "uploads": True,
        "statistics": True,
        "backup": True,
        "mail": True,
        "refused mails": True,
        "queue": True,
        "system errors": True,
        "cleaning": True,
        "broker": True,
    }


@pytest.mark.django_db(transaction=True)
@pytest.mark.parametrize(("seconds_ago", "is_ok"), [(30, True), (65, False), (None, False)])
def test_no_sweep_for_a_minute_is_not_ready(seconds_ago: float | None, is_ok: bool) -> None:
    if seconds_ago is not None:
        _swept(seconds_ago=seconds_ago)
    response = Client().get("/healthy")
    assert response.json()["checks"]["sweep"]["ok"] is is_ok
    assert response.status_code == (200 if is_ok else 503)


@pytest.mark.django_db(transaction=True)
@pytest.mark.parametrize(("seconds_ago", "is_ok"), [(20, True), (130, False)])
def test_events_that_nobody_seals_are_shown_and_keep_the_site_ready(seconds_ago: float, is_ok: bool) -> None:
    _swept(seconds_ago=1)
    at = timezone.now() - timedelta(seconds=seconds_ago)
    write_event(at)
    response = Client().get("/healthy")
    assert (response.status_code, response.json()["checks"]["audit log"]["ok"]) == (200, is_ok)
    figures = prometheus.exposition().decode()
    assert "tsttc_audit_unsealed 1.0" in figures
    assert re.search(rf"tsttc_audit_unsealed_age_seconds {seconds_ago // 10}[0-9]\.", figures)


@pytest.mark.django_db(transaction=True)
def test_the_balancer_depends_on_the_database_alone() -> None:  # and nobody has swept
    response = Client().get("/readyz")
    assert (response.status_code, list(response.json()["checks"])) == (200, ["database"])


@pytest.mark.django_db(transaction=True)
def test_broker_that_accepts_but_never_answers_is_given_up(
    settings: Settings, silent_port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(health, "CHECK_TIMEOUT_S", 0.2)
    settings.CELERY_BROKER_URL = f"redis://:swordfish@127.0.0.1:{silent_port}/0"
    settings.CELERY_BROKER_TRANSPORT_OPTIONS = {"socket_timeout": 300}
    _swept(seconds_ago=1)
    response = Client().get("/healthy")
    assert response.status_code == 503
    assert response.json()["checks"]["broker"]["ok"] is False
    assert "swordfish" not in response.text
    assert str(silent_port) not in response.text


@pytest.mark.slow
def test_database_that_accepts_but_never_answers_is_given_up(
    silent_port: int, monkeypatch: pytest.MonkeyPatch, db: None
) -> None:
    elsewhere = {
        **connections.settings["default"],
        "ENGINE": "django.db.backends.postgresql",
        "HOST": "127.0.0.1",
        "PORT": str(silent_port),
        "USER": "nobody",
        "PASSWORD": "swordfish",
        "OPTIONS": {"connect_timeout": 60},
    }
    monkeypatch.setattr(health, "CHECK_TIMEOUT_S", 2)
    monkeypatch.setitem(connections.settings, "default", elsewhere)
    response = Client().get("/healthy")
    assert response.status_code == 503
    checks = response.json()["checks"]
    assert checks["database"] == {"ok": False, "detail": "does not answer"}
    assert checks["sweep"] == {"ok": False, "detail": "unknown: the database does not answer"}
    assert checks["broker"]["ok"] is True
    assert "swordfish" not in response.text
    with pytest.raises(ConnectionDoesNotExist):
        connections[health.PROBE]


def write_event(at: datetime) -> None:
    """An audit event of that time, whatever the database says of the time."""
    is_postgresql = connection.vendor == "postgresql"
    with connection.cursor() as cursor:
        if is_postgresql:
            cursor.execute("ALTER TABLE leaderboard_auditevent DISABLE TRIGGER audit_new_event")
        AuditEvent.objects.create(at=at, verb="opened", noun="Door", noun_id="1")
        if is_postgresql:
            cursor.execute("ALTER TABLE leaderboard_auditevent ENABLE TRIGGER audit_new_event")


# --- what workers, web processes and backups have written down ---------------------------------------------


def _is_ok(name: str) -> bool:
    return bool(Client().get("/healthy").json()["checks"][name]["ok"])


@pytest.mark.django_db(transaction=True)
def test_a_new_site_without_a_backup_or_a_mail_is_healthy_and_an_old_backup_is_named(
    settings: Settings,
) -> None:
    _swept(seconds_ago=1)
    assert Client().get("/healthy").status_code == 200
    now = timezone.now()
    run = backup_runs.begin(now - timedelta(hours=60))
    backup_runs.finish(run, now=now - timedelta(hours=59), is_ok=True)
    caches["views"].clear()
    assert Client().get("/healthy").status_code == 503
    assert not _is_ok("backup")
    assert [Client().get(address).status_code for address in ("/healthz", "/readyz")] == [200, 200]
    settings.MAX_BACKUP_AGE_H = 0
    caches["views"].clear()
    assert Client().get("/healthy").status_code == 200


@pytest.mark.django_db(transaction=True)
def test_a_site_whose_backups_all_failed_misses_one_after_two_days() -> None:
    now = timezone.now()
    for hours in (60, 36, 12):
        run = backup_runs.begin(now - timedelta(hours=hours))
        backup_runs.finish(run, now=now, is_ok=False, fault="the disk is full")
    assert backup_runs.is_overdue(now=now)
    assert not backup_runs.is_overdue(now=now - timedelta(hours=20))
    assert not _is_ok("backup")
    assert "disk is full" not in Client().get("/healthy").text


@pytest.mark.django_db(transaction=True)
def test_a_store_that_cannot_be_written_is_named_until_it_can(settings: Settings) -> None:
    _swept(seconds_ago=1)
    Path(settings.FILES_DIR).parent.mkdir(parents=True, exist_ok=True)
    Path(settings.FILES_DIR).write_text("not a folder")
    store_check.check(now=timezone.now())
    response = Client().get("/healthy")
    assert (response.status_code, _is_ok("file store")) == (503, False)
    assert str(settings.FILES_DIR) not in response.text
    Path(settings.FILES_DIR).unlink()
    store_check.check(now=timezone.now())
    caches["views"].clear()
    assert _is_ok("file store")
    assert not [path for path in Path(settings.FILES_DIR).rglob("*") if path.is_file()], (
        "the probe is removed"
    )


@pytest.mark.django_db(transaction=True)
def test_little_room_is_named_and_keeps_the_site_healthy() -> None:
    _swept(seconds_ago=1)
    SweepBeat.objects.update(store_free_bytes=10**9)
    response = Client().get("/healthy")
    assert (response.status_code, _is_ok("free space")) == (200, False)


@pytest.mark.slow
@pytest.mark.django_db(transaction=True)
def test_a_refused_upload_is_named_until_one_is_accepted_or_an_hour_has_passed(
    edition: Edition, owner: User, settings: Settings
) -> None:
    _swept(seconds_ago=1)
    client = Client(raise_request_exception=False)
    client.force_login(owner)
    data = builders.predictions(edition)

    def send() -> int:
        form = {"split": "test", "method": "Foo", "file": SimpleUploadedFile("p.json", data)}
        caches["views"].clear()
        return client.post("/submit/", form).status_code

    aside = Path(settings.FILES_DIR).rename(Path(settings.FILES_DIR).with_name("aside"))
    Path(settings.FILES_DIR).write_text("not a folder")
    assert send() == 503
    assert not _is_ok("uploads")
    Path(settings.FILES_DIR).unlink()
    aside.rename(settings.FILES_DIR)
    Fault.objects.update(last_at=timezone.now() - timedelta(hours=2))
    caches["views"].clear()
    assert _is_ok("uploads")
    Fault.objects.update(last_at=timezone.now())
    assert send() == 302
    assert _is_ok("uploads")
    assert Fault.objects.get(kind=faults.UPLOADS).n_ever == 1, "a counter is never wiped"


@pytest.mark.django_db(transaction=True)
def test_a_mail_that_waits_for_the_server_is_named_and_one_that_the_server_puts_off_is_not(
    settings: Settings,
) -> None:
    settings.SENDS_MAIL = True
    old = timezone.now() - timedelta(hours=2)
    mail = Mail.objects.create(
        kind=MailKind.ACCOUNT, recipient="a@example.org", queued_at=old, reason="451 later"
    )
    assert _is_ok("mail")
    Mail.objects.filter(pk=mail.pk).update(reason="")
    caches["views"].clear()
    assert not _is_ok("mail")
