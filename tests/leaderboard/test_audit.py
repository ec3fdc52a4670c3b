"""The audit log: append-only, and sealed into a chain that shows what was done to it."""

import random
import threading
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from datetime import timedelta
from io import StringIO
from typing import Any

import pytest
from django.core.management import CommandError, call_command
from django.db import IntegrityError, connection, transaction
from django.db.migrations.executor import MigrationExecutor
from django.utils import timezone

from leaderboard import audit
from leaderboard.models import AuditEvent, Edition, Evaluation, SweepBeat, User
from leaderboard.models.audit import GENESIS, AppendOnly
from leaderboard.upkeep import pollers
from tests import builders

SQLITE_ONLY = pytest.mark.skipif("connection.vendor != 'sqlite'", reason="there the database refuses it")
POSTGRESQL_ONLY = pytest.mark.skipif(
    "connection.vendor != 'postgresql'", reason="only PostgreSQL refuses what is asked for in SQL"
)

WHOLE = "seal_number = 1, previous_hash = repeat('0', 64), hash = repeat('a', 64)"
"""The seal of the first event, in SQL; that the hash is another one shows `verify`."""


def record(n: int = 1, **fields: Any) -> AuditEvent:
    """Write `n` events; returns the last."""
    for number in range(n):
        event = audit.record(
            **{"verb": "tried", "noun": "Door", "noun_id": number, "details": {"try": number}, **fields}
        )
    return event


def sealed(n: int = 1, **fields: Any) -> AuditEvent:
    """The same, and seal all that there is."""
    event = record(n, **fields)
    audit.seal()
    return AuditEvent.objects.get(pk=event.pk)


def in_sql(statement: str, *values: str | int | None) -> None:
    with connection.cursor() as cursor:
        cursor.execute(statement, values)


def verify_audit(*arguments: str) -> str:
    out = StringIO()
    call_command("verify_audit", *arguments, stdout=out)
    return out.getvalue().strip()


# --- the chain -------------------------------------------------------------------------------------------


def test_each_sealed_event_is_bound_to_the_one_before_it(owner: User) -> None:
    hashes = AuditEvent.objects.order_by("seal_number").values_list("seal_number", "previous_hash", "hash")
    sealed(2, actor=owner)
    sealed(actor=owner)
    assert [row[0] for row in hashes] == [1, 2, 3]
    (_, first, one), (_, second, two), (_, third, _) = hashes
    assert (first, second, third) == (GENESIS, one, two)


@pytest.mark.slow
def test_events_written_together_are_sealed_in_their_order(db: None) -> None:
    sealed()
    audit.record_many(("scored", "Evaluation", number, {"attempt": 1}) for number in range(500))
    sealed()
    in_order = AuditEvent.objects.order_by("seal_number").values_list("noun_id", flat=True)
    assert list(in_order[1:501]) == [str(number) for number in range(500)]
    verification = audit.verify()
    assert (verification.n_events, verification.breaks, verification.unsealed.n_events) == (502, (), 0)


def test_an_event_that_is_committed_late_is_sealed_after_the_others(db: None) -> None:
    """By then events with greater ids and later moments are sealed, and it follows them."""
    sealed(3)
    late = AuditEvent.objects.create(
        pk=-1, at=timezone.now() - timedelta(hours=1), verb="tried", noun="Door", noun_id="late"
    )
    assert audit.seal() == 1
    late.refresh_from_db()
    assert late.seal_number == 4
    assert (audit.verify().n_events, audit.verify().breaks) == (4, ())
    assert audit.seal() == 0


def test_every_sweep_seals(db: None) -> None:
    record(3)
    pollers.sweep(rng=random.Random(0))
    assert AuditEvent.objects.unsealed().n_events == 0
    assert audit.verify().n_events == 3


@pytest.mark.parametrize(
    "details",
    [
        {"text": "τ, “quoted”, 😀", "number": 10**25, "nothing": None, "yes": True, "list": [1, [], {}]},
        {"b": 1, "a": 2, "": "", "cut": "a\x00b\ud800c"},
    ],
)
def test_details_come_back_as_they_were_hashed(db: None, details: dict[str, Any]) -> None:
    sealed(details=details, noun_id="a\x00b")
    assert (audit.verify().n_events, audit.verify().breaks) == (1, ())


@pytest.mark.parametrize("value", [1.5, float("nan"), b"bytes", timezone.now(), {"in": [0.1]}])
def test_details_that_databases_give_back_differently_are_refused(db: None, value: object) -> None:
    with pytest.raises(TypeError, match="expected texts or whole numbers"):
        record(details={"value": value})
    assert not AuditEvent.objects.exists()


def test_the_outcome_of_a_run_is_bound_by_the_digest_of_its_report(edition: Edition, owner: User) -> None:
    builders.submit(owner, builders.predictions(edition))
    builders.score_all()
    row = Evaluation.objects.get()
    event = AuditEvent.objects.get(verb="scored")
    assert event.details == {"attempt": 1, "report_digest": row.report_digest}
    assert row.report_digest.startswith("sha256:")


# --- append-only -----------------------------------------------------------------------------------------


def test_the_application_can_neither_change_nor_delete(db: None) -> None:
    event = record(2)
    event.verb = "never"
    attempts = (
        event.save,
        event.delete,
        lambda: event.save(update_fields=["verb"]),
        AuditEvent.objects.all().delete,
        lambda: AuditEvent.objects.update(verb="never"),
        lambda: AuditEvent.objects.bulk_update([event], ["verb"]),
        lambda: AuditEvent.objects.update_or_create(pk=event.pk, defaults={"verb": "never"}),
    )
    for attempt in attempts:
        with pytest.raises(AppendOnly), transaction.atomic():
            attempt()
    assert AuditEvent.objects.count() == 2
    assert audit.verify().breaks == ()


@POSTGRESQL_ONLY
@pytest.mark.parametrize(
    "change",
    [
        "UPDATE leaderboard_auditevent SET verb = 'never'",
        "UPDATE leaderboard_auditevent SET hash = NULL",
        "UPDATE leaderboard_auditevent SET seal_number = seal_number + 10",
        "DELETE FROM leaderboard_auditevent",
    ],
)
@pytest.mark.parametrize("is_sealed", [True, False])
def test_postgresql_refuses_to_change_and_to_delete(db: None, change: str, is_sealed: bool) -> None:
    (sealed if is_sealed else record)(2)
    with pytest.raises(IntegrityError, match="append-only"), transaction.atomic():
        in_sql(change)
    audit.seal()
    assert (audit.verify().n_events, audit.verify().breaks) == (2, ())


@POSTGRESQL_ONLY
@pytest.mark.parametrize(
    "seal",
    [
        "hash = 'a'",
        "seal_number = 1, hash = repeat('a', 64)",
        f"{WHOLE}, noun_id = 'other'",
        f"{WHOLE}, at = now()",
        f"{WHOLE}, details = '{{}}'",
        # Another place in the chain than the next one, and a hash that is none.
        WHOLE.replace("= 1", "= 9223372036854775807"),
        WHOLE.replace("= 1", "= 0"),
        WHOLE.replace("= 1", "= 2"),
        WHOLE.replace("repeat('0', 64)", "repeat('b', 64)"),
        WHOLE.replace("repeat('a', 64)", "'a'"),
        WHOLE.replace("repeat('a', 64)", "repeat('A', 64)"),
    ],
)
def test_postgresql_allows_a_whole_seal_and_nothing_beside_it(db: None, seal: str) -> None:
    record()
    with pytest.raises(IntegrityError, match="append-only"), transaction.atomic():
        in_sql(f"UPDATE leaderboard_auditevent SET {seal}")
    in_sql(f"UPDATE leaderboard_auditevent SET {WHOLE}")
    record()
    assert audit.seal() == 1


@POSTGRESQL_ONLY
def test_an_inserted_event_breaks_neither_the_chain_nor_the_sealing(db: None) -> None:
    sealed(2)
    columns = "(at, verb, noun, noun_id, details"
    event = "('1999-01-01', 'v', 'n', '1'"
    refused = [
        f"{columns}, seal_number, previous_hash) VALUES {event}, '{{}}', 9223372036854775807, 'b')",
        f"{columns}, seal_number) VALUES {event}, '{{}}', 3)",
        f"{columns}, hash) VALUES {event}, '{{}}', repeat('c', 64))",
        f"{columns}) VALUES {event}, ('{{\"n\": 1' || repeat('0', 5000) || '}}')::jsonb)",
        f"{columns}) VALUES {event}, '{{\"n\": [1e400]}}')",
        f"{columns}) VALUES {event}, '{{\"n\": -1e301}}')",
        f"{columns}) VALUES {event}, (repeat('[', 2000) || repeat(']', 2000))::jsonb)",
        f"{columns}) VALUES {event}, jsonb_build_object('x', repeat('x', 1000001)))",
        f"{columns}) VALUES {event}, '[]')",
        f"{columns}) VALUES {event}, 'null')",
    ]
    for values in refused:
        with pytest.raises(IntegrityError, match="audit events"), transaction.atomic():
            in_sql(f"INSERT INTO leaderboard_auditevent {values}")
    accepted = ['\'{"n": 9223372036854775807, "x": [0.5, {"y": ["z"]}]}\'', "'{\"a\": null}'", "'{}'"]
    for details in accepted:
        in_sql(
            f"INSERT INTO leaderboard_auditevent {columns}, id) VALUES {event}, {details}, {-len(details)})"
        )
    record(2)
    assert audit.seal() == len(accepted) + 2
    verification = audit.verify()
    assert (verification.n_events, verification.breaks) == (len(accepted) + 4, ())
    # The database says when they were written.
    assert AuditEvent.objects.filter(at__year=1999).count() == 0


def test_an_event_that_cannot_be_sealed_keeps_nothing_else_from_being_done(
    db: None, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def fail() -> int:
        raise ValueError("no seal")

    monkeypatch.setattr(audit, "seal", fail)
    record()
    SweepBeat.objects.get_or_create(pk=SweepBeat.THE_ONE)
    pollers.keep_up(rng=random.Random(0), stopping=threading.Event())
    beat = SweepBeat.objects.get()
    assert beat.swept_at is not None
    assert beat.cleaned_at is not None
    assert "audit_not_sealed" in caplog.text
    assert AuditEvent.objects.unsealed().n_events == 1


@POSTGRESQL_ONLY
def test_postgresql_refuses_to_empty_the_trail(db: None) -> None:
    in_sql("ALTER TABLE leaderboard_auditevent ENABLE TRIGGER audit_no_truncate")
    with pytest.raises(IntegrityError, match="TRUNCATE refused"), transaction.atomic():
        in_sql("TRUNCATE leaderboard_auditevent")


@pytest.mark.parametrize("column", ["seal_number", "previous_hash", "hash"])
def test_the_chain_cannot_fork(db: None, column: str) -> None:
    event = sealed()
    seal = {"seal_number": 9, "previous_hash": "e" * 64, "hash": "f" * 64, column: getattr(event, column)}
    with pytest.raises(IntegrityError), transaction.atomic():
        AuditEvent.objects.create(verb="v", noun="n", noun_id="1", **seal)


# --- tampering is found ----------------------------------------------------------------------------------


@SQLITE_ONLY
@pytest.mark.parametrize(
    ("column", "value"),
    [
        ("verb", "other"),
        ("details", '{"try": 8}'),
        ("at", "2020-01-01 00:00:00"),
        ("actor_id", None),
    ],
)
def test_a_changed_event_is_named(owner: User, column: str, value: str | None) -> None:
    sealed(3, actor=owner)
    second = AuditEvent.objects.order_by("pk")[1]
    in_sql(f"UPDATE leaderboard_auditevent SET {column} = %s WHERE id = %s", value, second.pk)
    [fault] = audit.verify().breaks
    assert (fault.event_id, fault.what) == (second.pk, "says something else than when it was written")


@SQLITE_ONLY
def test_a_removed_event_is_missed(db: None) -> None:
    sealed(3)
    removed = AuditEvent.objects.order_by("pk")[1]
    in_sql("DELETE FROM leaderboard_auditevent WHERE id = %s", removed.pk)
    with pytest.raises(
        CommandError, match=f"2 events is damaged:\n  event {removed.pk + 1}: .*missing"
    ) as caught:
        verify_audit()
    assert caught.value.returncode == 1


@SQLITE_ONLY
def test_an_event_whose_seal_was_taken_off_is_missed_also_once_it_is_sealed_again(db: None) -> None:
    second = sealed(3).pk - 1
    unsealed = "verb = 'other', seal_number = NULL, previous_hash = NULL, hash = NULL"
    in_sql(f"UPDATE leaderboard_auditevent SET {unsealed} WHERE id = %s", second)
    audit.seal()
    [fault] = audit.verify().breaks
    assert fault.event_id == second + 1


@SQLITE_ONLY
def test_an_end_that_was_cut_off_is_missed_by_who_noted_the_last_hash(db: None) -> None:
    noted = str(sealed(3).hash)
    assert verify_audit("--expect", noted).startswith("audit: 3 events, unbroken")
    in_sql("DELETE FROM leaderboard_auditevent WHERE hash = %s", noted)
    assert verify_audit().startswith("audit: 2 events, unbroken")
    with pytest.raises(CommandError, match=f"no event has the hash {noted}"):
        verify_audit("--expect", noted)


# --- damage from before the database guarded the log --------------------------------------------------------


@contextmanager
def unguarded() -> Iterator[None]:
    """Write as an intruder could before: PostgreSQL lets everything pass."""
    guards = ("audit_new_event", "audit_seal_only") if connection.vendor == "postgresql" else ()
    for guard in guards:
        in_sql(f"ALTER TABLE leaderboard_auditevent DISABLE TRIGGER {guard}")
    yield
    for guard in guards:
        in_sql(f"ALTER TABLE leaderboard_auditevent ENABLE TRIGGER {guard}")


def migrate_again() -> str:
    """Run the migration that mends the log once more. Returns what it says."""
    executor = MigrationExecutor(connection)
    graph = executor.loader.graph
    [migration] = [key for key in graph.nodes if key[1].endswith("_a_chain_that_goes_on")]
    executor.migrate([(parent[0], parent[1]) for parent in sorted(graph.node_map[migration].parents)])
    executor = MigrationExecutor(connection)
    with redirect_stdout(StringIO()) as said:
        executor.migrate(executor.loader.graph.leaf_nodes())
    return said.getvalue()


LARGEST = 2**63 - 1


def forge(event: AuditEvent, *, seal_number: int | None, previous_hash: str | None, hash: str | None) -> None:  # noqa: A002
    with unguarded():
        in_sql(
            "UPDATE leaderboard_auditevent SET seal_number = %s, previous_hash = %s, hash = %s WHERE id = %s",
            seal_number,
            previous_hash,
            hash,
            event.pk,
        )


@pytest.mark.slow
@pytest.mark.django_db(transaction=True)
@pytest.mark.parametrize(
    ("previous_hash", "hash_"),
    [
        ("the last", "b" * 64),
        ("b" * 64, "c" * 64),
        ("the last", GENESIS),
        ("b" * 64, "b" * 64),
        ("b" * 64, "none"),
    ],
)
def test_after_an_event_with_the_largest_number_sealing_goes_on_and_it_is_named(
    previous_hash: str, hash_: str
) -> None:
    tip = str(sealed(3).hash)
    forged = record()
    before = tip if previous_hash == "the last" else previous_hash
    forge(forged, seal_number=LARGEST, previous_hash=before, hash=hash_)
    said = migrate_again()
    assert f"The audit event {forged.pk} had the seal number {LARGEST}, and has 4 now." in said
    for _ in range(2):
        record(2)
        pollers.sweep(rng=random.Random(0))
    verification = audit.verify()
    assert (verification.n_events, verification.unsealed.n_events) == (8, 0)
    assert {each.event_id for each in verification.breaks} == {forged.pk}
    assert migrate_again() == ""


@pytest.mark.slow
@pytest.mark.django_db(transaction=True)
def test_two_events_with_numbers_at_the_end_and_parts_of_seals_keep_no_event_from_being_sealed() -> None:
    tip = str(sealed(2).hash)
    first, second, no_hash, no_number, sound = (record() for _ in range(5))
    forge(first, seal_number=LARGEST - 1, previous_hash=tip, hash="d" * 64)
    forge(second, seal_number=LARGEST, previous_hash="e" * 64, hash=GENESIS)
    forge(no_hash, seal_number=LARGEST - 2, previous_hash="b", hash=None)
    forge(no_number, seal_number=None, previous_hash=None, hash="f" * 64)
    said = migrate_again()
    for event in (first, second, no_hash, no_number):
        assert f"The audit event {event.pk} had" in said
    assert f"The audit event {sound.pk} " not in said
    assert audit.seal() == 3
    verification = audit.verify()
    assert (verification.n_events, verification.unsealed.n_events) == (7, 0)
    assert {each.event_id for each in verification.breaks} == {first.pk, second.pk}


@pytest.mark.slow
@pytest.mark.django_db(transaction=True)
@pytest.mark.parametrize(
    "details",
    [
        pytest.param('{"n": 1' + "0" * 5000 + "}", id="digits"),
        pytest.param('{"n": ' + "[" * 3000 + "]" * 3000 + "}", id="depth", marks=POSTGRESQL_ONLY),
        pytest.param("[]", id="list"),
        pytest.param("null", id="null"),
        pytest.param('"' + "x" * 1_000_001 + '"', id="text"),
    ],
)
def test_details_that_cannot_be_read_are_replaced_by_their_hash(details: str, maintainer: User) -> None:
    sealed()
    event = record()
    with unguarded():
        in_sql("UPDATE leaderboard_auditevent SET details = %s WHERE id = %s", details, event.pk)
    record()
    assert f"The audit event {event.pk} had details that cannot be read" in migrate_again()
    assert audit.seal() == 2
    event.refresh_from_db()
    assert set(event.details) == {"unreadable"}
    assert audit.verify().breaks == ()


# --- looking for events ----------------------------------------------------------------------------------


def test_events_are_filtered_by_actor_verb_noun_and_time(owner: User, stranger: User) -> None:
    record(2, actor=owner)
    record(actor=stranger, verb="opened", noun="Window", noun_id="abc-1")
    assert [e.actor for e in audit.events(actor="OWNER@")] == [owner, owner]
    assert audit.events(verb="opened").count() == 1
    assert audit.events(noun="Window").count() == 1
    assert audit.events(noun_id="abc").count() == 1
    assert audit.events().count() == 3
    hour = timedelta(hours=1)
    assert audit.events(since=timezone.now() - hour, until=timezone.now() + hour).count() == 3
    assert not audit.events(since=timezone.now() + hour).exists()
    assert not audit.events(until=timezone.now() - hour).exists()
