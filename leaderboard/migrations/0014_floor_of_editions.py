from django.db import migrations, models


class Migration(migrations.Migration):
    """What the ground truth itself scores, of every edition; workers compute it of those that there are."""

    dependencies = [("leaderboard", "0013_times_of_published_results")]

    operations = [
        migrations.AddField(
            model_name="edition",
            name="floor",
            field=models.JSONField(
                blank=True,
                help_text=(
                    "By score name: what the ground truth itself scores, as published. A worker computes it."
                ),
                null=True,
            ),
        ),
    ]
