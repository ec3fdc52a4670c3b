"""Rank ranges move from the scores into one row for each edition."""

import django.db.models.deletion
from django.apps.registry import Apps
from django.db import migrations, models
from django.db.backends.base.schema import BaseDatabaseSchemaEditor

from evaluator.metrics.protocol import get_protocol, score_name


def move(apps: Apps, schema_editor: BaseDatabaseSchemaEditor) -> None:
    """Keep what is there: the entries are the same, and nobody has to wait for a worker."""
    edition_model = apps.get_model("leaderboard", "Edition")
    score_model = apps.get_model("leaderboard", "Score")
    ranges_model = apps.get_model("leaderboard", "EditionRanges")
    for edition in edition_model.objects.exclude(inference_digest=""):
        names = get_protocol(edition.protocol).score_names
        column_of = {name: j for j, name in enumerate(names)}
        ranges = {}
        rows = score_model.objects.filter(evaluation__edition=edition).exclude(rank_low=None)
        for pk, metric, interval, *pair in rows.values_list(
            "evaluation_id", "metric", "interval", "rank_low", "rank_high"
        ):
            columns = ranges.setdefault(str(pk), [None] * len(names))
            columns[column_of[score_name(metric, interval)]] = pair
        # Without a digest: whoever looks at other entries makes them anew.
        ranges_model.objects.create(edition=edition, digest="", ranges=ranges)


def make_anew(apps: Apps, schema_editor: BaseDatabaseSchemaEditor) -> None:
    """A former version makes them anew, as of an edition that has none."""
    apps.get_model("leaderboard", "Edition").objects.update(inference_digest="")


class Migration(migrations.Migration):

    dependencies = [
        ("leaderboard", "0034_cards"),
    ]

    operations = [
        migrations.CreateModel(
            name="EditionRanges",
            fields=[
                (
                    "edition",
                    models.OneToOneField(
                        on_delete=django.db.models.deletion.CASCADE,
                        primary_key=True,
                        related_name="rank_ranges",
                        serialize=False,
                        to="leaderboard.edition",
                    ),
                ),
                (
                    "digest",
                    models.CharField(max_length=80, help_text="Names the entries that they are made of."),
                ),
                (
                    "ranges",
                    models.JSONField(
                        help_text="By evaluation, of every column of the protocol: best and worst rank, or null."
                    ),
                ),
            ],
        ),
        migrations.RunPython(move, make_anew),
        migrations.RemoveField(model_name="score", name="rank_low"),
        migrations.RemoveField(model_name="score", name="rank_high"),
        migrations.RemoveField(model_name="score", name="is_with_best"),
    ]
