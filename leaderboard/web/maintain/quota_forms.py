"""Forms of quotas and admissions."""

from datetime import timedelta
from typing import Any, Final

from django import forms

from leaderboard.errors.refusals import Refused
from leaderboard.models.quotas import EXCESS, MAX_COUNT, QuotaRules
from leaderboard.quotas.spans import parse_span, span
from leaderboard.web.forms import SiteForm
from leaderboard.web.maintain.maintainer_forms import reason_field

_FOR_MAINTAINERS: Final = (
    "Required: one sentence for maintainers and the audit log. The team does not see it."
)


class SpanField(forms.CharField):
    """A span of time as `spans.span` words it."""

    def __init__(self, **options: Any) -> None:
        super().__init__(max_length=40, **options)

    def clean(self, value: Any) -> timedelta:
        """Parse the span; empty is none. Raises `ValidationError`."""
        text: str = super().clean(value)
        try:
            time = parse_span(text) if text else timedelta(0)
        except Refused as refusal:
            raise forms.ValidationError(str(refusal)) from refusal
        if self.required and not time:
            raise forms.ValidationError("The window is empty; expected one like 30 days or 24 hours.")
        return time


def _count_field(name: str, label: str, help_text: str) -> forms.IntegerField:
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


class QuotaRulesForm(SiteForm):
    quota_limit = _count_field(
        "quota_limit",
        "Submissions per team",
        "Maximum per time window. Empty: no limit; 0: none allowed.",
    )
    quota_window = SpanField(
        label="Time window",
        help_text="The period over which submissions are counted, for example 30 days or 24 hours.",
        error_messages={"required": "No window was given; expected one like 30 days or 24 hours."},
    )
    quota_min_gap = SpanField(
        label="Time between submissions",
        required=False,
        help_text="Shortest time between two submissions of a team. Empty: none.",
    )
    quota_rejected_limit = _count_field(
        "quota_rejected_limit",
        "Rejected or cancelled files",
        "Per team in 24 hours. Empty: no limit.",
    )


class OverrideForm(QuotaRulesForm):
    reason = reason_field(_FOR_MAINTAINERS, max_length=500)

    @staticmethod
    def filled_with(rules: QuotaRules) -> dict[str, Any]:
        """Return the initial values: rules without their reason."""
        return {
            "quota_limit": rules.quota_limit,
            "quota_window": span(rules.quota_window),
            "quota_min_gap": span(rules.quota_min_gap) if rules.quota_min_gap else "",
            "quota_rejected_limit": rules.quota_rejected_limit,
        }

    def rules(self) -> dict[str, Any]:
        """Return the cleaned fields under the names of `usage.override`."""
        return {name.removeprefix("quota_"): value for name, value in self.cleaned_data.items()}


class EndForm(SiteForm):
    """The reason why a team's own rules end, or its admission begins or ends."""

    reason = reason_field(_FOR_MAINTAINERS, max_length=500)
