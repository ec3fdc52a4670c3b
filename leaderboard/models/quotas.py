"""Quotas of splits, and of single teams."""

from datetime import timedelta
from typing import Final

from django.core.exceptions import ValidationError
from django.db import models
from django.db.models import Q
from django.utils import timezone

from leaderboard.models.people import Team, User

MAX_SPAN: Final = timedelta(days=3650)
"""The longest window, and the longest gap: ten years."""

MAX_COUNT: Final = 1_000_000
"""The largest limit that somebody can set. One that stands in the database from before holds."""
EXCESS: Final = {
    "quota_limit": f"The limit is %(show_value)s submissions; expected at most {MAX_COUNT:,}, or none.",
    "quota_rejected_limit": f"The limit is %(show_value)s rejected files; "
    f"expected at most {MAX_COUNT:,}, or none.",
}


def excess(**counts: int | None) -> dict[str, str]:
    """Return, by field of `QuotaRules`, the problem of each limit that is too large."""
    return {
        name: EXCESS[name] % {"show_value": count}
        for name, count in counts.items()
        if count is not None and count > MAX_COUNT
    }


class QuotaRules(models.Model):
    """Four limits; each counts submissions of one team to one split."""

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
        constraints = [
            models.CheckConstraint(
                condition=Q(quota_window__gt=timedelta(0), quota_window__lte=MAX_SPAN),
                name="%(class)s_window_is_above_0_and_at_most_10_years",
            ),
            models.CheckConstraint(
                condition=Q(quota_min_gap__gte=timedelta(0), quota_min_gap__lte=MAX_SPAN),
                name="%(class)s_gap_is_from_0_to_10_years",
            ),
        ]

    def __str__(self) -> str:
        return f"{self.quota_limit} in {self.quota_window}, {self.quota_min_gap} apart"

    def clean(self) -> None:
        super().clean()
        faults = self.faults()
        if faults:
            raise ValidationError(faults)

    def faults(self) -> dict[str, str]:
        """Return the problem of each rule that makes no sense, by field."""
        faults = {}
        for name in ("quota_limit", "quota_rejected_limit"):
            count = getattr(self, name)
            if count is not None and count < 0:
                faults[name] = f"The number is {count}; expected one from 0, or nothing."
        if self.quota_window is not None and not _is_span(self.quota_window, is_none_allowed=False):
            faults["quota_window"] = (
                f"The window is {self.quota_window}; expected whole seconds, more than 0 and at most "
                f"{MAX_SPAN.days:,} days."
            )
        if self.quota_min_gap is not None and not _is_span(self.quota_min_gap, is_none_allowed=True):
            faults["quota_min_gap"] = (
                f"The least time apart is {self.quota_min_gap}; expected whole seconds, from 0 to "
                f"{MAX_SPAN.days:,} days."
            )
        return faults


def _is_span(span: timedelta, *, is_none_allowed: bool) -> bool:
    is_long_enough = span >= timedelta(0) if is_none_allowed else span > timedelta(0)
    return is_long_enough and span <= MAX_SPAN and not span.microseconds


class QuotaOverride(QuotaRules):
    """The quota of one team on one split, in place of the split's own."""

    team = models.ForeignKey(Team, on_delete=models.CASCADE, related_name="quota_overrides")
    split = models.ForeignKey("Split", on_delete=models.CASCADE, related_name="quota_overrides")
    reason = models.CharField(max_length=500, help_text="Why this team has other rules than the rest.")
    set_by = models.ForeignKey(User, null=True, blank=True, on_delete=models.SET_NULL, related_name="+")
    set_at = models.DateTimeField(default=timezone.now)

    class Meta:
        constraints = [
            *QuotaRules.Meta.constraints,
            models.UniqueConstraint(fields=["team", "split"], name="one_quota_override_per_team_and_split"),
        ]

    def __str__(self) -> str:
        return f"{self.team} on {self.split_id}: {super().__str__()}"


class SpentMailbox(models.Model):
    """A mailbox that an account had when it sent files, as a keyed hash; see `quotas.mailboxes`."""

    account = models.ForeignKey(User, on_delete=models.CASCADE, related_name="+")
    digest = models.CharField(max_length=64, db_index=True)
    sent_until = models.DateTimeField(help_text="What the account sent later does not count for the mailbox.")
    kept_until = models.DateTimeField(db_index=True)

    class Meta:
        constraints = [
            models.UniqueConstraint(fields=["account", "digest"], name="mailbox_is_kept_once_per_account"),
        ]

    def __str__(self) -> str:
        return f"a mailbox of the account {self.account_id}"


class OldAddress(models.Model):
    """An address that cannot have its one spelling, because another account has that, and its mailbox.

    Such addresses are from before `addresses.spelled`. Both accounts sign in as ever, and share a quota.
    """

    address = models.CharField(max_length=254, unique=True)
    mailbox = models.CharField(max_length=254, db_index=True)

    def __str__(self) -> str:
        return self.address


class Admission(models.Model):
    """A team's admission to a split."""

    team = models.ForeignKey(Team, on_delete=models.CASCADE, related_name="admissions")
    split = models.ForeignKey("Split", on_delete=models.CASCADE, related_name="admissions")
    reason = models.CharField(max_length=500, help_text="Why. The team does not see it.")
    admitted_by = models.ForeignKey(User, null=True, blank=True, on_delete=models.SET_NULL, related_name="+")
    admitted_at = models.DateTimeField(default=timezone.now)

    class Meta:
        constraints = [
            models.UniqueConstraint(fields=["team", "split"], name="one_admission_per_team_and_split"),
        ]

    def __str__(self) -> str:
        return f"{self.team} on {self.split_id}"
