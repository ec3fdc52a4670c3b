"""Codes of the second factor: guesses are limited, and a code works only once.

Wrong codes are counted by account and address, and by account alone. The last count does not hold at an
address where the account has given a right code, so nobody locks out the owner. A guess is right with
probability 1.1e-6 (one of a million codes, ten of 1e8 recovery codes): 50 a day from all unknown addresses
give 5.5e-5 a day.
"""

from typing import Any

from allauth.account.adapter import get_adapter as account_adapter
from allauth.core import context
from allauth.core.internal import ratelimit
from allauth.mfa.adapter import get_adapter
from allauth.mfa.base import forms
from allauth.mfa.models import Authenticator
from allauth.mfa.totp.forms import ActivateTOTPForm
from allauth.mfa.totp.internal.auth import TOTP
from django.core.cache import cache
from django.http import HttpRequest

from leaderboard.models import User
from leaderboard.web.account.accounts import KNOWN_ADDRESS_S, known_address_key


class _CountedCode(forms.BaseAuthenticateForm):
    def clean_code(self) -> str:
        usage = _count_one(context.request, self.user)
        code: str = self.cleaned_data["code"]
        for each in Authenticator.objects.filter(user=self.user):
            if each.wrap().validate_code(code):
                each.user = self.user
                self.authenticator = each
                # A right code takes back what was counted for it.
                usage.rollback()
                _remember(context.request, self.user)
                return code
        raise get_adapter().validation_error("incorrect_code")


class AuthenticateForm(_CountedCode, forms.AuthenticateForm):
    pass


class ReauthenticateForm(_CountedCode, forms.ReauthenticateForm):
    pass


class ActivateForm(ActivateTOTPForm):
    def clean_code(self) -> Any:
        # allauth uses up the codes of sign-ins alone.
        code = super().clean_code()
        app = Authenticator(user=self.user, type=Authenticator.Type.TOTP)
        if not TOTP(app)._mark_code_used(code):
            raise get_adapter().validation_error("incorrect_code")
        _remember(context.request, self.user)
        return code


def _count_one(request: HttpRequest, user: User) -> ratelimit.RateLimitUsage:
    key = f"{user.pk}:{ratelimit.get_ip(request)}"
    usage = ratelimit.consume(request, app="allauth.account", action="code_failed", key=key)
    if usage and not cache.get(_known(request, user)):
        anywhere = ratelimit.consume(
            request, app="allauth.account", action="code_failed_anywhere", key=str(user.pk)
        )
        if anywhere:
            usage.usage.extend(anywhere.usage)
        else:
            usage.rollback()
            raise account_adapter().validation_error("too_many_codes_today")
    if not usage:
        raise account_adapter().validation_error("too_many_codes")
    return usage


def _remember(request: HttpRequest, user: User) -> None:
    cache.set(_known(request, user), value=True, timeout=KNOWN_ADDRESS_S)


def _known(request: HttpRequest, user: User) -> str:
    return known_address_key(f"code:{user.pk}", ratelimit.get_ip(request))
