"""Quotas of splits and of single teams."""

import datetime

import django.db.models.deletion
import django.utils.timezone
from django.conf import settings
from django.db import migrations, models


def rules():
    """The columns, with their texts as they are in the model."""
    return {
        "quota_limit": models.PositiveIntegerField(
            blank=True, help_text="Submissions within the window. Empty: as many as one likes.", null=True
        ),
        "quota_window": models.DurationField(
            default=datetime.timedelta(days=1),
            help_text="Length of the rolling window: “30 00:00:00” is thirty days.",
        ),
        "quota_min_gap": models.DurationField(
            default=datetime.timedelta(0),
            help_text="Least time between two submissions: “24:00:00” is a day.",
        ),
        "quota_rejected_limit": models.PositiveIntegerField(
            blank=True,
            default=20,
            help_text="Rejected files within 24 hours, which cost nothing else. Empty: as many as one likes.",
            null=True,
        ),
    }


def set_quotas(apps, schema_editor):
    from leaderboard.benchmark.splits import SPLITS

    for fields in SPLITS:
        quota = {name: value for name, value in fields.items() if name.startswith("quota_")}
        apps.get_model("leaderboard", "Split").objects.filter(name=fields["name"]).update(**quota)


class Migration(migrations.Migration):
    dependencies = [("leaderboard", "0006_audit_chain")]
    operations = [
        *[migrations.AddField("split", name, field) for name, field in rules().items()],
        migrations.CreateModel(
            name="QuotaOverride",
            fields=[
                ("id", models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name="ID")),
                *rules().items(),
                ("reason", models.CharField(help_text="Why this team has other rules than the rest.", max_length=500)),
                ("set_at", models.DateTimeField(default=django.utils.timezone.now)),
                ("set_by", models.ForeignKey(blank=True, null=True, on_delete=django.db.models.deletion.SET_NULL, related_name="+", to=settings.AUTH_USER_MODEL)),
                ("split", models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name="quota_overrides", to="leaderboard.split")),
                ("team", models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name="quota_overrides", to="leaderboard.team")),
            ],
            options={
                "constraints": [models.UniqueConstraint(fields=("team", "split"), name="one_quota_override_per_team_and_split")],
            },
        ),
        migrations.RunPython(set_quotas, migrations.RunPython.noop),
    ]
