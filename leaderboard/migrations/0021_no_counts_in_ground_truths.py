"""The counts that moved to comparisons. Apart from the move, so that PostgreSQL has no rows in hand."""

from django.db import migrations


class Migration(migrations.Migration):
    dependencies = [("leaderboard", "0020_comparisons_of_ground_truths")]
    operations = [
        migrations.RemoveField(model_name="groundtruth", name="compared_with"),
        migrations.RemoveField(model_name="groundtruth", name="n_added"),
        migrations.RemoveField(model_name="groundtruth", name="n_removed"),
        migrations.RemoveField(model_name="groundtruth", name="n_changed"),
    ]
