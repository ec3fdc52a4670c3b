"""Each alarm of `deploy/prometheus/rules.yml` fires when its fault is brought about, and not before."""

import random
import re
import shutil
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import yaml
from django.core.files.uploadedfile import SimpleUploadedFile
from django.db import OperationalError, connection
from django.db.models.functions import Now
from django.test import Client
from django.utils import timezone
from prometheus_client.parser import text_string_to_metric_families
from pytest_django import Settings

from leaderboard.mails import outbox
from leaderboard.models import (
    BackupRun,
    Edition,
    Evaluation,
    Fault,
    Mail,
    MailKind,
    SweepBeat,
    User,
)
from leaderboard.ops import backup_runs, faults, health, prometheus
from leaderboard.queue import lifecycle
from leaderboard.storage import seeds
from leaderboard.upkeep import pollers, store_check
from tests import builders
from tests.leaderboard.ops.test_health import write_event
from tests.leaderboard.web.maintain import queue_rows
from tests.pages import get

REPOSITORY = Path(__file__).resolve().parents[3]
[GROUP] = yaml.safe_load((REPOSITORY / "deploy/prometheus/rules.yml").read_text())["groups"]
RULES: dict[str, str] = {rule["alert"]: " ".join(rule["expr"].split()) for rule in GROUP["rules"]}
HOUR = timedelta(hours=1)

Figures = dict[tuple[str, frozenset[tuple[str, str]]], float]


# --- rules, as far as ours need Prometheus' language -------------------------------------------------------


class Selector(NamedTuple):
    """`name{label="value"}`, or `increase(name{…}[15m])`."""

    name: str
    labels: dict[str, re.Pattern[str]]
    is_increase: bool

    @classmethod
    def of(cls, text: str) -> "Selector":
        match = re.fullmatch(r"(increase\()?(\w+)(?:\{(.*)\})?(?:\[\d+[mhd]\]\))?", text)
        assert match, text
        labels = {}
        for label, how, value in re.findall(r'(\w+)(=~?)"([^"]*)"', match[3] or ""):
            labels[label] = re.compile(value if how == "=~" else re.escape(value))
        return cls(match[2], labels, bool(match[1]))

    def values(self, before: Figures, now: Figures) -> list[float]:
        """The value of each series that is selected."""
        values = []
        for (name, labels), value in now.items():
            have = dict(labels)
            if name == self.name and all(
                p.fullmatch(have.get(label, "")) for label, p in self.labels.items()
            ):
                # A series that appears now has not increased, as Prometheus counts.
                past = before.get((name, labels), value) if self.is_increase else 0.0
                values.append(value - past)
        return values


COMPARE: dict[str, Callable[[float, float], bool]] = {
    ">": lambda value, limit: value > limit,
    "<": lambda value, limit: value < limit,
    "==": lambda value, limit: value == limit,
}


def fires(rule: str, *, before: Figures, now: Figures) -> bool:
    """Evaluate a rule between two scrapes: comparisons that "and" joins."""
    for part in re.split(r" and ignoring\(\w+\) ", rule):
        match = re.fullmatch(r"(.+?) (>|<|==) (?:ignoring\(\w+\) )?(.+)", part)
        assert match, part
        right = match[3]
        is_number = re.fullmatch(r"[\d.e]+", right)
        limits = [float(right)] if is_number else Selector.of(right).values(before, now)
        values = Selector.of(match[1]).values(before, now)
        if not any(COMPARE[match[2]](value, limit) for value in values for limit in limits):
            return False
    return True


def scrape() -> Figures:
    """What Prometheus gets; of a site that does not answer, `up` alone."""
    answer = Client(raise_request_exception=False).get("/metrics")
    figures: Figures = {("up", frozenset({("job", "tsttc")})): float(answer.status_code == 200)}
    if answer.status_code == 200:
        for family in text_string_to_metric_families(answer.text):
            for sample in family.samples:
                figures[sample.name, frozenset(sample.labels.items())] = sample.value
    return figures


# --- the faults ------------------------------------------------------------------------------------------


@dataclass
class World:
    """A site on which everything is well, and what a test needs to spoil it."""

    edition: Edition
    owner: User
    settings: Settings
    patch: pytest.MonkeyPatch
    until_the_end: ExitStack

    @property
    def page(self) -> Client:
        client = Client(raise_request_exception=False)
        client.force_login(self.owner)
        return client

    def break_store(self) -> None:
        shutil.rmtree(self.settings.FILES_DIR)
        Path(self.settings.FILES_DIR).write_text("not a folder")


def _store_refuses_an_upload(world: World) -> None:
    data = builders.predictions(world.edition)
    world.break_store()
    form = {"split": "test", "method": "Foo", "file": SimpleUploadedFile("p.json", data)}
    assert world.page.post("/submit/", form).status_code == 503


def _store_cannot_be_written(world: World) -> None:
    world.break_store()
    for _ in range(3):
        store_check.check(now=timezone.now())


def _store_has_little_room(world: World) -> None:
    nearly_full = shutil._ntuple_diskusage(10**12, 10**12 - 10**9, 10**9)  # type: ignore[attr-defined]
    world.patch.setattr(shutil, "disk_usage", lambda _: nearly_full)
    store_check.check(now=timezone.now())


def _seed_key_is_lost(world: World) -> None:
    for factor in (1.1, 1.2):
        data = builders.predictions(world.edition, factor=factor)
        builders.submit(world.owner, data, method=f"Method {factor}")
    builders.score_all()
    seeds.path().write_text("damaged")
    for _ in range(faults.MIN_TIMES):
        builders.infer_all()
    Fault.objects.update(began_at=timezone.now() - HOUR)


def _answers_are_errors(world: World) -> None:
    world.break_store()
    for _ in range(6):
        assert world.page.get("/api/v1/splits/test/manifest").status_code == 503


def _workers_die(world: World) -> None:
    queue_rows.queued(world.edition, world.owner)
    for _ in range(lifecycle.MAX_INFRASTRUCTURE_STRIKES):
        queue_rows.make_due()
        queue_rows.give_back(queue_rows.claim())
    # It wipes the strikes of the evaluation, and nothing that the alarm counts.
    failed = Evaluation.objects.get()
    assert failed.status == "SYSTEM_ERROR"
    lifecycle.retry(evaluation=failed, actor=world.owner)


def _system_error(world: World) -> None:
    queue_rows.queued(world.edition, world.owner)
    queue_rows.strike_out()


def _file_waits(world: World) -> None:
    queue_rows.queued(world.edition, world.owner)
    Evaluation.objects.update(queued_at=Now() - HOUR)


def _mail_waits(world: World) -> None:
    _write_mail(world, queued_at=timezone.now() - 2 * HOUR)


def _mails_are_refused(world: World) -> None:
    for _ in range(7):
        mail = _write_mail(world, queued_at=timezone.now())
        Mail.objects.filter(pk=mail.pk).update(ended_at=timezone.now(), is_sent=False)


def _write_mail(world: World, *, queued_at: Any) -> Mail:
    key = f"test {Mail.objects.count()}"
    mail = outbox.notice(kind=MailKind.TOKEN, user=world.owner, key=key, subject="S", text="T", now=queued_at)
    outbox.queue([mail])
    return Mail.objects.get(key=key)


def _mail_server_takes_nothing(world: World) -> None:
    world.settings.EMAIL_BACKEND = "django.core.mail.backends.smtp.EmailBackend"
    world.settings.EMAIL_HOST, world.settings.EMAIL_PORT = "127.0.0.1", 1
    _write_mail(world, queued_at=timezone.now())
    assert outbox.work_off(now=timezone.now()) == 0
    Fault.objects.update(began_at=timezone.now() - 2 * HOUR)


def _backup_fails(world: World) -> None:
    run = backup_runs.begin(timezone.now())
    backup_runs.finish(run, now=timezone.now(), is_ok=False, fault="the disk is full")


def _backup_is_old(world: World) -> None:
    BackupRun.objects.update(started_at=timezone.now() - 60 * HOUR, finished_at=timezone.now() - 59 * HOUR)


def _broker_is_away(world: World) -> None:
    world.patch.setattr(health, "CHECK_TIMEOUT_S", 0.5)
    world.settings.CELERY_BROKER_URL = "redis://127.0.0.1:1/0"


def _boards_are_slow(world: World) -> None:
    for _ in range(21):
        prometheus.count(method="GET", route="board", status=200, took_s=1.5)


def _event_is_not_sealed(world: World) -> None:
    write_event(timezone.now() - HOUR)


def _nobody_sweeps(world: World) -> None:
    SweepBeat.objects.update(swept_at=Now() - timedelta(minutes=5))


def _nobody_ever_swept(world: World) -> None:
    SweepBeat.objects.all().delete()


def _nobody_cleans(world: World) -> None:
    SweepBeat.objects.update(cleaned_at=timezone.now() - timedelta(days=2))


def _database_is_away(world: World) -> None:
    def refuse(*_: object) -> object:
        raise OperationalError("server closed the connection unexpectedly")

    world.until_the_end.enter_context(connection.execute_wrapper(refuse))


FAULTS: list[tuple[str, Callable[[World], None]]] = [
    ("TsttcDown", _database_is_away),
    ("TsttcNobodySweeps", _nobody_sweeps),
    ("TsttcNobodySweeps", _nobody_ever_swept),
    ("TsttcQueueWaits", _file_waits),
    ("TsttcSystemErrors", _system_error),
    ("TsttcUploadsRefused", _store_refuses_an_upload),
    ("TsttcStoreFails", _store_cannot_be_written),
    ("TsttcStoreFull", _store_has_little_room),
    ("TsttcStatisticsFail", _seed_key_is_lost),
    ("TsttcBackupFails", _backup_fails),
    ("TsttcBackupOld", _backup_is_old),
    ("TsttcBrokerDown", _broker_is_away),
    ("TsttcInfrastructureStrikes", _workers_die),
    ("TsttcServerErrors", _answers_are_errors),
    ("TsttcSlow", _boards_are_slow),
    ("TsttcMailsWait", _mail_waits),
    ("TsttcMailServerFails", _mail_server_takes_nothing),
    ("TsttcMailsRefused", _mails_are_refused),
    ("TsttcAuditUnsealed", _event_is_not_sealed),
    ("TsttcNobodyCleans", _nobody_cleans),
]

# What each fault is called at /healthy, and on the maintainers' page.
NAMES: dict[str, tuple[str, str]] = {
    "TsttcNobodySweeps": ("sweep", "Workers"),
    "TsttcQueueWaits": ("queue", "Queue"),
    "TsttcSystemErrors": ("system errors", "Queue"),
    "TsttcUploadsRefused": ("uploads", "Uploads"),
    "TsttcStoreFails": ("file store", "File store"),
    "TsttcStoreFull": ("free space", "File store"),
    "TsttcStatisticsFail": ("statistics", "Statistics"),
    "TsttcBackupFails": ("backup", "Backups"),
    "TsttcBackupOld": ("backup", "Backups"),
    "TsttcBrokerDown": ("broker", "Broker"),
    "TsttcMailsWait": ("mail", "Emails"),
    "TsttcMailServerFails": ("mail", "Emails"),
    "TsttcMailsRefused": ("refused mails", "Emails"),
    "TsttcAuditUnsealed": ("audit log", "Audit log"),
    "TsttcNobodyCleans": ("cleaning", "Unused files"),
}
# The first is the page's own database; the others are figures of processes, or of minutes.
WITHOUT_NAME = {"TsttcDown", "TsttcInfrastructureStrikes", "TsttcServerErrors", "TsttcSlow"}


@pytest.fixture
def world(
    edition: Edition, owner: User, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> Iterator[World]:
    """A site that a worker has just looked after, with a good backup."""
    settings.SENDS_MAIL = True
    pollers.sweep(rng=random.Random(0))
    pollers.clean(now=timezone.now())
    store_check.check(now=timezone.now())
    run = backup_runs.begin(timezone.now())
    backup_runs.finish(run, now=timezone.now(), is_ok=True, n_files=1)
    with ExitStack() as until_the_end:
        yield World(
            edition=edition, owner=owner, settings=settings, patch=monkeypatch, until_the_end=until_the_end
        )


def test_every_alarm_has_a_fault_that_is_brought_about() -> None:
    assert {alert for alert, _ in FAULTS} == set(RULES) == NAMES.keys() | WITHOUT_NAME


@pytest.mark.slow
def test_no_alarm_fires_on_a_site_on_which_all_is_well(world: World) -> None:
    figures = scrape()
    assert [alert for alert, rule in RULES.items() if fires(rule, before=figures, now=figures)] == []


@pytest.mark.slow
@pytest.mark.parametrize(("alert", "spoil"), FAULTS, ids=lambda each: getattr(each, "__name__", each))
def test_the_alarm_fires_once_its_fault_is_there(
    world: World, alert: str, spoil: Callable[[World], None]
) -> None:
    before = scrape()
    assert not fires(RULES[alert], before=before, now=before)
    spoil(world)
    assert fires(RULES[alert], before=before, now=scrape())


@pytest.mark.slow
@pytest.mark.django_db(transaction=True)
@pytest.mark.parametrize(
    ("alert", "spoil"),
    [(alert, spoil) for alert, spoil in FAULTS if alert in NAMES],
    ids=lambda each: getattr(each, "__name__", each),
)
def test_the_fault_of_an_alarm_is_named_by_health_and_on_the_maintainers_page(
    world: World, keeper: Client, alert: str, spoil: Callable[[World], None]
) -> None:
    kind, line = NAMES[alert]
    assert _unwell() == set()
    assert not _bad_lines(keeper)
    spoil(world)
    assert kind in _unwell()
    assert line in _bad_lines(keeper)


def _unwell() -> set[str]:
    return {check.name for check in health.checks() if not check.is_ok}


def _bad_lines(keeper: Client) -> set[str]:
    root = get(keeper, "/maintain/")
    tiles = {tile.one("a").text for tile in root.all("li", class_="bad")}
    listed = next(each for each in root.all("dl") if "Workers" in each.text)
    pairs = zip(listed.all("dt"), listed.all("dd"), strict=True)
    return tiles | {name.text for name, text in pairs if "bad" in text.classes}
