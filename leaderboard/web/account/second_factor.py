"""The second factor on the pages: what allauth is told of this site, and who must have one."""

from allauth.account.authentication import get_authentication_records
from allauth.mfa.adapter import DefaultMFAAdapter
from allauth.mfa.models import Authenticator
from django.conf import settings
from django.http import HttpRequest

from leaderboard.models import User
from leaderboard.people import second_factor


class SecondFactorAdapter(DefaultMFAAdapter):
    """The names and the words of this site."""

    error_messages = {
        **DefaultMFAAdapter.error_messages,
        "cannot_delete_authenticator": "Maintainers of this site must have a second factor.",
        "cannot_generate_recovery_codes": "Recovery codes need a second factor; set up an app first.",
        "incorrect_code": "That is not the code of this moment; expected the six digits that the app shows "
        "now, or a recovery code that was not used yet.",
        "unverified_email": "Verify all email addresses of the account before you set up a second factor.",
    }

    def get_totp_issuer(self) -> str:
        """The name that the app shows: the site's, whatever `Host` a request names."""
        return str(settings.SITE_NAME)

    def can_delete_authenticator(self, authenticator: Authenticator) -> bool:
        """Whether somebody may go on without it."""
        return not (settings.REQUIRE_SECOND_FACTOR and authenticator.user.is_maintainer)


def missing_step(request: HttpRequest, user: User) -> str:
    """The name of the page that a maintainer has to pass first; empty where nothing is missing.

    It is the session that has to be opened with a code: one that was opened by a password alone, before the
    app was set up, is no better for it.
    """
    if not settings.REQUIRE_SECOND_FACTOR or not user.is_maintainer:
        return ""
    if not second_factor.is_set_up(user):
        return "mfa_activate_totp"
    has_given_a_code = any(each.get("method") == "mfa" for each in get_authentication_records(request, user))
    return "" if has_given_a_code else "mfa_reauthenticate"
