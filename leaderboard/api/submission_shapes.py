"""The shapes of submissions that programs see and send. A field once here stays."""

from dataclasses import asdict
from typing import Any

from rest_framework import serializers

from evaluator.protocol import SCORE_NAMES
from leaderboard.api.serializers import (
    CountsSerializer,
    ProblemSerializer,
    ScoresSerializer,
    SlotsSerializer,
    UncertaintySerializer,
    WarningSerializer,
    absolute,
)
from leaderboard.models import Status, Visibility
from leaderboard.outcomes import Outcome
from leaderboard.visibility import notice_of


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


class SubmissionSerializer(serializers.Serializer[Outcome]):
    """A submission as its team sees it."""

    id = serializers.UUIDField()
    state = serializers.ChoiceField(choices=Status.choices)
    split = serializers.CharField()
    edition = serializers.IntegerField(allow_null=True)
    method = serializers.CharField()
    method_id = serializers.UUIDField()
    team = serializers.CharField()
    visibility = serializers.ChoiceField(
        choices=Visibility.choices, help_text="Who sees the method, and so this result on the board."
    )
    notice = serializers.CharField(
        allow_blank=True, help_text="Who sees the method's results, in a sentence; empty if it is private."
    )
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
    decimals = serializers.IntegerField(
        help_text="With how many decimals its edition publishes values and intervals."
    )
    intervals = serializers.DictField(
        child=UncertaintySerializer(),
        help_text="By the names of the scores, as on boards; empty until they are computed. A private method "
        "has no range of ranks, nor has what another submission of its method surpasses.",
    )
    awaits_intervals = serializers.BooleanField(
        help_text="Whether the intervals are being computed: they follow the scores within seconds. False "
        "as well where there will be none, as for too few recordings."
    )
    rank = serializers.IntegerField(
        allow_null=True,
        help_text="Of its method on the present board, if this submission stands there for it; null "
        "otherwise. Of a private method the rank that it would have. The range is that of `intervals.mid`.",
    )
    counts = CountsSerializer(allow_null=True)
    n_out_of_range = serializers.IntegerField(allow_null=True)
    truncated = serializers.DictField(child=serializers.IntegerField())
    warnings = WarningSerializer(many=True)
    problems = ProblemSerializer(many=True)
    n_problems = serializers.IntegerField()

    def to_representation(self, instance: Outcome) -> dict[str, Any]:
        """The submission with its progress, and with its place if it has one."""
        submission, progress, place = instance.submission, instance.progress, instance.place
        method = submission.method
        is_waiting = progress.n_ahead is not None
        return {
            "id": str(submission.pk),
            "state": progress.state,
            "split": submission.split_id,
            "edition": progress.edition_number,
            "method": method.name,
            "method_id": str(method.pk),
            "team": method.team.name,
            "visibility": method.visibility,
            "notice": notice_of(method),
            "url": absolute("submission", submission.pk),
            "api_url": absolute("api-submission", submission.pk),
            "submitted_at": submission.submitted_at,
            "started_at": progress.started_at,
            "finished_at": progress.finished_at,
            "is_final": progress.is_final,
            "fault_is_ours": progress.fault_is_ours,
            "digest": submission.digest,
            "size_bytes": submission.size_bytes,
            "note": submission.note,
            "commit": submission.commit,
            "queue": {"ahead": progress.n_ahead, "estimate_s": progress.estimate_s} if is_waiting else None,
            "scores": progress.scores,
            "decimals": progress.decimals,
            "intervals": {
                name: asdict(instance.intervals[name]) for name in SCORE_NAMES if name in instance.intervals
            },
            "awaits_intervals": instance.awaits_intervals,
            "rank": place.rank if place else None,
            "counts": progress.counts or None,
            "n_out_of_range": progress.n_out_of_range,
            "truncated": progress.truncated,
            "warnings": progress.warnings,
            "problems": progress.problems,
            "n_problems": progress.n_problems,
        }


class SubmittedSerializer(SubmissionSerializer):
    """A submission that has just come in, and what the team has left after it."""

    quota = SlotsSerializer()

    def to_representation(self, instance: Outcome) -> dict[str, Any]:
        """The submission, and the quota that the view hands over."""
        return {
            **super().to_representation(instance),
            "quota": SlotsSerializer(self.context["quota"]).data,
        }
