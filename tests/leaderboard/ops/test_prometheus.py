"""`/metrics`: figures that agree with the rows, for those who may read them."""

import random
import re
from datetime import timedelta
from pathlib import Path

import pytest
from django.db.models import F
from django.test import Client
from prometheus_client.parser import text_string_to_metric_families
from pytest_django import Settings

from leaderboard.models import Edition, Evaluation, User
from leaderboard.ops import prometheus
from leaderboard.queue import lifecycle
from leaderboard.queue.lifecycle import Strike
from tests.leaderboard.web.maintain import queue_rows

RNG = random.Random(0)
REPOSITORY = Path(__file__).resolve().parents[3]


def figures() -> dict[str, float]:
    """The current metrics: `name{label="value"}` to number."""
    response = Client().get("/metrics")
    assert response.status_code == 200
    values = {}
    for family in text_string_to_metric_families(response.text):
        for sample in family.samples:
            labels = ",".join(f'{name}="{value}"' for name, value in sample.labels.items())
            values[f"{sample.name}{{{labels}}}" if labels else sample.name] = sample.value
    return values


def test_queue_is_counted_by_priority_and_aged_by_its_oldest(edition: Edition, owner: User) -> None:
    live = [queue_rows.queued(edition, owner) for _ in range(3)]
    queue_rows.queued(edition, owner, priority=Evaluation.PRIORITY_RESCORE)
    Evaluation.objects.filter(pk=live[1].pk).update(queued_at=F("queued_at") - timedelta(seconds=500))
    metrics = figures()
    assert metrics['tsttc_queue_depth{priority="live"}'] == 3
    assert metrics['tsttc_queue_depth{priority="rescore"}'] == 1
    assert 500 <= metrics["tsttc_queue_oldest_age_seconds"] < 560


def test_runs_are_counted_by_their_outcome(edition: Edition, owner: User) -> None:
    for _ in range(5):
        queue_rows.queued(edition, owner)
    lifecycle.finalise(queue_rows.claim(), queue_rows.SCORED)
    lifecycle.finalise(queue_rows.claim(), queue_rows.SCORED)
    lifecycle.finalise(queue_rows.claim(), queue_rows.REJECTED)
    lifecycle.fail_attempt(queue_rows.claim(), strike=Strike.INFRASTRUCTURE, reason="disk", rng=RNG)
    queue_rows.claim()
    metrics = figures()
    assert metrics["tsttc_runs_started_total"] == 5
    assert metrics['tsttc_runs_finished_total{outcome="scored"}'] == 2
    assert metrics['tsttc_runs_finished_total{outcome="rejected"}'] == 1
    assert metrics["tsttc_running"] == 1
    assert metrics['tsttc_queue_depth{priority="live"}'] == 1
    assert metrics['tsttc_strikes_total{kind="infrastructure"}'] == 1
    assert metrics['tsttc_strikes_total{kind="poison"}'] == 0


# --- who may read them ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("address", "headers", "is_allowed"),
    [
        ("127.0.0.1", {}, True),
        ("::1", {}, True),
        ("203.0.113.7", {}, False),
        ("unix:", {}, False),
        # A proxy on the same machine connects from loopback on behalf of anybody.
        ("127.0.0.1", {"X-Forwarded-For": "127.0.0.1"}, False),
        ("203.0.113.7", {"X-Real-IP": "127.0.0.1"}, False),
        # No token is configured: none is right, not even the empty one.
        ("203.0.113.7", {"Authorization": "Bearer "}, False),
    ],
)
def test_only_direct_connections_from_listed_networks_read(
    db: None, address: str, headers: dict[str, str], is_allowed: bool
) -> None:
    response = Client(REMOTE_ADDR=address, headers=headers).get("/metrics")
    assert response.status_code == (200 if is_allowed else 403)
    assert (b"tsttc_running" in response.content) is is_allowed


@pytest.mark.parametrize(
    ("sent", "is_allowed"),
    [
        ({"Authorization": "Bearer swordfish"}, True),
        ({"Authorization": "Bearer swordfis"}, False),
        ({"Authorization": "Bearer ſwordfiſh"}, False),
        ({}, False),
    ],
)
def test_with_a_token_the_token_alone_decides(
    db: None, settings: Settings, sent: dict[str, str], is_allowed: bool
) -> None:
    settings.METRICS_TOKEN = "swordfish"
    for address in ("127.0.0.1", "203.0.113.7"):
        response = Client(REMOTE_ADDR=address, headers=sent).get("/metrics")
        assert response.status_code == (200 if is_allowed else 403)


@pytest.mark.parametrize("host", ["web:8000", "10.0.0.7:8000", "127.0.0.1:8000", "no_name"])
def test_monitoring_is_answered_under_any_name_and_nothing_else_is(
    db: None, settings: Settings, host: str
) -> None:
    settings.ALLOWED_HOSTS = ["board.example.org"]
    settings.SITE_URL = "https://board.example.org"
    client = Client(HTTP_HOST=host)
    for address in ("/healthz", "/readyz", "/metrics"):
        answer = client.get(address)
        assert answer.status_code == 200, address
        assert host not in answer.text
    assert client.get("/healthy").status_code in {200, 503}
    for address in ("/", "/metrics/", "/board/test/", "/api/v1/boards", "//metrics", "/metrics%2F.."):
        answer = client.get(address)
        assert answer.status_code in {400, 404}, address
        assert host not in answer.headers.get("Location", "")
    assert client.get("/").status_code == 400


def test_every_figure_is_documented_and_nothing_else(client: Client, db: None) -> None:
    client.get("/healthz")  # of answers, there are figures once there was one
    documented = set(re.findall(r"\btsttc_[a-z_]+", (REPOSITORY / "docs" / "operations.md").read_text()))
    documented -= {"tsttc_application", "tsttc_pages"}  # a role of the database, and a network
    families = list(text_string_to_metric_families(prometheus.exposition().decode()))
    given = {f"{family.name}_total" if family.type == "counter" else family.name for family in families}
    assert len(given) >= 9
    assert documented == given


@pytest.mark.slow
@pytest.mark.django_db
def test_answers_are_counted_by_route_and_never_by_what_a_visitor_typed(client: Client) -> None:
    def n_of(route: str, status: str) -> float:
        name = f'tsttc_http_requests_total{{method="GET",route="{route}",status="{status}"}} '
        lines = prometheus.exposition().decode().splitlines()
        return sum(float(line.removeprefix(name)) for line in lines if line.startswith(name))

    before = n_of("none", "4xx"), n_of("healthz", "2xx"), n_of("login", "2xx"), n_of("account_login", "2xx")
    client.get("/no/such-place-as-swordfish/")
    client.get("/healthz")
    client.get("/accounts/login/")
    after = n_of("none", "4xx"), n_of("healthz", "2xx"), n_of("login", "2xx"), n_of("account_login", "2xx")
    assert [now - then for now, then in zip(after, before, strict=True)] == [1, 0, 0, 1]
    text = prometheus.exposition().decode()
    assert "swordfish" not in text
    assert 'tsttc_http_request_seconds_bucket{le="0.005",route="account_login"}' in text
