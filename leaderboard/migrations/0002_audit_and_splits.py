"""PostgreSQL refuses to change or delete audit events, but for their seal; the first splits and quoted rows are made."""

from django.db import migrations

# DELETE and TRUNCATE are refused for whole statements, UPDATE row by row: sealing an event is the one change.
REFUSE = """
CREATE FUNCTION leaderboard_audit_append_only() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    RAISE EXCEPTION 'audit events are append-only: % refused', TG_OP USING ERRCODE = 'restrict_violation';
END
$$;
CREATE TRIGGER audit_no_truncate BEFORE TRUNCATE ON leaderboard_auditevent
    FOR EACH STATEMENT EXECUTE FUNCTION leaderboard_audit_append_only();
CREATE FUNCTION leaderboard_audit_seal_only() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    IF OLD.seal_number IS NULL AND OLD.previous_hash IS NULL AND OLD.hash IS NULL
        AND NEW.seal_number IS NOT NULL AND NEW.previous_hash IS NOT NULL AND NEW.hash IS NOT NULL
        AND to_jsonb(NEW) - ARRAY['seal_number', 'previous_hash', 'hash']
            = to_jsonb(OLD) - ARRAY['seal_number', 'previous_hash', 'hash']
    THEN
        RETURN NEW;
    END IF;
    RAISE EXCEPTION 'audit events are append-only: % refused', TG_OP USING ERRCODE = 'restrict_violation';
END
$$;
CREATE TRIGGER audit_seal_only BEFORE UPDATE ON leaderboard_auditevent
    FOR EACH ROW EXECUTE FUNCTION leaderboard_audit_seal_only();
CREATE TRIGGER audit_append_only BEFORE DELETE ON leaderboard_auditevent
    FOR EACH STATEMENT EXECUTE FUNCTION leaderboard_audit_append_only();
"""
ALLOW = """
DROP TRIGGER audit_append_only ON leaderboard_auditevent;
DROP TRIGGER audit_seal_only ON leaderboard_auditevent;
DROP FUNCTION leaderboard_audit_seal_only();
DROP TRIGGER audit_no_truncate ON leaderboard_auditevent;
DROP FUNCTION leaderboard_audit_append_only();
"""


def on_postgresql(statements):
    def run(apps, schema_editor):
        if schema_editor.connection.vendor == "postgresql":
            schema_editor.execute(statements, params=None)

    return run


def ensure_splits(apps, schema_editor):
    # The rows are made with the historical models, so that later columns do not matter here.
    from leaderboard.editions.splits import ensure_splits

    ensure_splits(
        split_model=apps.get_model("leaderboard", "Split"),
        result_model=apps.get_model("leaderboard", "PublishedResult"),
    )


class Migration(migrations.Migration):
    dependencies = [("leaderboard", "0001_initial")]
    operations = [
        migrations.RunPython(on_postgresql(REFUSE), on_postgresql(ALLOW)),
        migrations.RunPython(ensure_splits, migrations.RunPython.noop),
    ]
