"""A former edition can be opened again, and gets new submissions until it is published or closed."""

from django.db import migrations, models


class Migration(migrations.Migration):
    dependencies = [("leaderboard", "0006_mail_reason")]
    operations = [
        migrations.AddField(
            "edition",
            "reopened_at",
            models.DateTimeField(
                blank=True,
                help_text="When a former edition was opened again; null once it is the board.",
                null=True,
            ),
        ),
        migrations.AddConstraint(
            model_name="edition",
            constraint=models.CheckConstraint(
                condition=models.Q(("reopened_at", None), ("published_at__isnull", False), _connector="OR"),
                name="only_former_editions_are_opened_again",
            ),
        ),
    ]
