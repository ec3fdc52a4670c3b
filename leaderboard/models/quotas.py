"""How much may be sent: the rules of a split, and of single teams that have others."""

from datetime import timedelta

from django.db import models
from django.utils import timezone

from leaderboard.models.people import Team, User


class QuotaRules(models.Model):
    """Four limits. Each counts submissions of one team to one split."""

    quota_limit = models.PositiveIntegerField(
        null=True, blank=True, help_text="Submissions within the window. Empty: as many as one likes."
    )
    quota_window = models.DurationField(
        default=timedelta(days=1), help_text="Length of the rolling window: “30 00:00:00” is thirty days."
    )
    quota_min_gap = models.DurationField(
        default=timedelta(0), help_text="Least time between two submissions: “24:00:00” is a day."
    )
    quota_rejected_limit = models.PositiveIntegerField(
        null=True,
        blank=True,
        default=20,
        help_text="Rejected files within 24 hours, which cost nothing else. Empty: as many as one likes.",
    )

    class Meta:
        abstract = True

    def __str__(self) -> str:
        return f"{self.quota_limit} in {self.quota_window}, {self.quota_min_gap} apart"


class QuotaOverride(QuotaRules):
    """The rules of one team on one split, instead of the split's own. Written by `leaderboard.quotas`."""

    team = models.ForeignKey(Team, on_delete=models.CASCADE, related_name="quota_overrides")
    split = models.ForeignKey("Split", on_delete=models.CASCADE, related_name="quota_overrides")
    reason = models.CharField(max_length=500, help_text="Why this team has other rules than the rest.")
    set_by = models.ForeignKey(User, null=True, blank=True, on_delete=models.SET_NULL, related_name="+")
    set_at = models.DateTimeField(default=timezone.now)

    class Meta:
        constraints = [
            models.UniqueConstraint(fields=["team", "split"], name="one_quota_override_per_team_and_split"),
        ]

    def __str__(self) -> str:
        return f"{self.team} on {self.split_id}: {super().__str__()}"
