"""Audit events become a chain, and PostgreSQL refuses to change or to delete them."""

from django.db import migrations, models

REFUSE = """
CREATE FUNCTION leaderboard_audit_append_only() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    RAISE EXCEPTION 'audit events are append-only: % refused', TG_OP USING ERRCODE = 'restrict_violation';
END
$$;
CREATE TRIGGER audit_append_only BEFORE UPDATE OR DELETE ON leaderboard_auditevent
    FOR EACH STATEMENT EXECUTE FUNCTION leaderboard_audit_append_only();
CREATE TRIGGER audit_no_truncate BEFORE TRUNCATE ON leaderboard_auditevent
    FOR EACH STATEMENT EXECUTE FUNCTION leaderboard_audit_append_only();
"""
ALLOW = """
DROP TRIGGER audit_no_truncate ON leaderboard_auditevent;
DROP TRIGGER audit_append_only ON leaderboard_auditevent;
DROP FUNCTION leaderboard_audit_append_only();
"""


def chain(apps, schema_editor):
    """Give the events that are there their hashes."""
    from leaderboard.models.audit import GENESIS, chained_hash

    previous_hash = GENESIS
    for event in apps.get_model("leaderboard", "AuditEvent").objects.order_by("pk").iterator(chunk_size=2000):
        event.previous_hash = previous_hash
        event.hash = previous_hash = chained_hash(
            previous_hash=previous_hash,
            at=event.at,
            actor_id=event.actor_id,
            verb=event.verb,
            noun=event.noun,
            noun_id=event.noun_id,
            details=event.details,
        )
        event.save(update_fields=["previous_hash", "hash"])


def refuse(apps, schema_editor):
    if schema_editor.connection.vendor == "postgresql":
        schema_editor.execute(REFUSE, params=None)


def allow(apps, schema_editor):
    if schema_editor.connection.vendor == "postgresql":
        schema_editor.execute(ALLOW, params=None)


class Migration(migrations.Migration):
    dependencies = [("leaderboard", "0005_recent_runs")]
    operations = [
        migrations.AddField("auditevent", "previous_hash", models.CharField(max_length=64, null=True, unique=True)),
        migrations.AddField("auditevent", "hash", models.CharField(max_length=64, null=True, unique=True)),
        migrations.RunPython(chain, migrations.RunPython.noop),
        migrations.AlterField("auditevent", "previous_hash", models.CharField(max_length=64, unique=True)),
        migrations.AlterField("auditevent", "hash", models.CharField(max_length=64, unique=True)),
        migrations.AlterModelOptions("auditevent", {"ordering": ["-id"], "base_manager_name": "objects"}),
        migrations.RunPython(refuse, allow),
    ]
