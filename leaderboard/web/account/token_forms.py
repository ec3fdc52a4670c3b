"""The form of a new API token."""

from typing import Any

from django import forms

from leaderboard.models import Scope, Split
from leaderboard.people import tokens
from leaderboard.web.forms import SiteForm


def _splits() -> list[tuple[str, str]]:
    names = Split.objects.shown().values_list("pk", flat=True)
    return [("", "all splits"), *((name, f"{name} only") for name in names)]


class TokenForm(SiteForm):
    """A token's name and limits. What is wrong with them the verb says."""

    name = forms.CharField(
        help_text="What it is for, such as “nightly CI”.",
        widget=forms.TextInput(attrs={"maxlength": 80, "autocomplete": "off"}),
        error_messages={"required": "The token has no name; expected what it is for."},
    )
    scopes = forms.MultipleChoiceField(
        choices=[
            (Scope.SUBMIT, "submit: submit and withdraw files, edit and publish methods"),
            (Scope.READ, "read: read results"),
        ],
        initial=list(Scope.values),
        error_messages={"required": "The token has no scope; expected read, submit, or both."},
    )
    split = forms.ChoiceField(label="Scope", required=False, choices=_splits)
    days = forms.IntegerField(
        label="Expires in (days)",
        initial=tokens.DAYS,
        help_text=f"At most {tokens.MAX_DAYS}.",
        widget=forms.NumberInput(attrs={"min": 1, "max": tokens.MAX_DAYS}),
        error_messages={
            "required": f"No number of days was given; expected 1 to {tokens.MAX_DAYS}.",
            "invalid": f"That is no whole number of days; expected 1 to {tokens.MAX_DAYS}.",
        },
    )

    def token(self) -> dict[str, Any]:
        """What was filled in, under the domain function's names."""
        fields = self.cleaned_data
        return {
            "name": fields["name"],
            "scopes": fields["scopes"],
            "split_name": fields["split"],
            "days": fields["days"],
        }
