"""The page behind the link of a mail about a changed account: the owner takes the account back."""

from typing import Final

from django import forms
from django.contrib import messages
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.utils import timezone
from django.views.decorators.cache import never_cache
from django.views.decorators.debug import sensitive_variables

from leaderboard.moderation import takeovers
from leaderboard.web.account.accounts import ResetPasswordForm
from leaderboard.web.decorators import asks_first
from leaderboard.web.forms import SiteForm

_CHANGES: Final = {
    "email_added": "An email address was added",
    "email_changed": "The primary email address was changed",
    "email_deleted": "An email address was removed",
    "password_changed": "The password was changed",
    "password_set": "A password was set",
    "password_reset": "The password was reset",
    "totp_activated": "Two-factor authentication was switched on",
    "totp_deactivated": "Two-factor authentication was switched off",
    "recovery_codes_generated": "New recovery codes were created",
    "account_connected": "Another account was connected",
    "account_disconnected": "A connected account was removed",
}


class UndoForm(SiteForm):
    since = forms.TypedChoiceField(
        label="Which was the first change that you did not make?",
        coerce=int,
        required=False,
        empty_value=None,
        widget=forms.RadioSelect,
        help_text="This change and all later ones are undone.",
    )


def _form(request: HttpRequest, link: takeovers.Undo) -> UndoForm:
    form = UndoForm.asked(request, initial={"since": link.changes[0].pk})
    form.fields["since"].choices = [  # type: ignore[attr-defined]  # a field of choices
        (row.pk, f"{_CHANGES.get(row.what, 'The account was changed')}, {row.at:%Y-%m-%d %H:%M} UTC")
        for row in link.changes
    ]
    return form


@never_cache
@sensitive_variables("secret")
@asks_first
def undo(request: HttpRequest, secret: str) -> HttpResponse:
    """Show what the link undoes; a posted form undoes it, and mails a link to choose a new password."""
    now = timezone.now()
    try:
        link = takeovers.find(secret=secret, now=now)
        form = _form(request, link)
        if form.is_valid():
            with form.refusals():
                user = takeovers.undo(secret=secret, since=form.cleaned_data["since"], now=now)
                return _lead_to_password(request, address=link.address, user_id=user.pk)
    except takeovers.UnusableLink as fault:
        return render(request, "account/undo_unusable.html", {"sentence": str(fault)}, status=410)
    return render(
        request, "account/undo.html", {"form": form, "link": link}, status=422 if form.errors else 200
    )


def _lead_to_password(request: HttpRequest, *, address: str, user_id: int) -> HttpResponse:
    if request.user.is_anonymous or request.user.pk == user_id:
        request.session.flush()
    reset = ResetPasswordForm({"email": address})
    if reset.is_valid():
        reset.save(request)
    messages.success(request, "The account is yours again. Choose a new password with the link in our mail.")
    return redirect("account_reset_password_done")
