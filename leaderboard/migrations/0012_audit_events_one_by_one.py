"""PostgreSQL seals one event after the other, dates events itself, and refuses events that nobody could read."""

from django.db import migrations

GUARD = """
CREATE FUNCTION leaderboard_audit_new_event() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    IF NEW.seal_number IS NOT NULL OR NEW.previous_hash IS NOT NULL OR NEW.hash IS NOT NULL THEN
        RAISE EXCEPTION 'audit events are sealed later: % refused', TG_OP USING ERRCODE = 'restrict_violation';
    END IF;
    IF jsonb_typeof(NEW.details) <> 'object'
        OR octet_length(NEW.details::text) > 1000000
        OR jsonb_path_exists(NEW.details, 'lax $.**{12 to last}')
        OR jsonb_path_exists(
            NEW.details,
            'lax $.** ? (@.type() == "number" && (@ > 1e300 || @ < -1e300))'
        )
    THEN
        RAISE EXCEPTION 'audit events have small details: % refused', TG_OP USING ERRCODE = 'restrict_violation';
    END IF;
    NEW.at := statement_timestamp();
    RETURN NEW;
END
$$;
CREATE TRIGGER audit_new_event BEFORE INSERT ON leaderboard_auditevent
    FOR EACH ROW EXECUTE FUNCTION leaderboard_audit_new_event();
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
        AND to_jsonb(NEW) - ARRAY['seal_number', 'previous_hash', 'hash']
            = to_jsonb(OLD) - ARRAY['seal_number', 'previous_hash', 'hash']
    THEN
        RETURN NEW;
    END IF;
    RAISE EXCEPTION 'audit events are append-only: % refused', TG_OP USING ERRCODE = 'restrict_violation';
END
$$;
"""
# The former function of seals comes back with the migration that made it.
UNGUARD = """
DROP TRIGGER audit_new_event ON leaderboard_auditevent;
DROP FUNCTION leaderboard_audit_new_event();
"""


def on_postgresql(statements):
    def run(apps, schema_editor):
        if schema_editor.connection.vendor == "postgresql":
            schema_editor.execute(statements, params=None)

    return run


class Migration(migrations.Migration):
    dependencies = [("leaderboard", "0011_one_spelling_of_addresses")]
    operations = [migrations.RunPython(on_postgresql(GUARD), on_postgresql(UNGUARD))]
