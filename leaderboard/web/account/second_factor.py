"""The second factor on the pages: what allauth is told of this site."""

from allauth.mfa.adapter import DefaultMFAAdapter
from allauth.mfa.models import Authenticator
from django.conf import settings


class SecondFactorAdapter(DefaultMFAAdapter):
    """The names and the words of this site."""

    error_messages = {
        **DefaultMFAAdapter.error_messages,
        "cannot_delete_authenticator": "Maintainers of this site must have a second factor.",
        "cannot_generate_recovery_codes": "Recovery codes need a second factor; set up an app first.",
        "incorrect_code": "That is not the code of this moment, or it was used already; expected the one "
        "that the app shows now.",
        "unverified_email": "Verify all email addresses of the account before you set up a second factor.",
    }

    def get_totp_issuer(self) -> str:
        """The name that the app shows: the site's, whatever `Host` a request names."""
        return str(settings.SITE_NAME)

    def can_delete_authenticator(self, authenticator: Authenticator) -> bool:
        """Whether somebody may go on without it."""
        return not (settings.REQUIRE_SECOND_FACTOR and authenticator.user.is_maintainer)
