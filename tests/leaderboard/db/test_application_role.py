"""The role of web and workers on PostgreSQL: it does all their work, and cannot touch the audit log."""

import random
import secrets
import threading
from collections.abc import Iterator
from io import StringIO
from pathlib import Path

import pytest
from django.apps import apps
from django.core.management import CommandError, call_command
from django.db import IntegrityError, ProgrammingError, connection, transaction
from django.test import Client
from django.utils import timezone
from pytest_django import Settings

from leaderboard import audit
from leaderboard.management.commands.grant import ONLY, make_role
from leaderboard.methods import visibility
from leaderboard.models import AuditEvent, Edition, Status, Submission, SweepBeat, User
from leaderboard.models.audit import GENESIS
from leaderboard.upkeep import pollers
from tests import builders
from tests.editions import corrected, open_edition, publish

POSTGRESQL_ONLY = pytest.mark.skipif(
    "connection.vendor != 'postgresql'", reason="runs with: python -m tests.everything"
)


def grant() -> str:
    """What the command prints."""
    out = StringIO()
    call_command("grant", stdout=out)
    return out.getvalue()


@pytest.fixture
def as_application(db: None, settings: Settings) -> Iterator[None]:
    """From here on every statement is the application role's."""
    role = f"tsttc_application_{secrets.token_hex(4)}"
    settings.APPLICATION_ROLE, settings.APPLICATION_PASSWORD = role, 'it\'s a "secret"'
    for _ in range(2):  # after each migration
        assert grant() == f"The role {role} may do what the application does.\n"
    with connection.cursor() as cursor:
        cursor.execute(f"SET ROLE {role}")
    yield
    with connection.cursor() as cursor:
        cursor.execute("RESET ROLE")
        cursor.execute(f"DROP OWNED BY {role}")
        cursor.execute(f"DROP ROLE {role}")


@POSTGRESQL_ONLY
def test_an_owner_who_is_no_superuser_grants_again_after_each_migration(db: None, settings: Settings) -> None:
    mark = secrets.token_hex(4)
    role = settings.APPLICATION_ROLE = f"tsttc_application_{mark}"
    settings.APPLICATION_PASSWORD = "changed"
    with connection.cursor() as cursor:
        cursor.execute(f"CREATE ROLE tsttc_owner_{mark} CREATEROLE")
        cursor.execute(f"SET LOCAL ROLE tsttc_owner_{mark}")
        for _ in range(2):
            make_role(role, password="changed")
        cursor.execute("RESET ROLE")
        cursor.execute(f"ALTER ROLE {role} WITH SUPERUSER BYPASSRLS")
        cursor.execute(f"SET LOCAL ROLE tsttc_owner_{mark}")
        with pytest.raises(CommandError) as caught:
            make_role(role, password="changed")
        assert f"The role {role} has SUPERUSER and BYPASSRLS; expected neither" in str(caught.value)
        assert str(caught.value).endswith(f"ALTER ROLE {role} WITH NOSUPERUSER NOBYPASSRLS.")
        cursor.execute("RESET ROLE")
        make_role(role, password="changed")
        cursor.execute("SELECT rolsuper, rolbypassrls FROM pg_roles WHERE rolname = %s", [role])
        assert cursor.fetchone() == (False, False)


@POSTGRESQL_ONLY
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
    assert audit.seal() > 3
    assert (audit.verify().unsealed.n_events, audit.verify().breaks) == (0, ())


@POSTGRESQL_ONLY
def test_it_does_what_workers_do_by_the_clock_and_shows_every_page_of_maintainers(
    edition: Edition, owner: User, maintainer: User, as_application: None
) -> None:
    builders.submit(owner, builders.predictions(edition))
    pollers.keep_up(rng=random.Random(0), stopping=threading.Event())
    assert SweepBeat.objects.get().cleaned_at is not None
    assert (audit.verify().unsealed.n_events, audit.verify().breaks) == (0, ())
    client = Client()
    client.force_login(maintainer)
    for name in ("", "audit/", "teams/", "mails/", "queue/", "quotas/", "published/", "splits/add/"):
        assert client.get(f"/maintain/{name}").status_code == 200, name


@POSTGRESQL_ONLY
def test_it_reads_and_writes_every_table_but_the_two_that_are_guarded(as_application: None) -> None:
    tables = {model._meta.db_table for model in apps.get_models(include_auto_created=True)}
    tables |= {"leaderboard_cache"}
    lacking = {}
    with connection.cursor() as cursor:
        for table in tables - set(ONLY):
            rights = ("SELECT", "INSERT", "UPDATE", "DELETE")
            cursor.execute(
                f"SELECT {', '.join(f'has_table_privilege(%s, {right!r})' for right in rights)}",
                [table] * len(rights),
            )
            if missing := [right for right, has in zip(rights, cursor.fetchone(), strict=True) if not has]:
                lacking[table] = missing
    assert lacking == {}


@POSTGRESQL_ONLY
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
        # A number that the sequence has yet to give: the action that gets it would fail.
        "INSERT INTO leaderboard_auditevent (id, at, verb, noun, noun_id, details) "
        "VALUES (1000000, now(), 'tried', 'Team', '2', '{}')",
        "SELECT setval(pg_get_serial_sequence('leaderboard_auditevent', 'id'), 9223372036854775807)",
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
    assert audit.seal() == audit.verify().n_events == 1


def seal_in_sql(event: AuditEvent, *, number: int, after: str, hash_: str) -> None:
    with connection.cursor() as cursor:
        cursor.execute(
            "UPDATE leaderboard_auditevent SET seal_number = %s, previous_hash = %s, hash = %s WHERE id = %s",
            [number, after, hash_, event.pk],
        )


def recorded(number: int = 1) -> AuditEvent:
    return audit.record(verb="tried", noun="Team", noun_id=number)


@POSTGRESQL_ONLY
def test_an_event_that_it_seals_with_another_hash_is_named_and_sealing_goes_on(
    owner: User, as_application: None
) -> None:
    recorded()
    audit.seal()
    tip = audit.verify().tip
    forged = [recorded(2), recorded(3)]
    seal_in_sql(forged[0], number=2, after=tip, hash_="b" * 64)
    seal_in_sql(forged[1], number=3, after="b" * 64, hash_="a" * 64)
    for number in range(2):
        recorded(number)
        assert audit.seal() == 1
    verification = audit.verify()
    assert verification.n_events == 5
    assert [(each.event_id, each.what) for each in verification.breaks] == [
        (event.pk, "says something else than when it was written") for event in forged
    ]


@POSTGRESQL_ONLY
@pytest.mark.parametrize("n_sealed", [0, 2])
def test_it_gives_no_event_a_hash_that_none_could_follow(n_sealed: int, as_application: None) -> None:
    for _ in range(n_sealed):
        recorded()
    audit.seal()
    tip = audit.verify().tip
    forged = recorded()
    sealed = AuditEvent.objects.exclude(hash=None)
    for hash_ in {GENESIS, tip, *sealed.values_list("hash", flat=True)}:
        with pytest.raises(IntegrityError), transaction.atomic():
            seal_in_sql(forged, number=n_sealed + 1, after=tip, hash_=hash_)
    assert audit.seal() == 1
    recorded()
    assert audit.seal() == 1
    assert audit.verify().breaks == ()


@POSTGRESQL_ONLY
def test_an_event_whose_hash_it_has_taken_beforehand_waits_alone(
    as_application: None, caplog: pytest.LogCaptureFixture
) -> None:
    """It knows the next event, so it can choose a tip whose next hash is there already."""
    forged, waiting = [recorded(1), recorded(2)], recorded(3)
    waiting.refresh_from_db()
    tip = "a" * 64
    taken = waiting.hash_after(tip)
    seal_in_sql(forged[0], number=1, after=GENESIS, hash_=taken)
    seal_in_sql(forged[1], number=2, after=taken, hash_=tip)
    assert audit.seal() == 0
    assert "audit_event_not_sealed" in caplog.text
    after_it = [recorded(4), recorded(5)]
    assert audit.seal() == 2
    assert audit.seal() == 1
    in_order = AuditEvent.objects.order_by("seal_number")
    assert [event.pk for event in in_order] == [event.pk for event in (*forged, *after_it, waiting)]
    assert {each.event_id for each in audit.verify().breaks} == {event.pk for event in forged}


def test_without_a_role_nothing_is_granted_and_without_a_password_nothing_is_made(
    db: None, settings: Settings
) -> None:
    assert grant() == "TSTTC_APPLICATION_ROLE is not set: the application works as the owner.\n"
    settings.APPLICATION_ROLE = "tsttc_application"
    with pytest.raises(CommandError, match=r"has no roles|TSTTC_APPLICATION_PASSWORD is not set"):
        grant()
