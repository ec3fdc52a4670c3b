"""What maintainers ask the audit trail for."""

from datetime import UTC, date, datetime, time, timedelta
from typing import Any
from urllib.parse import urlencode

from django import forms

from leaderboard.models import AuditEvent

DAY = timedelta(days=1)


def _day(label: str) -> forms.DateField:
    return forms.DateField(
        label=label,
        required=False,
        input_formats=["%Y-%m-%d"],
        widget=forms.DateInput(attrs={"type": "date"}),
        error_messages={"invalid": "That is no date; expected one like 2026-11-20."},
    )


class AuditFilter(forms.Form):
    """By whom, what, to what, and when (days of UTC, both included)."""

    actor = forms.CharField(label="By (part of an address)", required=False, max_length=254)
    verb = forms.ChoiceField(label="Verb", required=False)
    noun = forms.ChoiceField(label="Noun", required=False)
    noun_id = forms.CharField(label="Identity (its beginning)", required=False, max_length=80)
    since = _day("From")
    until = _day("To")

    def __init__(self, *args: Any, **options: Any) -> None:
        """The verbs and nouns to choose from are those that occur."""
        super().__init__(*args, **options)
        for name in ("verb", "noun"):
            words = AuditEvent.objects.order_by(name).values_list(name, flat=True).distinct()
            self.fields[name].choices = [("", "any"), *((word, word) for word in words)]  # type: ignore[attr-defined]  # a ChoiceField

    def wanted(self) -> dict[str, Any]:
        """What was filled in, under the verb's names."""
        fields = {name: value for name, value in self.cleaned_data.items() if value}
        if "since" in fields:
            fields["since"] = _midnight(fields["since"])
        if "until" in fields:
            # The calendar ends with the year 9999, and has no day after its last.
            fields["until"] = _midnight(min(fields["until"], date.max - DAY) + DAY)
        return fields

    def query(self) -> str:
        """The same as the query of an address."""
        return urlencode({name: str(value) for name, value in self.cleaned_data.items() if value})


def _midnight(day: date) -> datetime:
    return datetime.combine(day, time(), tzinfo=UTC)
