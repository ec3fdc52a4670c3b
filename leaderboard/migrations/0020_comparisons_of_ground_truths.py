"""Counts of what differs between two ground truths, for any pair and not only for the first one."""

import django.db.models.deletion
from django.db import migrations, models


def keep_counts(apps, schema_editor):
    """What was counted when each ground truth came in."""
    comparisons = apps.get_model("leaderboard", "TruthComparison").objects
    for truth in apps.get_model("leaderboard", "GroundTruth").objects.exclude(compared_with=None):
        comparisons.create(
            old_id=truth.compared_with_id,
            new_id=truth.pk,
            n_added=truth.n_added,
            n_removed=truth.n_removed,
            n_changed=truth.n_changed,
        )


class Migration(migrations.Migration):
    dependencies = [("leaderboard", "0019_manifest_of_submissions")]
    operations = [
        migrations.CreateModel(
            name="TruthComparison",
            fields=[
                (
                    "id",
                    models.BigAutoField(
                        auto_created=True, primary_key=True, serialize=False, verbose_name="ID"
                    ),
                ),
                ("n_added", models.PositiveIntegerField()),
                ("n_removed", models.PositiveIntegerField()),
                (
                    "n_changed",
                    models.PositiveIntegerField(help_text="In both, with another time to contact."),
                ),
                (
                    "n_renumbered",
                    models.PositiveIntegerField(
                        help_text="In both, with another anno_id; null where it was not counted in its time.",
                        null=True,
                    ),
                ),
                (
                    "old",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="+",
                        to="leaderboard.groundtruth",
                    ),
                ),
                (
                    "new",
                    models.ForeignKey(
                        on_delete=django.db.models.deletion.PROTECT,
                        related_name="comparisons",
                        to="leaderboard.groundtruth",
                    ),
                ),
            ],
        ),
        migrations.AddConstraint(
            model_name="truthcomparison",
            constraint=models.UniqueConstraint(fields=("old", "new"), name="ground_truths_compared_once"),
        ),
        migrations.RunPython(keep_counts, migrations.RunPython.noop),
    ]
