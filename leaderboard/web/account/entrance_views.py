"""Pages of allauth that tell too much as they are, or keep too little."""

from allauth.account.stages import EmailVerificationStage, LoginStageController
from allauth.account.views import email, email_verification_sent
from django.contrib.auth.decorators import login_required
from django.http import HttpRequest, HttpResponseBase
from django.shortcuts import redirect

from leaderboard.models import User
from leaderboard.moderation import takeovers
from leaderboard.web.account.accounts import PROVED_BEFORE


def confirm_address(request: HttpRequest) -> HttpResponseBase:
    """Ask for the code, in the session of the sign-up alone.

    allauth shows the page for a taken address also where the sign-up is over, and not for a free one.
    """
    is_signing_up = LoginStageController.enter(request, EmailVerificationStage.key)
    if request.user.is_anonymous and not is_signing_up:
        return redirect("account_login")
    return email_verification_sent(request)


@login_required
def own_addresses(request: HttpRequest) -> HttpResponseBase:
    """Show and change one's addresses, knowing which there were before."""
    if isinstance(request.user, User):
        setattr(request, PROVED_BEFORE, takeovers.proved(request.user))
    return email(request)
