"""A random handle for each membership, so that no address has an account's number in it."""

import uuid

from django.db import migrations, models


def give_handles(apps, schema_editor):
    """One by one: a default of the column would give all rows the same."""
    memberships = apps.get_model("leaderboard", "Membership").objects
    for pk in memberships.values_list("pk", flat=True):
        memberships.filter(pk=pk).update(handle=uuid.uuid4())


class Migration(migrations.Migration):
    dependencies = [("leaderboard", "0010_shared_limits")]
    operations = [
        migrations.AddField(
            model_name="membership",
            name="handle",
            field=models.UUIDField(default=uuid.uuid4, editable=False, null=True),
        ),
        migrations.RunPython(give_handles, migrations.RunPython.noop),
        migrations.AlterField(
            model_name="membership",
            name="handle",
            field=models.UUIDField(default=uuid.uuid4, editable=False, unique=True),
        ),
    ]
