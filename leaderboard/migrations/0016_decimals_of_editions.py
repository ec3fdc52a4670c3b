"""Published decimals become a policy of the split, frozen in each edition; what was published keeps two."""

from typing import Any

from django.db import migrations, models

HELP_OF_SPLIT = "With how many decimals its next edition publishes. Each one tells more of hidden values."
HELP_OF_EDITION = "With how many decimals everything of it is published; the split's when it was opened."
CHOICES = [(1, "one"), (2, "two")]


def keep_what_was_published(apps: Any, _schema_editor: Any) -> None:
    """Open splits and every edition there is have two decimals; hidden splits get one from the next edition on."""
    apps.get_model("leaderboard", "Split").objects.filter(is_hidden=False).update(decimals=2)
    apps.get_model("leaderboard", "Edition").objects.update(decimals=2)


class Migration(migrations.Migration):
    dependencies = [
        ("leaderboard", "0015_effective_recordings"),
    ]

    operations = [
        migrations.AddField(
            model_name="split",
            name="decimals",
            field=models.PositiveSmallIntegerField(choices=CHOICES, default=1, help_text=HELP_OF_SPLIT),
        ),
        migrations.AddField(
            model_name="edition",
            name="decimals",
            field=models.PositiveSmallIntegerField(default=1, help_text=HELP_OF_EDITION),
        ),
        migrations.RunPython(keep_what_was_published, migrations.RunPython.noop),
        migrations.RemoveConstraint(
            model_name="edition", name="one_edition_per_ground_truth_and_protocol"
        ),
        migrations.AddConstraint(
            model_name="edition",
            constraint=models.UniqueConstraint(
                fields=["split", "ground_truth", "protocol", "decimals"],
                condition=models.Q(discarded_at=None),
                name="one_edition_per_ground_truth_and_protocol",
            ),
        ),
        migrations.AddConstraint(
            model_name="edition",
            constraint=models.CheckConstraint(
                condition=models.Q(decimals__in=[1, 2]), name="decimals_one_or_two"
            ),
        ),
        migrations.AddConstraint(
            model_name="split",
            constraint=models.CheckConstraint(
                condition=models.Q(decimals__in=[1, 2]), name="split_decimals_one_or_two"
            ),
        ),
    ]
