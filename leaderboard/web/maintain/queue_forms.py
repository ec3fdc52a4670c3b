"""Forms of the queue page: filter and retry."""

from typing import Any

from django import forms

from leaderboard.models import Evaluation, Split
from leaderboard.web.forms import SiteForm
from leaderboard.web.maintain.queue_tables import STATES

_NONE_CHOSEN = "No evaluation was chosen; expected evaluations with a system error."


class QueueFilter(SiteForm):
    """Which of the lists, and of which split."""

    state = forms.ChoiceField(
        required=False,
        choices=[("", "all"), *((name, state.heading) for name, state in STATES.items())],
        error_messages={"invalid_choice": f"There is no such state; expected one of {', '.join(STATES)}."},
    )
    split = forms.ChoiceField(required=False)

    def __init__(self, *args: Any, **options: Any) -> None:
        """The splits to choose from are those that there are."""
        super().__init__(*args, **options)
        names = list(Split.objects.values_list("name", flat=True))
        split = self.fields["split"]
        split.choices = [("", "all"), *((name, name) for name in names)]  # type: ignore[attr-defined]  # a ChoiceField
        split.error_messages["invalid_choice"] = (
            f"There is no such split; expected one of {', '.join(names)}."
        )


class RetryForm(forms.Form):
    """Which evaluations to queue again: at most a page of them."""

    evaluation = forms.ModelMultipleChoiceField(
        queryset=Evaluation.objects.defer("report", "problems"),
        error_messages={
            "required": _NONE_CHOSEN,
            "invalid_choice": "There is no evaluation %(value)s; expected evaluations with a system error.",
        },
    )
