"""Rows quoted from papers know since when they stand. Those that are there stand since their split exists."""

from datetime import UTC, datetime

import django.utils.timezone
from django.db import migrations, models
from django.db.models import F, Q

# Boards as of any time have shown them until now, and go on doing so.
SINCE_EVER = datetime(1970, 1, 1, tzinfo=UTC)


class Migration(migrations.Migration):
    dependencies = [("leaderboard", "0012_times_of_boards")]

    operations = [
        migrations.AddField(
            model_name="publishedresult",
            name="added_at",
            field=models.DateTimeField(
                default=SINCE_EVER,
                help_text="Since when it stands on the board; 1970: since the split exists.",
            ),
        ),
        migrations.AddField(
            model_name="publishedresult",
            name="replaced_at",
            field=models.DateTimeField(
                blank=True, null=True, help_text="Until when it stood there; empty: it still does."
            ),
        ),
        migrations.AlterField(
            model_name="publishedresult",
            name="added_at",
            field=models.DateTimeField(
                default=django.utils.timezone.now,
                help_text="Since when it stands on the board; 1970: since the split exists.",
            ),
        ),
        migrations.RemoveConstraint(model_name="publishedresult", name="published_result_once_per_split"),
        migrations.AddConstraint(
            model_name="publishedresult",
            constraint=models.UniqueConstraint(
                fields=["split", "slug"],
                condition=Q(replaced_at=None),
                name="published_result_once_per_split",
            ),
        ),
        migrations.AddConstraint(
            model_name="publishedresult",
            constraint=models.CheckConstraint(
                condition=Q(replaced_at=None) | Q(replaced_at__gte=F("added_at")),
                name="published_result_is_replaced_after_it_was_added",
            ),
        ),
    ]
