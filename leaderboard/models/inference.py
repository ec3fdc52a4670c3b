"""Rank ranges, comparisons, and analyses for owners."""

from django.db import models
from django.utils import timezone

from leaderboard.models.benchmark import Edition
from leaderboard.models.submissions import Evaluation


class EditionRanges(models.Model):
    """The rank ranges of an edition in one row: a new entry moves most of them."""

    edition = models.OneToOneField(
        Edition, on_delete=models.CASCADE, primary_key=True, related_name="rank_ranges"
    )
    digest = models.CharField(max_length=80, blank=True, help_text="Names the entries that they are made of.")
    ranges = models.JSONField(
        default=dict,
        help_text="By evaluation, of every column of the protocol: best and worst rank, or null.",
    )
    claimed_until = models.DateTimeField(
        null=True, blank=True, help_text="Until then one worker computes them, and no other begins."
    )

    def __str__(self) -> str:
        return f"rank ranges of {self.edition}"


class Comparison(models.Model):
    """The difference between two entries of an edition, asked for by a reader and computed by a worker."""

    edition = models.ForeignKey(Edition, on_delete=models.CASCADE, related_name="comparisons")
    first = models.ForeignKey(Evaluation, on_delete=models.CASCADE, related_name="+")
    second = models.ForeignKey(Evaluation, on_delete=models.CASCADE, related_name="+")
    asked_at = models.DateTimeField(
        null=True, blank=True, help_text="Empty: nobody waits for it; workers compute it last."
    )
    begun_at = models.DateTimeField(
        null=True, blank=True, help_text="When a worker last began it; without a result, it failed."
    )
    computed_at = models.DateTimeField(null=True, blank=True)
    differences = models.JSONField(
        null=True,
        blank=True,
        help_text="By score name: first minus second, its 95 % interval, p and what it is below.",
    )

    class Meta:
        constraints = [
            models.UniqueConstraint(fields=["edition", "first", "second"], name="one_comparison_per_pair"),
        ]
        indexes = [
            models.Index(
                fields=["begun_at", "asked_at"],
                condition=models.Q(computed_at=None),
                name="comparison_in_turn",
            ),
        ]

    def __str__(self) -> str:
        return f"{self.first_id} against {self.second_id}"


class Analysis(models.Model):
    """An error analysis for the owner of an entry. Never of a hidden split."""

    evaluation = models.OneToOneField(Evaluation, on_delete=models.CASCADE, related_name="analysis")
    content = models.JSONField(help_text="Error by time to contact, distribution, scatter, worst recordings.")
    made_at = models.DateTimeField(default=timezone.now)

    def __str__(self) -> str:
        return f"analysis of {self.evaluation_id}"
