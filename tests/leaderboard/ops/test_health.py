"""`/healthz`, `/readyz` and `/healthy`: alive without a database, ready with one, healthy with all."""

import random
import re
import socket
from collections.abc import Iterator
from datetime import datetime, timedelta

import pytest
from django.db import connection, connections
from django.db.models.functions import Now
from django.test import Client
from django.utils import timezone
from django.utils.connection import ConnectionDoesNotExist
from pytest_django import Settings

from leaderboard.models import AuditEvent, SweepBeat
from leaderboard.ops import health, prometheus
from leaderboard.upkeep import pollers

pytestmark = pytest.mark.slow


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
    _written(at)
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


def _written(at: datetime) -> None:
    """An audit event of that time, whatever the database says of the time."""
    is_postgresql = connection.vendor == "postgresql"
    with connection.cursor() as cursor:
        if is_postgresql:
            cursor.execute("ALTER TABLE leaderboard_auditevent DISABLE TRIGGER audit_new_event")
        AuditEvent.objects.create(at=at, verb="opened", noun="Door", noun_id="1")
        if is_postgresql:
            cursor.execute("ALTER TABLE leaderboard_auditevent ENABLE TRIGGER audit_new_event")
