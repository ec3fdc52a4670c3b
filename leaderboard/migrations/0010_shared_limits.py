"""What web processes count together, and whether a sweep found work that its worker cannot do."""

from django.db import migrations, models


def unlogged(apps, schema_editor):
    """Counts are worth no write-ahead log: after a crash of the server everybody begins anew."""
    if schema_editor.connection.vendor == "postgresql":
        schema_editor.execute("ALTER TABLE leaderboard_allowance SET UNLOGGED")


class Migration(migrations.Migration):
    dependencies = [("leaderboard", "0009_access_inference_and_boards")]
    operations = [
        migrations.CreateModel(
            name="Allowance",
            fields=[
                ("key", models.CharField(max_length=64, primary_key=True, serialize=False)),
                (
                    "free_at_s",
                    models.FloatField(
                        help_text="Seconds since 1970 at which it is as if nothing had been asked."
                    ),
                ),
            ],
        ),
        migrations.CreateModel(
            name="CachedValue",
            fields=[
                ("cache_key", models.CharField(max_length=255, primary_key=True, serialize=False)),
                ("value", models.TextField()),
                ("expires", models.DateTimeField(db_index=True)),
            ],
            options={"db_table": "leaderboard_cache"},
        ),
        migrations.AddField(
            model_name="sweepbeat",
            name="n_out_of_reach",
            field=models.PositiveIntegerField(
                default=0, help_text="What waited for a ground truth that the sweeping worker cannot read."
            ),
        ),
        migrations.RunPython(unlogged, migrations.RunPython.noop),
    ]
