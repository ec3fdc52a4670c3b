"""Names are unique among the teams that everybody sees; when a team or a method was renamed last."""

from django.db import migrations, models


def mark_shown(apps, schema_editor):
    """Every team with a public method has shown its name; all names differ until now."""
    teams = apps.get_model("leaderboard", "Team").objects
    teams.filter(methods__visibility="PUBLIC").update(is_shown=True)


class Migration(migrations.Migration):
    dependencies = [("leaderboard", "0016_decimals_of_editions")]
    operations = [
        migrations.AddField(
            "team",
            "is_shown",
            models.BooleanField(
                default=False, help_text="Whether everybody has been shown its name, with a public method."
            ),
        ),
        migrations.AddField("team", "renamed_at", models.DateTimeField(blank=True, null=True)),
        migrations.AddField("method", "renamed_at", models.DateTimeField(blank=True, null=True)),
        migrations.AlterField("team", "name", models.CharField(max_length=80)),
        migrations.AlterField("team", "look", models.CharField(db_index=True, max_length=320)),
        migrations.RunPython(mark_shown, migrations.RunPython.noop, elidable=True),
        migrations.AddConstraint(
            "team",
            models.UniqueConstraint(
                condition=models.Q(is_shown=True), fields=("look",), name="shown_teams_look_different"
            ),
        ),
    ]
