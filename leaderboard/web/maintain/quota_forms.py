"""What maintainers fill in to look up a team, and to give it rules of its own or take them back."""

import re
from datetime import timedelta
from typing import Any, Final
from urllib.parse import urlencode

from django import forms

from leaderboard import quotas
from leaderboard.models.quotas import MAX_SPAN, QuotaRules
from leaderboard.web.maintainer_forms import VerbForm

MAX_COUNT: Final = 1_000_000
_UNITS: Final = {
    "day": timedelta(days=1),
    "hour": timedelta(hours=1),
    "minute": timedelta(minutes=1),
    "second": timedelta(seconds=1),
}
_SPAN: Final = re.compile(rf"\s*([\d,]{{1,12}})\s+({'|'.join(_UNITS)})s?\s*", re.ASCII | re.IGNORECASE)


class TeamLookup(forms.Form):
    """A part of a team's name, or of the address of somebody in it."""

    team = forms.CharField(label="Team, or address of somebody in it", required=False, max_length=254)

    def query(self) -> str:
        """The same as the query of an address."""
        return urlencode({"team": self.cleaned_data["team"]})


class SpanField(forms.CharField):
    """A span of time in the words in which `quotas.span` says it."""

    default_error_messages = {
        "not_a_span": "%(given)s is no span of time; expected one like 30 days, 24 hours or 90 minutes.",
        "too_short": "A window of no length holds nothing; expected one like 30 days or 24 hours.",
        "too_long": f"That is longer than ten years; expected at most {quotas.span(MAX_SPAN)}.",
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
        found = _SPAN.fullmatch(text)
        number = found[1].replace(",", "") if found else ""
        if found is None or not number:
            raise forms.ValidationError(self.error_messages["not_a_span"], params={"given": repr(text)})
        n, unit = int(number), _UNITS[found[2].lower()]
        if n > MAX_SPAN // unit:
            raise forms.ValidationError(self.error_messages["too_long"])
        if n == 0 and not self._may_be_none:
            raise forms.ValidationError(self.error_messages["too_short"])
        return n * unit


def _count(label: str, help_text: str) -> forms.IntegerField:
    return forms.IntegerField(
        label=label,
        required=False,
        min_value=0,
        max_value=MAX_COUNT,
        help_text=help_text,
        widget=forms.NumberInput(attrs={"inputmode": "numeric"}),
        error_messages={
            "invalid": "That is no whole number; expected one from 0, or nothing.",
            "min_value": "There are no fewer than 0; expected a whole number from 0, or nothing.",
            "max_value": f"That is too many; expected at most {MAX_COUNT:,}, or nothing.",
        },
    )


def _reason(missing: str) -> forms.CharField:
    return forms.CharField(
        max_length=500,
        widget=forms.Textarea(attrs={"rows": 3}),
        help_text="A sentence for maintainers and the audit log. The team does not see it.",
        error_messages={"required": missing},
    )


class _DescribedForm(VerbForm):
    """A form whose fields name their help and their errors to readers by ear."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        for name, field in self.fields.items():
            described = [f"{name}-help"] if field.help_text else []
            field.widget.attrs["aria-describedby"] = " ".join([*described, f"{name}-error"])


class OverrideForm(_DescribedForm):
    """Four limits and why this team has them. The names are those of `quotas.override`."""

    limit = _count("Submissions", "Within the window. Empty: as many as they like; 0: none at all.")
    window = SpanField(
        may_be_none=False,
        help_text="Length of the rolling window, like 30 days or 24 hours.",
        error_messages={"required": "No window was given; expected one like 30 days or 24 hours."},
    )
    min_gap = SpanField(
        label="Apart", may_be_none=True, help_text="Least time between two submissions. Empty: none."
    )
    rejected_limit = _count(
        "Rejected or cancelled files", "Within 24 hours; they cost nothing else. Empty: as many as they like."
    )
    reason = _reason("No reason was given; expected a sentence for the audit log.")

    @staticmethod
    def filled_with(rules: QuotaRules) -> dict[str, Any]:
        """What stands in the form at first: rules as they are, without their reason."""
        return {
            "limit": rules.quota_limit,
            "window": quotas.span(rules.quota_window),
            "min_gap": quotas.span(rules.quota_min_gap) if rules.quota_min_gap else "",
            "rejected_limit": rules.quota_rejected_limit,
        }


class EndForm(_DescribedForm):
    """Why a team's own rules end."""

    reason = _reason("No reason was given; expected a sentence for the audit log.")
