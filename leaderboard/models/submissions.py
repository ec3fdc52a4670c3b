"""Submissions, evaluations and scores."""

import uuid
from collections.abc import Collection
from typing import ClassVar, NamedTuple, Self

from django.contrib.auth.models import AnonymousUser
from django.db import models
from django.db.models import Exists, F, OuterRef, Q
from django.db.models.functions import Now
from django.utils import timezone

from leaderboard.models.benchmark import Edition, Split
from leaderboard.models.methods import FINITE, Method
from leaderboard.models.people import User

# So many failed runs end an evaluation: of those that its file may have caused, and of those that it did not.
MAX_POISON_STRIKES = 3
MAX_INFRASTRUCTURE_STRIKES = 10


class SentFile(NamedTuple):
    """Digests of a file and its manifest; the same bytes mean something else under another manifest."""

    digest: str
    manifest_digest: str


class SubmissionQuerySet(models.QuerySet["Submission"]):
    def visible_to(self, user: User | AnonymousUser) -> Self:
        """Return the team's own submissions; maintainers see all, strangers none."""
        if not user.is_authenticated:
            return self.none()
        return self if user.acts_as_maintainer else self.of(user)

    def of(self, user: User) -> Self:
        """Return the team's own submissions, without those to splits that are switched off."""
        return self.filter(method__team__memberships__user=user, split__in=Split.objects.shown())

    def active(self) -> Self:
        """Return submissions that are not withdrawn."""
        return self.filter(withdrawn_at=None)


class Submission(models.Model):
    """One file for one split, kept as the bytes that came in."""

    class Via(models.TextChoices):
        WEB = "WEB", "web"
        API = "API", "API"

    id = models.UUIDField(primary_key=True, default=uuid.uuid4, editable=False)
    split = models.ForeignKey(Split, on_delete=models.PROTECT, related_name="submissions")
    method = models.ForeignKey(Method, on_delete=models.PROTECT, related_name="submissions")
    submitted_by = models.ForeignKey(User, on_delete=models.PROTECT, related_name="submissions")
    submitted_at = models.DateTimeField(default=timezone.now, db_index=True)
    via = models.CharField(max_length=4, choices=Via)
    digest = models.CharField("digest of the file", max_length=80)
    manifest_digest = models.CharField(
        "digest of the manifest",
        max_length=80,
        help_text="The manifest that was public when the file came; its keys are read with it for ever.",
    )
    size_bytes = models.PositiveBigIntegerField()
    filename = models.CharField(max_length=200, blank=True)
    note = models.CharField(max_length=500, blank=True)
    commit = models.CharField("commit of the code", max_length=64, blank=True)
    withdrawn_at = models.DateTimeField(null=True, blank=True)
    hidden_at = models.DateTimeField(
        null=True, blank=True, help_text="When a maintainer took it off the boards of all times."
    )

    objects: ClassVar[SubmissionQuerySet] = SubmissionQuerySet.as_manager()  # type: ignore[assignment]  # a manager, by its own words

    class Meta:
        ordering = ["-submitted_at"]
        constraints = [
            # A method belongs to one team, so this is also once per team.
            models.UniqueConstraint(
                fields=["split", "method", "digest", "manifest_digest"],
                condition=Q(withdrawn_at=None),
                name="same_bytes_once_per_split_method_manifest",
            ),
            models.CheckConstraint(condition=~Q(manifest_digest=""), name="submission_names_its_manifest"),
        ]

    def __str__(self) -> str:
        return f"{self.method} on {self.split_id} ({self.id})"

    @property
    def sent_file(self) -> SentFile:
        return SentFile(self.digest, self.manifest_digest)


class Status(models.TextChoices):
    """The states of an evaluation; only `leaderboard.queue.lifecycle` writes them."""

    QUEUED = "QUEUED", "queued"
    RUNNING = "RUNNING", "running"
    SCORED = "SCORED", "scored"
    REJECTED = "REJECTED", "rejected"
    SYSTEM_ERROR = "SYSTEM_ERROR", "system error"
    CANCELLED = "CANCELLED", "cancelled"


FINAL_STATUSES = (Status.SCORED, Status.REJECTED, Status.SYSTEM_ERROR, Status.CANCELLED)


class EvaluationQuerySet(models.QuerySet["Evaluation"]):
    def due(self) -> Self:
        """Return what waits and may begin, in order."""
        return self.filter(status=Status.QUEUED, due_at__lte=Now()).in_turn()

    def in_turn(self) -> Self:
        """Order as workers take them; last what has stopped its reader before.

        Among equally urgent files, those of teams and people without a file being read come first, so one
        team cannot occupy all readers.
        """
        running = Evaluation.objects.filter(status=Status.RUNNING, priority=Evaluation.PRIORITY_LIVE)
        # Asked beside and not joined, so that whoever locks what waits locks nothing else.
        of_the_same = Submission.objects.filter(
            Q(method__team__in=running.values("submission__method__team"))
            | Q(submitted_by__in=running.values("submission__submitted_by")),
            pk=OuterRef("submission"),
        )
        return self.order_by("n_poison_strikes", "priority", Exists(of_the_same), "queued_at", "pk")

    def suspect(self) -> Self:
        """Return evaluations that failed without a failure of machines: their file may be the cause."""
        return self.filter(
            status=Status.SYSTEM_ERROR,
            n_poison_strikes__gt=0,
            n_infrastructure_strikes__lt=MAX_INFRASTRUCTURE_STRIKES,
        )

    def scorable(self, readable_truths: Collection[str]) -> Self:
        """Return evaluations whose ground truth has one of these digests."""
        # A subquery and no join, so that no edition is locked with it.
        return self.filter(edition__in=Edition.objects.filter(ground_truth__in=readable_truths))


class Evaluation(models.Model):
    """A submission scored in one edition: the unit of work, and the only thing with a status."""

    objects: ClassVar[EvaluationQuerySet] = EvaluationQuerySet.as_manager()  # type: ignore[assignment]  # a manager, by its own words

    # Smaller goes first.
    PRIORITY_LIVE = 0
    PRIORITY_RESCORE = 10

    id = models.UUIDField(primary_key=True, default=uuid.uuid4, editable=False)
    submission = models.ForeignKey(Submission, on_delete=models.PROTECT, related_name="evaluations")
    edition = models.ForeignKey(Edition, on_delete=models.PROTECT, related_name="evaluations")
    status = models.CharField(max_length=12, choices=Status, default=Status.QUEUED)
    priority = models.SmallIntegerField(default=PRIORITY_LIVE)

    queued_at = models.DateTimeField(default=timezone.now)
    due_at = models.DateTimeField(default=timezone.now, help_text="Not to be claimed before.")
    started_at = models.DateTimeField(null=True, blank=True)
    finished_at = models.DateTimeField(null=True, blank=True)

    attempt = models.PositiveIntegerField(default=0)
    finished_attempt = models.PositiveIntegerField(null=True, blank=True)
    lease_token = models.UUIDField(null=True, blank=True)
    leased_until = models.DateTimeField(null=True, blank=True)
    deadline_at = models.DateTimeField(null=True, blank=True)
    n_poison_strikes = models.PositiveSmallIntegerField(default=0)
    n_infrastructure_strikes = models.PositiveSmallIntegerField(default=0)
    last_error = models.CharField(max_length=500, blank=True)

    report = models.JSONField(
        null=True, blank=True, help_text="Counts and truncations; the values are in Score."
    )
    report_digest = models.CharField(max_length=80, blank=True)
    problems = models.JSONField(default=list, blank=True)
    n_problems = models.PositiveIntegerField(default=0)

    class Meta:
        constraints = [
            models.UniqueConstraint(
                fields=["submission", "edition"], name="one_evaluation_per_submission_and_edition"
            ),
            models.CheckConstraint(
                condition=~Q(status="RUNNING")
                | Q(lease_token__isnull=False, leased_until__isnull=False, deadline_at__isnull=False),
                name="running_has_a_lease",
            ),
            models.CheckConstraint(
                condition=~Q(status__in=["SCORED", "REJECTED"])
                | Q(finished_at__isnull=False, finished_attempt=F("attempt")),
                name="final_names_its_attempt",
            ),
        ]
        indexes = [
            models.Index(
                fields=["priority", "queued_at"],
                condition=Q(status="QUEUED"),
                name="evaluation_queue",
            ),
            models.Index(fields=["leased_until"], condition=Q(status="RUNNING"), name="evaluation_leases"),
            models.Index(fields=["edition", "status"], name="evaluation_by_edition"),
            # The last runs, which every estimate for somebody who waits is made of.
            models.Index(
                fields=["-finished_at"],
                condition=Q(status__in=["SCORED", "REJECTED"]),
                name="evaluation_decided_last",
            ),
        ]

    def __str__(self) -> str:
        return f"{self.submission_id} in {self.edition}"

    @property
    def kept_in(self) -> int | None:
        """Return the number of the last published edition that scored what this one rejects."""
        if self.status != Status.REJECTED:
            return None
        rivals = [row for row in self.submission.evaluations.all() if row.status == Status.SCORED]
        return max((row.edition.number for row in rivals if row.edition.published_at), default=None)

    @property
    def is_file_suspect(self) -> bool:
        """Tell whether it failed without a failure of machines: its file may be the cause."""
        return (
            self.status == Status.SYSTEM_ERROR
            and self.n_poison_strikes > 0
            and self.n_infrastructure_strikes < MAX_INFRASTRUCTURE_STRIKES
        )

    @property
    def is_final(self) -> bool:
        return self.status in FINAL_STATUSES


class Score(models.Model):
    """A published value: evaluation × metric × TTC range, rounded as the protocol says."""

    evaluation = models.ForeignKey(Evaluation, on_delete=models.CASCADE, related_name="scores")
    metric = models.CharField(max_length=32)
    ttc_range = models.CharField(max_length=32)
    value = models.FloatField()
    # Its confidence interval; its rank range stands in `EditionRanges`.
    low = models.FloatField(null=True, blank=True)
    high = models.FloatField(null=True, blank=True)

    class Meta:
        constraints = [
            models.UniqueConstraint(
                fields=["evaluation", "metric", "ttc_range"], name="one_score_per_metric_and_range"
            ),
            models.CheckConstraint(
                condition=Q(value__gte=0, value__lt=FINITE), name="score_is_finite_and_not_negative"
            ),
        ]

    def __str__(self) -> str:
        return f"{self.metric} {self.ttc_range} = {self.value}"
