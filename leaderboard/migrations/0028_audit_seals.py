"""Events are sealed into the chain after they were written, and PostgreSQL allows that one change of a row."""

from django.db import migrations, models

# The chain that is there was written in the order of the ids.
NUMBER = """
UPDATE leaderboard_auditevent SET seal_number = counted.number
FROM (SELECT id, row_number() OVER (ORDER BY id) AS number FROM leaderboard_auditevent) AS counted
WHERE counted.id = leaderboard_auditevent.id
"""
# A function for one row is new; the one for statements still refuses DELETE and TRUNCATE.
LET_SEAL = """
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
LET_NOTHING = """
DROP TRIGGER audit_append_only ON leaderboard_auditevent;
DROP TRIGGER audit_seal_only ON leaderboard_auditevent;
DROP FUNCTION leaderboard_audit_seal_only();
CREATE TRIGGER audit_append_only BEFORE UPDATE OR DELETE ON leaderboard_auditevent
    FOR EACH STATEMENT EXECUTE FUNCTION leaderboard_audit_append_only();
"""


def on_postgresql(statements):
    def run(apps, schema_editor):
        if schema_editor.connection.vendor == "postgresql":
            schema_editor.execute(statements, params=None)

    return run


class Migration(migrations.Migration):
    dependencies = [("leaderboard", "0027_one_snapshot_per_edition")]
    operations = [
        migrations.AddField("auditevent", "seal_number", models.PositiveBigIntegerField(editable=False, null=True, unique=True)),
        migrations.RunPython(
            on_postgresql("DROP TRIGGER audit_append_only ON leaderboard_auditevent"), migrations.RunPython.noop
        ),
        migrations.RunSQL(NUMBER, migrations.RunSQL.noop),
        migrations.RunPython(on_postgresql(LET_SEAL), on_postgresql(LET_NOTHING)),
        migrations.AlterField("auditevent", "previous_hash", models.CharField(editable=False, max_length=64, null=True, unique=True)),
        migrations.AlterField("auditevent", "hash", models.CharField(editable=False, max_length=64, null=True, unique=True)),
        migrations.AddIndex("auditevent", models.Index(condition=models.Q(("hash", None)), fields=["id"], name="audit_unsealed")),
    ]
