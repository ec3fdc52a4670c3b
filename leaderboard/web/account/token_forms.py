"""What people say of a new token, and what they see of those they have."""

from dataclasses import dataclass
from datetime import datetime
from typing import Any

from django import forms

from leaderboard import tokens
from leaderboard.models import ApiToken, Scope, Split, User


class TokenForm(forms.Form):
    """A token's name and limits. What is wrong with them the verb says."""

    name = forms.CharField(
        help_text="What it is for, such as “nightly CI”.",
        widget=forms.TextInput(attrs={"maxlength": 80, "autocomplete": "off"}),
        error_messages={"required": "The token has no name; expected what it is for."},
    )
    scopes = forms.MultipleChoiceField(
        choices=[
            (Scope.SUBMIT, "submit: send and withdraw files, describe methods and show them to others"),
            (Scope.READ, "read: ask what became of them"),
        ],
        initial=list(Scope.values),
        error_messages={"required": "The token has no scope; expected read, submit, or both."},
    )
    split = forms.ChoiceField(label="Good for", required=False)
    days = forms.IntegerField(
        label="Ends after … days",
        initial=tokens.DAYS,
        help_text=f"At most {tokens.MAX_DAYS}.",
        widget=forms.NumberInput(attrs={"min": 1, "max": tokens.MAX_DAYS}),
        error_messages={
            "required": f"No number of days was given; expected 1 to {tokens.MAX_DAYS}.",
            "invalid": f"That is no whole number of days; expected 1 to {tokens.MAX_DAYS}.",
        },
    )

    def __init__(self, *args: Any, **options: Any) -> None:
        """The splits to choose from are all there are."""
        super().__init__(*args, **options)
        names = [(name, f"{name} alone") for name in Split.objects.values_list("pk", flat=True)]
        self.fields["split"].choices = [("", "every split"), *names]  # type: ignore[attr-defined]  # a ChoiceField
        for name, field in self.fields.items():
            field.widget.attrs["aria-describedby"] = (
                f"{name}-help {name}-error" if field.help_text else f"{name}-error"
            )

    def token(self) -> dict[str, Any]:
        """What was filled in, under the verb's names."""
        fields = self.cleaned_data
        return {
            "name": fields["name"],
            "scopes": fields["scopes"],
            "split_name": fields["split"],
            "days": fields["days"],
        }

    def refuse(self, refusal: tokens.Refused) -> None:
        """Put the verb's sentence at the field that it is about."""
        self.add_error(refusal.field if refusal.field in self.fields else None, str(refusal))


@dataclass(frozen=True)
class TokenRow:
    """A token as its owner sees it."""

    token: ApiToken
    state: str
    is_standing: bool


def token_rows(user: User, *, now: datetime) -> list[TokenRow]:
    """The person's tokens, the newest first; those that have ended stay, to tell what an old job used."""
    return [
        TokenRow(token=row, state=tokens.state_of(row, now=now), is_standing=tokens.is_standing(row, now=now))
        for row in ApiToken.objects.filter(user=user).order_by("-created")
    ]
