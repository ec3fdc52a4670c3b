"""Pages of allauth for visitors, where allauth's own tell more than they should."""

from allauth.account.stages import EmailVerificationStage, LoginStageController
from allauth.account.views import email_verification_sent
from django.http import HttpRequest, HttpResponseBase
from django.shortcuts import redirect


def confirm_address(request: HttpRequest) -> HttpResponseBase:
    """Ask for the code, in the session of the sign-up alone.

    allauth shows the page for a taken address also where the sign-up is over, and not for a free one.
    """
    is_signing_up = LoginStageController.enter(request, EmailVerificationStage.key)
    if request.user.is_anonymous and not is_signing_up:
        return redirect("account_login")
    return email_verification_sent(request)
