"""The state of the site on the maintainers' hub: calm while all is well, with reasons when it is not."""

import random
from datetime import timedelta

import pytest
from django.test import Client
from django.utils import timezone
from pytest_django import Settings

from leaderboard.models import Installation, Mail, MailKind, SweepBeat
from leaderboard.ops import backup_runs, faults
from leaderboard.upkeep import pollers, store_check
from tests.pages import get

HOUR = timedelta(hours=1)


def state(keeper: Client) -> dict[str, tuple[str, bool]]:
    """Text of each line, and whether it is marked as bad."""
    listed = next(each for each in get(keeper, "/maintain/").all("dl") if "Workers" in each.text)
    names, texts = listed.all("dt"), listed.all("dd")
    return {
        name.text: (text.text, text.attributes.get("class") == "bad")
        for name, text in zip(names, texts, strict=True)
    }


@pytest.mark.slow
def test_a_site_on_which_all_is_well_has_no_bad_line(keeper: Client, settings: Settings) -> None:
    settings.SENDS_MAIL = True
    pollers.sweep(rng=random.Random(0))
    store_check.check(now=timezone.now())
    shown = state(keeper)
    assert list(shown) == [
        *("Workers", "Broker", "Ground truth", "File store", "Unused files", "Uploads"),
        *("Statistics", "Backups", "Emails", "Audit log"),
    ]
    assert not [name for name, (_, is_bad) in shown.items() if is_bad]
    run = backup_runs.begin(timezone.now() - 6 * HOUR)
    backup_runs.finish(run, now=timezone.now() - 5 * HOUR, is_ok=True, n_files=1768)
    assert "the last good one ended 5 h ago, with 1,768 files" in state(keeper)["Backups"][0].replace(
        "6 h", "5 h"
    )


def test_each_fault_is_marked_and_has_its_reason(keeper: Client, settings: Settings) -> None:
    settings.SENDS_MAIL = True
    now = timezone.now()
    faults.note(faults.STORE, reason="StoreUnavailable: [Errno 30] read-only", now=now)
    faults.note(faults.UPLOADS, reason="503 store-unavailable", now=now)
    for subject in ("test edition 1", "val edition 2"):
        for _ in range(faults.MIN_TIMES):
            faults.note(faults.INTERVALS, subject=subject, reason="NoSecret: <seed.key>", now=now)
    for hours in (40, 16):
        run = backup_runs.begin(now - hours * HOUR)
        backup_runs.finish(run, now=now - hours * HOUR, is_ok=False, fault="predictions/ab.json is damaged")
    Mail.objects.create(kind=MailKind.ACCOUNT, recipient="a@example.org", queued_at=now - 3 * HOUR)
    shown = state(keeper)
    bad = {name for name, (_, is_bad) in shown.items() if is_bad}
    assert bad == {"Workers", "File store", "Uploads", "Statistics", "Backups", "Emails"}
    assert "no worker" in shown["Workers"][0]
    assert "read-only" in shown["File store"][0]
    assert "1 upload refused because of an error of the site" in shown["Uploads"][0]
    for subject in ("test edition 1", "val edition 2"):
        assert f"intervals of {subject} fail, 3 times in" in shown["Statistics"][0]
    assert "NoSecret: <seed.key>" in shown["Statistics"][0]
    assert "there is no good one; 2 backups failed" in shown["Backups"][0]
    assert "predictions/ab.json is damaged" in shown["Backups"][0]
    assert "1 waiting, the oldest for" in shown["Emails"][0]


def test_little_room_is_marked(keeper: Client) -> None:
    pollers.sweep(rng=random.Random(0))
    SweepBeat.objects.update(store_checked_at=timezone.now(), store_free_bytes=10**9)
    text, is_bad = state(keeper)["File store"]
    assert text.endswith("room for 1.0 GB")
    assert is_bad


def test_ground_truth_broker_and_a_store_of_another_site_have_their_numbers(
    keeper: Client, settings: Settings
) -> None:
    pollers.sweep(rng=random.Random(0))
    SweepBeat.objects.update(n_out_of_reach=2, clean_begun_at=timezone.now())
    Installation.objects.create(store_is_of="another-site")
    settings.CELERY_BROKER_URL = "redis://127.0.0.1:1/0"
    shown = state(keeper)
    assert shown["Broker"] == ("does not answer: files are scored some seconds later", True)
    assert shown["Ground truth"] == ("no worker can read it: 2 files wait", True)
    text, is_bad = shown["Unused files"]
    assert "belongs to another site (another-site)" in text
    assert is_bad
