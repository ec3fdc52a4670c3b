"""Serializers of submissions. A field once here stays."""

from typing import Any

from rest_framework import serializers

from leaderboard.api.serializers import (
    EDITION,
    SPLIT,
    CountsSerializer,
    ProblemSerializer,
    ScoresSerializer,
    SlotsSerializer,
    UncertaintySerializer,
    WarningSerializer,
    absolute,
)
from leaderboard.methods.visibility import notice_of
from leaderboard.models import Status, Visibility
from leaderboard.statistics.missing_intervals import explained
from leaderboard.submissions.outcomes import SubmissionView
from leaderboard.submissions.progress import evaluation_of


class QueueSerializer(serializers.Serializer[Any]):
    """Position in the queue."""

    ahead = serializers.IntegerField(help_text="Submissions to be scored before this one.")


class NewSubmissionSerializer(serializers.Serializer[Any]):
    """A new submission (multipart)."""

    split = serializers.CharField(help_text=SPLIT)
    method = serializers.CharField(help_text="Name or id of your method; a new name creates a method.")
    file = serializers.FileField(help_text="The prediction file: JSON, JSON in gzip, or CSV.")
    description = serializers.CharField(
        required=False, help_text="Description of the method; replaces the former one."
    )
    paper_url = serializers.CharField(required=False, help_text="URL of the paper (http or https).")
    code_url = serializers.CharField(required=False, help_text="URL of the code (http or https).")
    note = serializers.CharField(required=False, help_text="Note for your team; not visible to others.")
    commit = serializers.CharField(required=False, help_text="Commit of the code that made the file.")


class SubmissionSerializer(serializers.Serializer[SubmissionView]):
    """A submission as its team sees it."""

    id = serializers.UUIDField(help_text="Permanent id of the submission.")
    state = serializers.ChoiceField(
        choices=Status.choices,
        help_text="Final: SCORED, REJECTED, SYSTEM_ERROR (our fault; a maintainer can retry it), CANCELLED.",
    )
    split = serializers.CharField(help_text=SPLIT)
    edition = serializers.IntegerField(allow_null=True, help_text=EDITION)
    method = serializers.CharField(help_text="Name of the method.")
    method_id = serializers.UUIDField(help_text="Id of the method.")
    team = serializers.CharField(help_text="Name of the team.")
    visibility = serializers.ChoiceField(
        choices=Visibility.choices, help_text="Who sees the method, and so this result on the board."
    )
    notice = serializers.CharField(
        allow_blank=True, help_text="Who sees the method's results, in a sentence; empty if it is private."
    )
    url = serializers.URLField(help_text="URL of the submission's page.")
    api_url = serializers.URLField(help_text="URL of the submission in this API.")
    submitted_at = serializers.DateTimeField(help_text="When it was safely stored.")
    started_at = serializers.DateTimeField(allow_null=True, help_text="When scoring began; null: not yet.")
    finished_at = serializers.DateTimeField(allow_null=True, help_text="When it became final; null: not yet.")
    withdrawn_at = serializers.DateTimeField(
        allow_null=True, help_text="When the team withdrew it; null: not withdrawn."
    )
    is_final = serializers.BooleanField(
        help_text="Whether the state is final; only a maintainer or a new edition can change it."
    )
    fault_is_ours = serializers.BooleanField(
        help_text="Whether scoring failed on our side, not because of the file."
    )
    digest = serializers.CharField(help_text="Digest of the file's bytes.")
    size_bytes = serializers.IntegerField(help_text="Size of the file.")
    note = serializers.CharField(allow_blank=True, help_text="The team's own note.")
    commit = serializers.CharField(allow_blank=True, help_text="Commit of the code that made the file.")
    queue = QueueSerializer(allow_null=True, help_text="Position in the queue; null: not waiting.")
    scores = ScoresSerializer(allow_null=True, help_text="The published scores; null: not scored yet.")
    decimals = serializers.IntegerField(help_text="Decimals of the scores and confidence intervals.")
    intervals = serializers.DictField(
        child=UncertaintySerializer(),
        help_text="Confidence intervals by score name, as on boards; empty until computed. There "
        "is no rank range for a private method, or for a submission that is not the best of its method.",
    )
    awaits_intervals = serializers.BooleanField(
        help_text="Whether the confidence intervals are being computed: they follow the scores within "
        "seconds. False also where there will be none, for example with too few days or recordings."
    )
    rank = serializers.IntegerField(
        allow_null=True,
        help_text="Rank of the method on the current board if this submission is its row there, else null. "
        "For a private method: the rank that it would have. Its rank range is that of the first score.",
    )
    counts = CountsSerializer(
        allow_null=True, help_text="Number of sequences behind each mean; null: not scored yet."
    )
    n_out_of_range = serializers.IntegerField(
        allow_null=True,
        help_text="Sequences in no TTC range, which only the overall means include.",
    )
    truncated = serializers.DictField(
        child=serializers.IntegerField(), help_text="Number of predictions truncated to each boundary."
    )
    warnings = WarningSerializer(
        many=True, help_text="Probable mistakes in a scored file, found from the file and the manifest alone."
    )
    problems = ProblemSerializer(many=True, help_text="Problems of a rejected file, equal ones in one item.")
    n_problems = serializers.IntegerField(help_text="Number of problems, equal and unlisted ones included.")

    def to_representation(self, instance: SubmissionView) -> dict[str, Any]:
        submission, progress, position = instance.submission, instance.progress, instance.position
        method = submission.method
        is_waiting = progress.n_ahead is not None
        intervals = instance.intervals
        if progress.scores:
            edition = evaluation_of(submission).edition
            intervals = explained(intervals, progress.scores, edition=edition)
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
            "withdrawn_at": submission.withdrawn_at,
            "is_final": progress.is_final,
            "fault_is_ours": progress.fault_is_ours,
            "digest": submission.digest,
            "size_bytes": submission.size_bytes,
            "note": submission.note,
            "commit": submission.commit,
            "queue": {"ahead": progress.n_ahead} if is_waiting else None,
            "scores": progress.scores,
            "decimals": progress.decimals,
            "intervals": {
                name: UncertaintySerializer(intervals[name]).data
                for name in progress.scores or ()
                if name in intervals
            },
            "awaits_intervals": instance.awaits_intervals,
            "rank": position.rank if position else None,
            "counts": progress.counts or None,
            "n_out_of_range": progress.n_out_of_range,
            "truncated": progress.truncated,
            "warnings": progress.warnings,
            "problems": progress.problems,
            "n_problems": progress.n_problems,
        }


class SubmittedSerializer(SubmissionSerializer):
    """A new submission and the team's remaining quota."""

    quota = SlotsSerializer(help_text="The team's remaining quota after this submission.")
    notes = serializers.ListField(
        child=serializers.CharField(),
        help_text="A probable slip in words: a new method whose name is like that of another one of the "
        "team, or a file that the team submitted under another method.",
    )

    def to_representation(self, instance: SubmissionView) -> dict[str, Any]:
        return {
            **super().to_representation(instance),
            "quota": SlotsSerializer(self.context["quota"]).data,
            "notes": list(self.context["notes"]),
        }
