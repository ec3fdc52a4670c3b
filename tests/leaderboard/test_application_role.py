"""The role of web and workers on PostgreSQL: it does all their work, and cannot touch the audit trail."""

import secrets
from collections.abc import Iterator
from pathlib import Path

import pytest
from django.db import ProgrammingError, connection, transaction
from django.test import Client
from django.utils import timezone

from leaderboard import audit, visibility
from leaderboard.management.commands.grant import grant_to, make_role
from leaderboard.models import Edition, Status, Submission, User
from tests import builders
from tests.editions import corrected, open_edition, publish

pytestmark = pytest.mark.skipif(
    "connection.vendor != 'postgresql'", reason="runs with: python -m tests.on_postgresql"
)


@pytest.fixture
def as_application(db: None) -> Iterator[None]:
    """From here on every statement is the application role's."""
    role = f"tsttc_application_{secrets.token_hex(4)}"
    make_role(role, password=secrets.token_hex(8))
    grant_to(role)
    grant_to(role)  # after each migration
    with connection.cursor() as cursor:
        cursor.execute(f"SET ROLE {role}")
    yield
    with connection.cursor() as cursor:
        cursor.execute("RESET ROLE")
        cursor.execute(f"DROP OWNED BY {role}")
        cursor.execute(f"DROP ROLE {role}")


def test_it_submits_scores_shows_publishes_and_reads_like_the_owner(
    edition: Edition, owner: User, tmp_path: Path, as_application: None
) -> None:
    submission = builders.submit(owner, builders.predictions(edition))
    builders.score_all()
    assert Submission.objects.get().evaluations.get().status == Status.SCORED
    visibility.change(method=submission.method, visibility="PUBLIC", actor=owner, now=timezone.now())
    candidate = open_edition(corrected(tmp_path, factor=1.2))
    builders.score_all()
    publish(candidate)
    visitor = Client()
    assert {visitor.get(page).status_code for page in ("/", "/api/v1/splits/test/board", "/feed.atom")} == {
        200
    }
    form = {"login": owner.email, "password": "correct horse"}
    assert visitor.post("/accounts/login/", form).status_code == 302
    assert visitor.get("/team/").status_code == 200
    assert audit.verify().n_events > 3


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE leaderboard_auditevent SET verb = 'never'",
        "DELETE FROM leaderboard_auditevent",
        "TRUNCATE leaderboard_auditevent",
        "ALTER TABLE leaderboard_auditevent DISABLE TRIGGER ALL",
        "DROP TRIGGER audit_append_only ON leaderboard_auditevent",
        "DROP TABLE leaderboard_auditevent",
        "CREATE OR REPLACE FUNCTION leaderboard_audit_append_only() RETURNS trigger LANGUAGE plpgsql AS "
        "'BEGIN RETURN NULL; END'",
        "SET session_replication_role = replica",
        "DELETE FROM django_migrations",
    ],
)
def test_it_can_neither_change_the_trail_nor_take_its_guard_off(
    statement: str, owner: User, as_application: None
) -> None:
    audit.record(verb="tried", noun="Team", noun_id="1", actor=owner)
    with (
        pytest.raises(ProgrammingError, match=r"permission denied|must be owner"),
        transaction.atomic(),
        connection.cursor() as cursor,
    ):
        cursor.execute(statement)
    assert audit.verify().n_events == 1
