"""Splits are listed, archived or switched off, and may share the ground truth of another one."""

import django.db.models.deletion
from django.db import migrations, models


class Migration(migrations.Migration):
    dependencies = [
        ("leaderboard", "0035_ranges_of_an_edition"),
    ]

    operations = [
        migrations.AddField(
            model_name="split",
            name="listing",
            field=models.CharField(
                choices=[("LISTED", "listed"), ("ARCHIVED", "archived"), ("OFF", "switched off")],
                default="LISTED",
                help_text="Archived: its board stays, and it takes no submissions. Switched off: it is on no page, in no form and in no list of the API.",
                max_length=8,
            ),
        ),
        migrations.AddField(
            model_name="split",
            name="same_truth_as",
            field=models.ForeignKey(
                blank=True,
                help_text="The split whose ground truth it shares: a challenge with its own dates and quota.",
                null=True,
                on_delete=django.db.models.deletion.PROTECT,
                related_name="challenges",
                to="leaderboard.split",
            ),
        ),
        migrations.AddConstraint(
            model_name="split",
            constraint=models.CheckConstraint(
                condition=models.Q(("title", ""), _negated=True), name="split_has_a_title"
            ),
        ),
        migrations.AddConstraint(
            model_name="split",
            constraint=models.CheckConstraint(
                condition=models.Q(("listing__in", ["LISTED", "ARCHIVED", "OFF"])),
                name="split_listing_is_known",
            ),
        ),
        migrations.AddConstraint(
            model_name="split",
            constraint=models.CheckConstraint(
                condition=models.Q(
                    ("same_truth_as", None),
                    models.Q(("same_truth_as", models.F("name")), _negated=True),
                    _connector="OR",
                ),
                name="split_shares_the_truth_of_another_one",
            ),
        ),
    ]
