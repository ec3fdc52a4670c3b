"""Looks of names again: badges do not count any more, and letters in circles are letters."""

from importlib import import_module

from django.db import migrations

give_looks = import_module("leaderboard.migrations.0014_looks_of_public_names").give_looks


def forget_looks(apps, schema_editor):
    # Out of the way of the new looks, which are unique.
    apps.get_model("leaderboard", "Method").objects.update(look=None)


class Migration(migrations.Migration):
    dependencies = [("leaderboard", "0016_lost_files")]
    operations = [
        migrations.RunPython(forget_looks, migrations.RunPython.noop),
        migrations.RunPython(give_looks, migrations.RunPython.noop),
    ]
