"""One snapshot per edition: boards of the past are no longer kept in a form of their own."""

import django.db.models.deletion
from django.db import migrations, models


class Migration(migrations.Migration):
    dependencies = [("leaderboard", "0026_words_of_box_sources")]

    operations = [
        # A snapshot is a copy: the first reader draws it anew.
        migrations.RunSQL("DELETE FROM leaderboard_snapshot", migrations.RunSQL.noop),
        migrations.RemoveConstraint("snapshot", "one_snapshot_per_edition_and_form"),
        migrations.RemoveField("snapshot", "form"),
        migrations.AlterField(
            "snapshot",
            "edition",
            models.OneToOneField(
                on_delete=django.db.models.deletion.CASCADE,
                related_name="snapshot",
                to="leaderboard.edition",
            ),
        ),
    ]
