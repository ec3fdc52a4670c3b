"""Forms for a new password, with the API tokens of the account: they do not end with the old one."""

from typing import TYPE_CHECKING, Any, Final

from allauth.account import forms as allauth_forms
from django import forms
from django.utils import timezone

from evaluator.counting import counted
from leaderboard.models import ApiToken, User
from leaderboard.people import tokens

if TYPE_CHECKING:
    _Form = forms.Form
else:
    _Form = object


# What the validators of `settings.AUTH_PASSWORD_VALIDATORS` ask for.
VALIDATORS_HELP: Final = (
    "At least 8 characters. Not a common password, not only digits, and not similar to your name or email."
)


class _RevokesTokens(_Form):
    user: User
    is_ticked = False

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.fields["password1"].help_text = VALIDATORS_HELP
        rows = tokens.active(user=self.user, now=timezone.now()) if self.user else []
        if rows:
            self.fields["revoke_tokens"] = forms.BooleanField(
                label=f"Revoke {counted(len(rows), 'API token')}",
                required=False,
                initial=self.is_ticked,
                help_text=f"They stay valid otherwise: {', '.join(row.name for row in rows)}.",
            )

    def revoke(self) -> None:
        """Revoke the tokens if the box is ticked."""
        if self.cleaned_data.get("revoke_tokens"):
            now = timezone.now()
            for row in ApiToken.objects.filter(user=self.user):
                tokens.revoke(token=row, now=now, actor=self.user, how="with a new password")


class ChangePasswordForm(_RevokesTokens, allauth_forms.ChangePasswordForm):
    def save(self) -> None:
        super().save()
        self.revoke()


class SetPasswordForm(_RevokesTokens, allauth_forms.SetPasswordForm):
    def save(self) -> None:
        super().save()
        self.revoke()


class ResetPasswordKeyForm(_RevokesTokens, allauth_forms.ResetPasswordKeyForm):
    # Who resets a password may have lost the account to somebody else, who has made a token.
    is_ticked = True

    def save(self) -> None:
        super().save()
        self.revoke()
