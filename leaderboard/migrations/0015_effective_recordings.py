from django.apps.registry import Apps
from django.db import migrations, models
from django.db.backends.base.schema import BaseDatabaseSchemaEditor


def compare_anew(apps: Apps, schema_editor: BaseDatabaseSchemaEditor) -> None:
    """Forget comparisons: their intervals were another method's, and their p was rounded before it was judged.

    Whoever asks again is answered by a worker within a second or two.
    """
    del schema_editor
    apps.get_model("leaderboard", "Comparison").objects.all().delete()


class Migration(migrations.Migration):
    dependencies = [
        ("leaderboard", "0014_floor_of_editions"),
    ]

    operations = [
        migrations.RunPython(compare_anew, migrations.RunPython.noop),
        migrations.AddField(
            model_name="edition",
            name="n_effective",
            field=models.JSONField(
                blank=True,
                default=dict,
                help_text="Effective number of recordings by score name: the degrees of freedom of its interval.",
            ),
        ),
        migrations.AlterField(
            model_name="comparison",
            name="differences",
            field=models.JSONField(
                blank=True,
                help_text="By score name: first minus second, its 95 % interval, p and what it is below.",
                null=True,
            ),
        ),
    ]
