"""The manifest that each file was written for: its anno_ids are numbers of that one and of no other."""

from django.db import migrations, models


def name_manifests(apps, schema_editor):
    """The manifest of the edition that was the board when the file came.

    Where that is not known, as for rows that were written by hand, that of the first edition in which the file
    was evaluated; of one that was never evaluated, that of the board.
    """
    submissions = apps.get_model("leaderboard", "Submission").objects
    publications = apps.get_model("leaderboard", "Publication").objects
    for publication in publications.select_related("edition__ground_truth").order_by("at", "pk"):
        # Each later one takes over what came after it.
        submissions.filter(
            split=publication.split_id,
            submitted_at__gte=publication.at,
            evaluations__edition=publication.edition_id,
        ).update(manifest_digest=publication.edition.ground_truth.manifest_digest)
    evaluations = apps.get_model("leaderboard", "Evaluation").objects
    unnamed = submissions.filter(manifest_digest="").select_related("split__published_edition__ground_truth")
    for submission in unnamed:
        first = (
            evaluations.filter(submission=submission.pk)
            .select_related("edition__ground_truth")
            .order_by("edition__number")
            .first()
        )
        edition = first.edition if first is not None else submission.split.published_edition
        if edition is not None:
            digest = edition.ground_truth.manifest_digest
            submissions.filter(pk=submission.pk).update(manifest_digest=digest)
    if schema_editor is not None and schema_editor.connection.vendor == "postgresql":
        # The foreign keys of a row that was changed twice, as after an edition was rolled back, are checked now:
        # a table that waits for a check cannot be altered.
        schema_editor.execute("SET CONSTRAINTS ALL IMMEDIATE")


class Migration(migrations.Migration):
    dependencies = [("leaderboard", "0018_sound_rules")]
    operations = [
        migrations.AddField(
            model_name="submission",
            name="manifest_digest",
            field=models.CharField(
                default="",
                help_text="The manifest that was public when the file came; its keys are read with it for ever.",
                max_length=80,
                verbose_name="digest of the manifest",
            ),
            preserve_default=False,
        ),
        migrations.RunPython(name_manifests, migrations.RunPython.noop),
        migrations.RemoveConstraint(
            model_name="submission", name="same_bytes_once_per_split_and_method"
        ),
        migrations.AddConstraint(
            model_name="submission",
            constraint=models.UniqueConstraint(
                condition=models.Q(("withdrawn_at", None)),
                fields=("split", "method", "digest", "manifest_digest"),
                name="same_bytes_once_per_split_method_manifest",
            ),
        ),
        migrations.AddConstraint(
            model_name="submission",
            constraint=models.CheckConstraint(
                condition=models.Q(("manifest_digest", ""), _negated=True),
                name="submission_names_its_manifest",
            ),
        ),
    ]
