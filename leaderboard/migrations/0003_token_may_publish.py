"""A scope of its own for publishing; tokens that could submit could publish and still can."""

from django.db import migrations, models
from django.db.models import F


def keep_what_tokens_could(apps, schema_editor):
    apps.get_model("leaderboard", "ApiToken").objects.update(may_publish=F("may_submit"))


class Migration(migrations.Migration):
    dependencies = [("leaderboard", "0002_audit_and_splits")]
    operations = [
        migrations.RemoveConstraint(model_name="apitoken", name="token_is_good_for_something"),
        migrations.AddField("apitoken", "may_publish", models.BooleanField(default=False)),
        migrations.RunPython(keep_what_tokens_could, migrations.RunPython.noop),
        migrations.AddConstraint(
            model_name="apitoken",
            constraint=models.CheckConstraint(
                condition=models.Q(("may_read", True), ("may_submit", True), ("may_publish", True), _connector="OR"),
                name="token_is_good_for_something",
            ),
        ),
    ]
