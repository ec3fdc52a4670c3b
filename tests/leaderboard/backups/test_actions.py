"""What a restore undoes is listed: from a newer database, or from an export of its audit log."""

import json
import sqlite3
from pathlib import Path

import pytest
from django.core.management import CommandError, call_command
from django.db import connection
from django.test import Client
from django.utils import timezone

from leaderboard import audit
from leaderboard.backups import actions
from leaderboard.backups.actions import Event
from leaderboard.models import ApiToken, AuditEvent, Edition, Submission, Team, User
from leaderboard.moderation import forgetting, hiding
from leaderboard.people import tokens
from leaderboard.submissions import intake
from tests import builders

pytestmark = pytest.mark.django_db


def events_now() -> list[Event]:
    return actions.events_of("default")


def forget_since(n_events: int) -> None:
    """Let the log be that of a backup with n events; rows stay, as `undo` lets them come back."""
    last = AuditEvent.objects.order_by("pk")[n_events - 1].pk if n_events else 0
    with connection.cursor() as cursor:
        if connection.vendor == "postgresql":
            cursor.execute("SET CONSTRAINTS ALL IMMEDIATE")
            cursor.execute("ALTER TABLE leaderboard_auditevent DISABLE TRIGGER audit_append_only")
        cursor.execute("DELETE FROM leaderboard_auditevent WHERE id > %s", [last])


def test_what_protects_people_comes_first_and_is_named(
    entries: list[Submission], owner: User, stranger: User, team: Team, maintainer: User
) -> None:
    keys = [builders.token(user) for user in (owner, stranger)]
    assert len(set(keys)) == 2
    n_events = AuditEvent.objects.count()
    now = timezone.now()
    for token in ApiToken.objects.all():
        tokens.revoke(token=token, now=now, actor=token.user)
    hidden, withdrawn = entries[:2]
    reason = {"reason": "It was copied.", "actor": maintainer}
    hiding.withdraw_entry(submission=hidden, now=now, is_hidden=True, **reason)
    intake.withdraw(submission=withdrawn, actor=owner, now=now)
    hiding.set_active(user=stranger, is_active=False, **reason)
    hiding.clear_texts(method=hidden.method, **reason)
    hiding.rename_team(team=team, name="Eagles", now=now, **reason)
    audit.record(verb="edited", noun="Page", noun_id="rules", actor=maintainer)
    later = builders.submit(owner, b"{}", method="Later")
    intake.withdraw(submission=later, actor=owner, now=now)
    newer = events_now()
    forget_since(n_events)
    Submission.objects.get(pk=later.pk).evaluations.all().delete()
    Submission.objects.filter(pk=later.pk).delete()

    missing = actions.since_backup(newer)

    text = "\n".join(missing.first)
    for expected in (
        f"ApiToken 'CI' of {owner.email}: revoked",
        f"ApiToken 'CI' of {stranger.email}: revoked",
        f"Submission {hidden.pk} of {hidden.method.name!r}: hidden, by {maintainer.email}",
        "(reason: It was copied.)",
        f"Submission {withdrawn.pk} of {withdrawn.method.name!r}: withdrawn, by {owner.email}",
        f"User {stranger.email}: closed",
        f"Method {hidden.method.name} ({hidden.method_id}): cleared",
    ):
        assert expected in text
    rest = "\n".join(missing.rest)
    assert f"Team {team.name} ({team.pk}): renamed" not in text
    assert "renamed" in rest
    assert "Eagles" in rest
    assert "Page rules: edited" in rest
    # It was sent after the backup, so nothing of it is undone; only its team can send it again.
    assert str(later.pk) not in text + rest
    assert missing.lost == {"Submission submitted": 1}
    assert actions.since_backup(events_now()).lines() == ["Nothing is to be done again."]


def test_a_forgotten_person_is_named_by_the_address_that_came_back(
    owner: User, stranger: User, maintainer: User
) -> None:
    n_events = AuditEvent.objects.count()
    address = stranger.email
    forgetting.forget(user=stranger, reason="They asked.", actor=maintainer, now=timezone.now())
    newer = events_now()
    forget_since(n_events)
    User.objects.filter(pk=stranger.pk).update(email=address, is_active=True)
    [line] = [line for line in actions.since_backup(newer).first if "forgotten" in line]
    assert f"User {address}: forgotten" in line


def test_an_action_that_nobody_thought_of_is_listed(edition: Edition) -> None:
    at = timezone.now()
    event = Event(at, "juggled", "Split", "test", "", {})
    assert actions.since_backup([event]).rest == [f"  {at:%Y-%m-%d %H:%M} UTC: Split test: juggled"]


def test_the_export_of_the_page_is_read(
    edition: Edition,
    owner: User,
    maintainer: User,
    client: Client,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    builders.token(owner)
    n_events = AuditEvent.objects.count()
    tokens.revoke(token=ApiToken.objects.get(), now=timezone.now(), actor=owner)
    client.force_login(maintainer)
    answer = client.get("/maintain/audit/events.json")
    path = tmp_path / "audit.json"
    path.write_bytes(b"".join(answer.streaming_content))  # type: ignore[attr-defined]  # it streams
    assert len(json.loads(path.read_text())) == n_events + 1
    forget_since(n_events)
    call_command("list_actions", audit=str(path))
    output = capsys.readouterr().out
    assert "To be done again first" in output
    assert f"ApiToken 'CI' of {owner.email}: revoked" in output
    for text in ("{", "[1]", '[{"at": 1}]'):
        path.write_text(text)
        with pytest.raises(CommandError, match="is no export of the audit log"):
            call_command("list_actions", audit=str(path))


def test_a_database_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(CommandError, match="is not understood"):
        call_command("list_actions", database="nonsense")
    if connection.vendor == "sqlite":
        (tmp_path / "other.sqlite3").write_bytes(b"")
        with pytest.raises(CommandError, match=r"other\.sqlite3 cannot be read: no such table"):
            call_command("list_actions", database=f"sqlite:///{tmp_path}/other.sqlite3")


@pytest.mark.skipif("connection.vendor != 'sqlite'")
def test_another_password_or_address_in_the_newer_database_is_listed(
    owner: User, stranger: User, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "newer.sqlite3"
    path.write_bytes(connection.connection.serialize())
    with sqlite3.connect(path) as newer:
        newer.execute("UPDATE leaderboard_user SET password = 'x' WHERE email = ?", [owner.email])
    newer.close()
    call_command("list_actions", database=f"sqlite:///{path}")
    output = capsys.readouterr().out
    assert f"{owner.email}: password\n" in output
    assert stranger.email not in output
