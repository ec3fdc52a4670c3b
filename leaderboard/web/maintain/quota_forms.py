"""Forms of quotas: find a team, override its rules, end the override."""

from datetime import timedelta
from typing import Any, Final

from django import forms

from leaderboard.errors.refusals import Refused
from leaderboard.models.quotas import EXCESS, MAX_COUNT, QuotaRules
from leaderboard.quotas.spans import parse_span, span
from leaderboard.web.forms import SiteForm
from leaderboard.web.maintain.maintainer_forms import reason_field

_FOR_MAINTAINERS: Final = "One sentence for maintainers and the audit log. The team does not see it."


class TeamLookup(SiteForm):
    """A part of a team's name, or of somebody's address."""

    team = forms.CharField(label="Team, or email address of a person", required=False, max_length=254)


class SpanField(forms.CharField):
    """A span of time in the words in which `spans.span` says it."""

    default_error_messages = {
        "too_short": "The window is empty; expected one like 30 days or 24 hours.",
    }

    def __init__(self, *, may_be_none: bool, **options: Any) -> None:
        """With `may_be_none`, nothing filled in is no time at all."""
        super().__init__(required=not may_be_none, max_length=40, **options)
        self._may_be_none = may_be_none

    def clean(self, value: Any) -> timedelta:
        """The span. Raises `ValidationError`."""
        text: str = super().clean(value)
        if not text:
            return timedelta(0)
        try:
            time = parse_span(text)
        except Refused as refusal:
            raise forms.ValidationError(str(refusal)) from refusal
        if not time and not self._may_be_none:
            raise forms.ValidationError(self.error_messages["too_short"])
        return time


def count_field(name: str, label: str, help_text: str) -> forms.IntegerField:
    """A limit that may be left out; `name` is its field in `QuotaRules`."""
    return forms.IntegerField(
        label=label,
        required=False,
        min_value=0,
        max_value=MAX_COUNT,
        help_text=help_text,
        widget=forms.NumberInput(attrs={"inputmode": "numeric"}),
        error_messages={
            "invalid": "That is not a whole number; expected 0 or more, or an empty field.",
            "min_value": "The number is negative; expected 0 or more, or an empty field.",
            "max_value": EXCESS[name],
        },
    )


class OverrideForm(SiteForm):
    """Four limits and why this team has them. The names are those of `quotas.override`."""

    limit = count_field("quota_limit", "Submissions", "Within the window. Empty: no limit; 0: none.")
    window = SpanField(
        may_be_none=False,
        help_text="Length of the rolling window, for example 30 days or 24 hours.",
        error_messages={"required": "No window was given; expected one like 30 days or 24 hours."},
    )
    min_gap = SpanField(
        label="Min. interval",
        may_be_none=True,
        help_text="Minimum time between two submissions. Empty: none.",
    )
    rejected_limit = count_field(
        "quota_rejected_limit", "Rejected or cancelled files", "Within 24 hours. Empty: no limit."
    )
    reason = reason_field(_FOR_MAINTAINERS, max_length=500)

    @staticmethod
    def filled_with(rules: QuotaRules) -> dict[str, Any]:
        """What stands in the form at first: rules as they are, without their reason."""
        return {
            "limit": rules.quota_limit,
            "window": span(rules.quota_window),
            "min_gap": span(rules.quota_min_gap) if rules.quota_min_gap else "",
            "rejected_limit": rules.quota_rejected_limit,
        }


class EndForm(SiteForm):
    """Why a team's own rules end, or its admission begins or ends."""

    reason = reason_field(_FOR_MAINTAINERS, max_length=500)
