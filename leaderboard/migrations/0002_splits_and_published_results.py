"""The three splits and the rows of the paper's main table are there after `migrate`."""

from django.db import migrations


def ensure_splits(apps, schema_editor):
    # The rows are made with the historical models, so that later columns do not matter here.
    from leaderboard.benchmark.splits import ensure_splits

    ensure_splits(split_model=apps.get_model("leaderboard", "Split"), result_model=apps.get_model("leaderboard", "PublishedResult"))


class Migration(migrations.Migration):
    dependencies = [("leaderboard", "0001_initial")]
    operations = [migrations.RunPython(ensure_splits, migrations.RunPython.noop)]
