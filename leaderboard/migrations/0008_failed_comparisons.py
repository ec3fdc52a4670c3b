"""A pair that failed waits behind all others, whether a reader asked for it or not."""

from django.db import migrations, models
from django.db.models import Q


class Migration(migrations.Migration):
    dependencies = [("leaderboard", "0007_reopened_editions")]
    operations = [
        migrations.RemoveIndex("comparison", "comparison_waiting"),
        migrations.AddField(
            "comparison",
            "begun_at",
            models.DateTimeField(
                blank=True,
                help_text="When a worker last began it; without a result, it failed.",
                null=True,
            ),
        ),
        migrations.AddIndex(
            "comparison",
            models.Index(
                condition=Q(("computed_at", None)),
                fields=["begun_at", "asked_at"],
                name="comparison_in_turn",
            ),
        ),
    ]
