"""Bring an empty database to an older release's tables, fill them, and migrate: `python -m tests.upgrade`.

For a process of its own, with `TSTTC_DATABASE_URL` of an empty database. It prints what became of the rows
as JSON.
"""

import json
import os
from datetime import timedelta
from importlib import import_module
from typing import Any

import django
from django.apps import apps as present
from django.core.management import call_command
from django.db import connection
from django.db.migrations.executor import MigrationExecutor
from django.utils import timezone

OLD = "0012_times_of_boards"
DAY = timedelta(days=1)


def fill(apps: Any) -> None:
    """Rows that are hard to migrate: rules without sense, a board that was rolled back, no evaluation."""
    now = timezone.now()

    def make(model: str, **fields: Any) -> Any:
        return apps.get_model("leaderboard", model).objects.create(**fields)

    user = make("User", email="ada+ci@example.org")
    team = make("Team", name="Owls", look="owls")
    audit = import_module("leaderboard.models.audit")
    tip = audit.GENESIS
    for number in range(3):
        said = {"at": now, "verb": "tried", "noun": "Door", "noun_id": str(number), "details": {}}
        new = audit.chained_hash(previous_hash=tip, actor_id=user.pk, **said)
        make("AuditEvent", actor=user, **said, previous_hash=tip, hash=new)
        tip = new
    method = make("Method", team=team, name="Owl", visibility="PUBLIC", shown_at=now)
    split = apps.get_model("leaderboard", "Split").objects.get(pk="test")
    split.quota_window, split.quota_min_gap = timedelta(0), timedelta(days=99_999)
    split.opens_at, split.closes_at = now, now - DAY
    make("QuotaOverride", team=team, split=split, quota_window=-DAY, reason="A study.")
    editions: list[Any] = []
    for number in (1, 2):
        truth = make(
            "GroundTruth",
            digest=f"sha256:truth {number}",
            manifest_digest=f"manifest {number}",
            split=split,
            n_sequences=9,
            n_recordings=9,
            counts={},
            **({"compared_with": editions[0].ground_truth, "n_added": 1} if editions else {}),
        )
        fields = {"split": split, "number": number, "protocol": "tsttc-1", "published_at": now}
        editions.append(make("Edition", ground_truth=truth, **fields))
    first, second = editions
    for days, edition in ((9, first), (6, second), (3, first)):
        make("Publication", split=split, edition=edition, at=now - days * DAY, reason="R", kind="PUBLISHED")
    split.published_edition = first
    split.save()
    # While the first, the second and again the first was the board; the last one was never evaluated.
    for days, of in ((8, editions), (5, editions), (1, [first]), (0, [])):
        submission = make(
            "Submission",
            split=split,
            method=method,
            submitted_by=user,
            submitted_at=now - days * DAY,
            via="API",
            digest=f"sha256:{days}",
            size_bytes=1,
        )
        for edition in of:
            make("Evaluation", submission=submission, edition=edition, status="CANCELLED", finished_at=now)


def main() -> None:
    """Migrate, fill, migrate, and tell."""
    os.environ.setdefault("DJANGO_SETTINGS_MODULE", "leaderboard.settings")
    django.setup()
    call_command("migrate", "leaderboard", OLD, verbosity=0)
    fill(MigrationExecutor(connection).loader.project_state([("leaderboard", OLD)]).apps)
    call_command("migrate", verbosity=0)

    def rows(model: str, field: str, order: str = "pk") -> list[object]:
        return list(
            present.get_model("leaderboard", model).objects.order_by(order).values_list(field, flat=True)
        )

    split = present.get_model("leaderboard", "Split").objects.get(pk="test")
    audit = import_module("leaderboard.audit")
    audit.record(verb="tried", noun="Door", noun_id="new")
    audit.seal()
    chain = audit.verify()
    found = {
        "manifests": rows("Submission", "manifest_digest", "submitted_at"),
        "n_added": rows("TruthComparison", "n_added"),
        "decimals": [split.decimals, *rows("Edition", "decimals")],
        "rules": [split.quota_window.days, split.quota_min_gap.days, split.closes_at],
        "is_shown": rows("Team", "is_shown"),
        "mailboxes": rows("User", "mailbox"),
        "audit": [chain.n_events, list(chain.breaks)],
    }
    print(json.dumps(found))  # noqa: T201 - for whoever started this


if __name__ == "__main__":
    main()
