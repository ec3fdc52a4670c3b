"""Tokens are good for something, perhaps for one split alone, and can be revoked."""

import django.db.models.deletion
from django.db import migrations, models


class Migration(migrations.Migration):
    dependencies = [("leaderboard", "0007_quotas")]
    operations = [
        migrations.AddField("apitoken", "may_read", models.BooleanField(default=True)),
        migrations.AddField("apitoken", "may_submit", models.BooleanField(default=True)),
        migrations.AddField(
            "apitoken",
            "split",
            models.ForeignKey(
                blank=True,
                help_text="The only split that it is good for; empty: all of them.",
                null=True,
                on_delete=django.db.models.deletion.CASCADE,
                related_name="+",
                to="leaderboard.split",
            ),
        ),
        migrations.AddField("apitoken", "revoked_at", models.DateTimeField(blank=True, null=True)),
        migrations.AlterField(
            "apitoken", "last_used_at", models.DateTimeField(blank=True, help_text="To the minute.", null=True)
        ),
        migrations.AddConstraint(
            "apitoken",
            models.CheckConstraint(
                condition=models.Q(("may_read", True), ("may_submit", True), _connector="OR"),
                name="token_is_good_for_something",
            ),
        ),
    ]
