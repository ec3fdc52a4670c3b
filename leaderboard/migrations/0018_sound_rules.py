"""Rules of quotas and times of splits make sense; those that do not are mended first."""

from datetime import timedelta

from django.db import migrations, models
from django.db.models import F, Q

NONE = timedelta(0)
MAX_SPAN = timedelta(days=3650)


def mend(apps, schema_editor):
    """What the constraints below refuse becomes what the program would do instead of it."""
    from leaderboard.benchmark.splits import SPLITS

    Split = apps.get_model("leaderboard", "Split")
    QuotaOverride = apps.get_model("leaderboard", "QuotaOverride")
    shipped = {fields["name"]: fields for fields in SPLITS}
    for model in (Split, QuotaOverride):
        model.objects.filter(quota_window__gt=MAX_SPAN).update(quota_window=MAX_SPAN)
        model.objects.filter(quota_min_gap__gt=MAX_SPAN).update(quota_min_gap=MAX_SPAN)
    for split in Split.objects.filter(Q(quota_window__lte=NONE) | Q(quota_min_gap__lt=NONE)):
        fields = shipped.get(split.name, {})
        if split.quota_window <= NONE:
            split.quota_window = fields.get("quota_window", timedelta(days=1))
        if split.quota_min_gap < NONE:
            split.quota_min_gap = fields.get("quota_min_gap", NONE)
        split.save(update_fields=["quota_window", "quota_min_gap"])
    for row in QuotaOverride.objects.filter(Q(quota_window__lte=NONE) | Q(quota_min_gap__lt=NONE)):
        if row.quota_window <= NONE:
            row.quota_window = row.split.quota_window
        if row.quota_min_gap < NONE:
            row.quota_min_gap = row.split.quota_min_gap
        row.save(update_fields=["quota_window", "quota_min_gap"])
    Split.objects.filter(opens_at__gte=F("closes_at")).update(opens_at=None, closes_at=None)
    if schema_editor.connection.vendor == "postgresql":
        # The foreign keys of a row that was changed twice are checked now: a table that waits for a check
        # cannot be altered.
        schema_editor.execute("SET CONSTRAINTS ALL IMMEDIATE")


class Migration(migrations.Migration):
    dependencies = [
        ("leaderboard", "0017_names_of_shown_teams"),
    ]

    operations = [
        migrations.RunPython(mend, migrations.RunPython.noop),
        migrations.AddConstraint(
            model_name="quotaoverride",
            constraint=models.CheckConstraint(
                condition=Q(("quota_window__gt", NONE), ("quota_window__lte", MAX_SPAN)),
                name="quotaoverride_window_is_above_0_and_at_most_10_years",
            ),
        ),
        migrations.AddConstraint(
            model_name="quotaoverride",
            constraint=models.CheckConstraint(
                condition=Q(("quota_min_gap__gte", NONE), ("quota_min_gap__lte", MAX_SPAN)),
                name="quotaoverride_gap_is_from_0_to_10_years",
            ),
        ),
        migrations.AddConstraint(
            model_name="split",
            constraint=models.CheckConstraint(
                condition=Q(("quota_window__gt", NONE), ("quota_window__lte", MAX_SPAN)),
                name="split_window_is_above_0_and_at_most_10_years",
            ),
        ),
        migrations.AddConstraint(
            model_name="split",
            constraint=models.CheckConstraint(
                condition=Q(("quota_min_gap__gte", NONE), ("quota_min_gap__lte", MAX_SPAN)),
                name="split_gap_is_from_0_to_10_years",
            ),
        ),
        migrations.AddConstraint(
            model_name="split",
            constraint=models.CheckConstraint(
                condition=Q(
                    ("opens_at", None), ("closes_at", None), ("opens_at__lt", F("closes_at")), _connector="OR"
                ),
                name="split_opens_before_it_closes",
            ),
        ),
    ]
