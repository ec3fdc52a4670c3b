"""Why the mail server did not take a mail."""

from django.db import migrations, models


class Migration(migrations.Migration):
    dependencies = [("leaderboard", "0005_edition_least_step")]
    operations = [
        migrations.AddField(
            model_name="mail",
            name="reason",
            field=models.CharField(
                blank=True,
                default="",
                help_text="What the mail server said when it did not take this mail.",
                max_length=200,
            ),
            preserve_default=False,
        ),
    ]
