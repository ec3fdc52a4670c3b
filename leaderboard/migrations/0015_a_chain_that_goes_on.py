"""Whatever was written into the audit log before the database guarded it: sealing goes on after it."""

import hashlib
import json
import re
import sys

from django.db import migrations, models
from django.db.models.functions import Cast

# Each hash can be followed: none is the start of the chain, or one that another event follows already.
GUARD = """
CREATE OR REPLACE FUNCTION leaderboard_audit_seal_only() RETURNS trigger LANGUAGE plpgsql AS $$
DECLARE
    last_number bigint := 0;
    last_hash text := repeat('0', 64);
BEGIN
    SELECT seal_number, hash INTO last_number, last_hash FROM leaderboard_auditevent
        WHERE seal_number IS NOT NULL ORDER BY seal_number DESC LIMIT 1;
    IF OLD.seal_number IS NULL AND OLD.previous_hash IS NULL AND OLD.hash IS NULL
        AND NEW.seal_number = coalesce(last_number, 0) + 1
        AND NEW.previous_hash = coalesce(last_hash, repeat('0', 64))
        AND NEW.hash ~ '^[0-9a-f]{64}$'
        AND NEW.hash <> NEW.previous_hash
        AND NOT EXISTS (SELECT FROM leaderboard_auditevent WHERE previous_hash = NEW.hash)
        AND to_jsonb(NEW) - ARRAY['seal_number', 'previous_hash', 'hash']
            = to_jsonb(OLD) - ARRAY['seal_number', 'previous_hash', 'hash']
    THEN
        RETURN NEW;
    END IF;
    RAISE EXCEPTION 'audit events are append-only: % refused', TG_OP USING ERRCODE = 'restrict_violation';
END
$$;
"""
# No site seals as many events.
MOST = 10**15
GENESIS = "0" * 64
MAX_LENGTH = 1_000_000


def mend(apps, schema_editor):
    # Deferred, so that nothing is loaded that cannot be read.
    events = apps.get_model("leaderboard", "AuditEvent").objects.defer("details")
    is_guarded = schema_editor.connection.vendor == "postgresql"
    if is_guarded:
        schema_editor.execute("ALTER TABLE leaderboard_auditevent DISABLE TRIGGER audit_seal_only", params=None)
    _replace_what_cannot_be_read(events)
    _take_off_parts_of_seals(events)
    _number_again(events)
    _let_the_last_be_followed(events)
    if is_guarded:
        schema_editor.execute("ALTER TABLE leaderboard_auditevent ENABLE TRIGGER audit_seal_only", params=None)


def _replace_what_cannot_be_read(events):
    as_text = events.annotate(text=Cast("details", models.TextField())).values_list("pk", "text")
    unreadable = {pk: text for pk, text in as_text.iterator() if not _is_readable(text)}
    for pk, text in unreadable.items():
        events.filter(pk=pk).update(details={"unreadable": hashlib.sha256(text.encode()).hexdigest()})
        _say(pk, "had details that cannot be read, and has their hash instead")


def _is_readable(text):
    if len(text) > MAX_LENGTH or not text.startswith("{"):
        return False
    try:
        json.dumps(json.loads(text), allow_nan=False)
    except (ValueError, RecursionError):
        return False
    return True


def _take_off_parts_of_seals(events):
    seal = ("seal_number", "previous_hash", "hash")
    is_unsealed = models.Q(**dict.fromkeys(seal))
    is_whole = ~models.Q(seal_number=None) & ~models.Q(previous_hash=None) & ~models.Q(hash=None)
    for pk in list(events.exclude(is_unsealed | is_whole).values_list("pk", flat=True)):
        events.filter(pk=pk).update(**dict.fromkeys(seal))
        _say(pk, "had a part of a seal, and is sealed anew")


def _number_again(events):
    """Give numbers at the end of all numbers the next ones, in their order: no hash speaks of numbers."""
    last = events.filter(seal_number__lte=MOST).order_by("-seal_number").first()
    number = last.seal_number if last else 0
    for event in list(events.filter(seal_number__gt=MOST).order_by("seal_number")):
        number += 1
        events.filter(pk=event.pk).update(seal_number=number)
        _say(event.pk, f"had the seal number {event.seal_number}, and has {number} now")


def _let_the_last_be_followed(events):
    last = events.exclude(seal_number=None).order_by("-seal_number").first()
    if last is None:
        return
    is_followed = last.hash == GENESIS or events.filter(previous_hash=last.hash).exists()
    if is_followed or not re.fullmatch("[0-9a-f]{64}", last.hash, re.ASCII):
        # Not the hash of its content before, and not now: `verify_audit` goes on naming it.
        hash_now = hashlib.sha256(f"{last.pk} {last.hash}".encode()).hexdigest()
        events.filter(pk=last.pk).update(hash=hash_now)
        _say(last.pk, f"had the hash {last.hash!r}, which no event can follow, and has {hash_now} now")


def _say(pk, what):
    sys.stdout.write(f"The audit event {pk} {what}. Somebody wrote it past the application.\n")


def guard(apps, schema_editor):
    if schema_editor.connection.vendor == "postgresql":
        schema_editor.execute(GUARD, params=None)


class Migration(migrations.Migration):
    dependencies = [("leaderboard", "0014_looks_of_public_names")]
    operations = [
        migrations.RunPython(mend, migrations.RunPython.noop),
        # The former function of seals comes back with the migration that made it.
        migrations.RunPython(guard, migrations.RunPython.noop),
    ]
