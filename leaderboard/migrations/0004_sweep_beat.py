"""The row that says when the queue was last swept."""

from django.db import migrations, models


class Migration(migrations.Migration):
    dependencies = [("leaderboard", "0003_editions_and_publications")]
    operations = [
        migrations.CreateModel(
            name="SweepBeat",
            fields=[
                ("id", models.PositiveSmallIntegerField(default=1, editable=False, primary_key=True, serialize=False)),
                ("swept_at", models.DateTimeField()),
            ],
            options={
                "constraints": [models.CheckConstraint(condition=models.Q(("id", 1)), name="one_sweep_beat")],
            },
        ),
    ]
