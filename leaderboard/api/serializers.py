"""The shapes that programs see. A field once here stays."""

from typing import Any

from django.conf import settings
from django.urls import reverse
from rest_framework import serializers

from evaluator.protocol import INTERVAL_NAMES, SCORE_NAMES
from leaderboard import submissions
from leaderboard.models import Split, Status, Submission
from leaderboard.standings import Board, Entry


class ScoresSerializer(serializers.Serializer[Any]):
    """The ten published numbers: MiD in 10⁻⁴, RTE in percent."""

    def get_fields(self) -> dict[str, serializers.Field[Any, Any, Any, Any]]:
        """One nullable number for each of the ten names."""
        return {name: serializers.FloatField(allow_null=True) for name in SCORE_NAMES}


class CountsSerializer(serializers.Serializer[Any]):
    """Sequences overall and per interval."""

    def get_fields(self) -> dict[str, serializers.Field[Any, Any, Any, Any]]:
        """One count for each interval."""
        return {name: serializers.IntegerField() for name in INTERVAL_NAMES}


class ProblemSerializer(serializers.Serializer[Any]):
    """One fault of a file."""

    code = serializers.CharField()
    message = serializers.CharField()
    where = serializers.CharField(allow_blank=True)


class ErrorSerializer(serializers.Serializer[Any]):
    """RFC 9457 problem details."""

    type = serializers.CharField()
    title = serializers.CharField()
    status = serializers.IntegerField()
    code = serializers.CharField()
    detail = serializers.CharField()
    problems = ProblemSerializer(many=True)


class QueueSerializer(serializers.Serializer[Any]):
    """The place in the queue, and an estimate from recent runs."""

    ahead = serializers.IntegerField()
    estimate_s = serializers.FloatField(allow_null=True)


class NewSubmissionSerializer(serializers.Serializer[Any]):
    """What a submission is made of (multipart)."""

    split = serializers.CharField(help_text="Name of the split.")
    method = serializers.CharField(help_text="Name of the method; a new name makes a new method.")
    file = serializers.FileField(help_text="The prediction file (JSON).")
    description = serializers.CharField(required=False)
    paper_url = serializers.CharField(required=False)
    code_url = serializers.CharField(required=False)
    note = serializers.CharField(required=False, help_text="For the team; not shown to others.")
    commit = serializers.CharField(required=False, help_text="Commit of the code that made the file.")


class SubmissionSerializer(serializers.Serializer[Submission]):
    """A submission as its team sees it."""

    id = serializers.UUIDField()
    state = serializers.ChoiceField(choices=Status.choices)
    split = serializers.CharField()
    edition = serializers.IntegerField(allow_null=True)
    method = serializers.CharField()
    method_id = serializers.UUIDField()
    team = serializers.CharField()
    url = serializers.URLField(help_text="The submission's page.")
    api_url = serializers.URLField()
    submitted_at = serializers.DateTimeField()
    started_at = serializers.DateTimeField(allow_null=True)
    finished_at = serializers.DateTimeField(allow_null=True)
    is_final = serializers.BooleanField()
    fault_is_ours = serializers.BooleanField()
    digest = serializers.CharField(help_text="Digest of the file's bytes.")
    size_bytes = serializers.IntegerField()
    note = serializers.CharField(allow_blank=True)
    commit = serializers.CharField(allow_blank=True)
    queue = QueueSerializer(allow_null=True)
    scores = ScoresSerializer(allow_null=True)
    counts = CountsSerializer(allow_null=True)
    n_out_of_range = serializers.IntegerField(allow_null=True)
    truncated = serializers.DictField(child=serializers.IntegerField())
    problems = ProblemSerializer(many=True)
    n_problems = serializers.IntegerField()

    def to_representation(self, instance: Submission) -> dict[str, Any]:
        """The submission with its progress."""
        progress = submissions.progress(instance)
        method = instance.method
        is_waiting = progress.n_ahead is not None
        return {
            "id": str(instance.pk),
            "state": progress.state,
            "split": instance.split_id,
            "edition": progress.edition_number,
            "method": method.name,
            "method_id": str(method.pk),
            "team": method.team.name,
            "url": absolute("submission", instance.pk),
            "api_url": absolute("api-submission", instance.pk),
            "submitted_at": instance.submitted_at,
            "started_at": progress.started_at,
            "finished_at": progress.finished_at,
            "is_final": progress.is_final,
            "fault_is_ours": progress.fault_is_ours,
            "digest": instance.digest,
            "size_bytes": instance.size_bytes,
            "note": instance.note,
            "commit": instance.commit,
            "queue": {"ahead": progress.n_ahead, "estimate_s": progress.estimate_s} if is_waiting else None,
            "scores": progress.scores,
            "counts": progress.counts or None,
            "n_out_of_range": progress.n_out_of_range,
            "truncated": progress.truncated,
            "problems": progress.problems,
            "n_problems": progress.n_problems,
        }


class SplitSerializer(serializers.Serializer[Split]):
    """A split and what may be done with it."""

    split = serializers.CharField(source="name")
    title = serializers.CharField()
    description = serializers.CharField()
    is_open = serializers.BooleanField(source="accepts_submissions")
    is_hidden = serializers.BooleanField()
    is_simulated = serializers.BooleanField()
    edition = serializers.IntegerField(source="published_edition.number", default=None, allow_null=True)
    protocol = serializers.CharField(source="published_edition.protocol", default=None, allow_null=True)
    ground_truth = serializers.CharField(
        source="published_edition.ground_truth_id", default=None, allow_null=True
    )
    n_sequences = serializers.IntegerField(
        source="published_edition.ground_truth.n_sequences", default=None, allow_null=True
    )


class EntrySerializer(serializers.Serializer[Entry]):
    """One row of a board."""

    rank = serializers.IntegerField(allow_null=True)
    method = serializers.CharField()
    method_id = serializers.UUIDField(allow_null=True)
    team = serializers.CharField()
    kind = serializers.ChoiceField(choices=["submission", "published"])
    date = serializers.CharField(source="date_text")
    description = serializers.CharField(allow_blank=True)
    paper_url = serializers.CharField(allow_blank=True)
    code_url = serializers.CharField(allow_blank=True)
    source = serializers.CharField(allow_blank=True, help_text="The citation of a published row.")
    scores = ScoresSerializer()


class BoardSerializer(serializers.Serializer[Board]):
    """A ranked board: one split in one edition."""

    split = serializers.CharField(source="split.name")
    edition = serializers.IntegerField(source="edition.number", default=None, allow_null=True)
    protocol = serializers.CharField(source="edition.protocol", default=None, allow_null=True)
    ground_truth = serializers.CharField(source="edition.ground_truth_id", default=None, allow_null=True)
    updated_at = serializers.DateTimeField(allow_null=True)
    is_open = serializers.BooleanField()
    sort = serializers.CharField()
    entries = EntrySerializer(many=True)


def absolute(name: str, *args: object) -> str:
    """The quotable address of a named page."""
    return settings.SITE_URL + reverse(name, args=[str(arg) for arg in args])
