"""The filter form of the audit trail."""

from datetime import UTC, date, datetime, time, timedelta
from functools import partial
from typing import Any

from django import forms

from leaderboard.models import AuditEvent
from leaderboard.web.forms import SiteForm

DAY = timedelta(days=1)


def _day(label: str) -> forms.DateField:
    return forms.DateField(
        label=label,
        required=False,
        input_formats=["%Y-%m-%d"],
        widget=forms.DateInput(attrs={"type": "date"}),
        error_messages={"invalid": "That is no date; expected one like 2026-11-20."},
    )


def _occurring(name: str) -> list[tuple[str, str]]:
    words = AuditEvent.objects.order_by(name).values_list(name, flat=True).distinct()
    return [("", "any"), *((word, word) for word in words)]


class AuditFilter(SiteForm):
    """By whom, what, to what, and when (days of UTC, both included)."""

    actor = forms.CharField(label="Actor (part of the email address)", required=False, max_length=254)
    verb = forms.ChoiceField(label="Action", required=False, choices=partial(_occurring, "verb"))
    noun = forms.ChoiceField(label="Object type", required=False, choices=partial(_occurring, "noun"))
    noun_id = forms.CharField(label="Object ID (prefix)", required=False, max_length=80)
    since = _day("From")
    until = _day("To")

    def wanted(self) -> dict[str, Any]:
        """What was filled in, under the domain function's names."""
        fields = {name: value for name, value in self.cleaned_data.items() if value}
        if "since" in fields:
            fields["since"] = _midnight(fields["since"])
        if "until" in fields:
            # The calendar ends with the year 9999, and has no day after its last.
            fields["until"] = _midnight(min(fields["until"], date.max - DAY) + DAY)
        return fields


def _midnight(day: date) -> datetime:
    return datetime.combine(day, time(), tzinfo=UTC)
