"""A fixed step for ends of intervals, in editions that are opened from now on; published ends stay."""

from django.db import migrations, models

HELP = "The least step between ends of intervals of hidden values; null in earlier editions."


class Migration(migrations.Migration):
    dependencies = [("leaderboard", "0004_backup_runs")]
    operations = [
        migrations.AddField("edition", "least_step", models.FloatField(help_text=HELP, null=True)),
        migrations.AlterField("edition", "least_step", models.FloatField(default=0.5, help_text=HELP, null=True)),
    ]
