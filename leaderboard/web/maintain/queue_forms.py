"""What maintainers ask the queue for, and what they have retried."""

from typing import Any
from urllib.parse import urlencode

from django import forms

from leaderboard.models import Evaluation, Split
from leaderboard.web.queue_tables import STATES

_NONE_CHOSEN = "Nothing was chosen; expected evaluations that failed by our fault."


class QueueFilter(forms.Form):
    """Which of the lists, and of which split."""

    state = forms.ChoiceField(
        required=False,
        choices=[("", "all"), *((name, state.heading) for name, state in STATES.items())],
        error_messages={"invalid_choice": f"There is no such list; expected one of {', '.join(STATES)}."},
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

    def query(self, **more: Any) -> str:
        """The same as the query of an address, with `more` in it."""
        asked = {**self.cleaned_data, **more}
        return urlencode({name: str(value) for name, value in asked.items() if value})


class RetryForm(forms.Form):
    """Which evaluations to queue again: at most a page of them."""

    evaluation = forms.ModelMultipleChoiceField(
        queryset=Evaluation.objects.defer("report", "problems"),
        error_messages={
            "required": _NONE_CHOSEN,
            "invalid_choice": "There is no evaluation %(value)s; expected ones that failed by our fault.",
        },
    )
