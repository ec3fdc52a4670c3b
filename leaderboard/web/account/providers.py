"""Sign-in by ORCID or GitHub, each where the settings name a client of it.

Of a provider's answer count its id of the person and one verified address. An address with an account here
opens nothing: its owner signs in first, and then connects the two. Only the id and GitHub's login name are
kept.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Final

import requests
import structlog
from allauth.account.models import EmailAddress
from allauth.core.exceptions import ImmediateHttpResponse
from allauth.socialaccount.adapter import DefaultSocialAccountAdapter
from allauth.socialaccount.forms import DisconnectForm, SignupForm
from allauth.socialaccount.models import SocialAccount, SocialLogin
from allauth.socialaccount.providers.base.constants import AuthError, AuthProcess
from allauth.socialaccount.providers.github.views import GitHubOAuth2Adapter
from allauth.socialaccount.providers.oauth2.client import OAuth2Error
from allauth.socialaccount.providers.oauth2.views import (
    OAuth2Adapter,
    OAuth2CallbackView,
    OAuth2LoginView,
)
from allauth.socialaccount.providers.orcid.views import OrcidOAuth2Adapter
from django.conf import settings
from django.core.exceptions import ImproperlyConfigured
from django.http import HttpRequest
from django.shortcuts import render
from django.urls import URLPattern, URLResolver, include, path

from leaderboard.errors.refusals import Refused
from leaderboard.models import User
from leaderboard.people import addresses
from leaderboard.web.account.accounts import OwnersAddress

log = structlog.get_logger(__name__)


def patterns() -> list[URLPattern | URLResolver]:
    """Return the addresses, below `/accounts/`, of the providers that are offered."""
    chosen = [pattern for name in settings.SOCIALACCOUNT_PROVIDERS for pattern in _PATTERNS[name]]
    return [path("3rdparty/", include("allauth.socialaccount.urls")), *chosen] if chosen else []


class MalformedAnswer(OAuth2Error):
    """A provider's answer lacks what its documentation promises."""


@contextmanager
def _malformed_answers() -> Iterator[None]:
    """Turn allauth's errors for unexpected answers into one of the provider."""
    try:
        yield
    except requests.RequestException:
        raise
    except (
        LookupError,
        TypeError,
        ValueError,
        ArithmeticError,
        AttributeError,
        ImproperlyConfigured,
    ) as fault:
        raise MalformedAnswer(type(fault).__name__) from fault


class _ProviderViews(OAuth2Adapter):
    def get_access_token_data(self, *args: Any, **kwargs: Any) -> Any:
        with _malformed_answers():
            return super().get_access_token_data(*args, **kwargs)

    def parse_token(self, data: Any) -> Any:
        with _malformed_answers():
            return super().parse_token(data)

    def complete_login(self, request: HttpRequest, app: Any, token: Any, **kwargs: Any) -> SocialLogin:
        """Return the login with at most one address, which is verified."""
        with _malformed_answers():
            login = super().complete_login(request, app, token, **kwargs)
            verified = self.verified(login)
            login.email_addresses = verified[:1]
            login.user.email = verified[0].email if verified else ""
            login.account.extra_data = self.kept(login.account.extra_data)
            return login

    def verified(self, login: SocialLogin) -> list[EmailAddress]:
        """Return the addresses that the provider has verified, the primary one first."""
        raise NotImplementedError

    def kept(self, profile: Mapping[str, Any]) -> dict[str, str]:
        """Return what is kept of the profile."""
        return {}


class OrcidViews(_ProviderViews, OrcidOAuth2Adapter):
    def verified(self, login: SocialLogin) -> list[EmailAddress]:
        person = login.account.extra_data.get("person") or {}
        rows = (person.get("emails") or {}).get("email") or []
        rows = [row for row in rows if row.get("verified") is True and row.get("email")]
        return _sorted((row["email"], row.get("primary") is True) for row in rows)


class GitHubViews(_ProviderViews, GitHubOAuth2Adapter):
    def verified(self, login: SocialLogin) -> list[EmailAddress]:
        rows = [row for row in login.email_addresses if row.verified is True]
        return _sorted((row.email, row.primary is True) for row in rows)

    def kept(self, profile: Mapping[str, Any]) -> dict[str, str]:
        return {"login": str(profile.get("login", ""))[:100]}


def _sorted(verified: Iterator[tuple[str, bool]]) -> list[EmailAddress]:
    """Return the addresses that an account may have, the primary ones first."""
    rows = []
    for text, is_primary in verified:
        try:
            address = addresses.accepted(text)
        except Refused:
            continue
        rows.append(EmailAddress(email=address, verified=True, primary=is_primary))
    return sorted(rows, key=lambda row: (not row.primary, row.email))


class ProviderAdapter(DefaultSocialAccountAdapter):
    """Decides what a provider's login opens, and words its failures."""

    error_messages = {
        **DefaultSocialAccountAdapter.error_messages,
        "no_password": "Without this account you could no longer sign in; set a password first.",
        "no_verified_email": "Without this account you could no longer sign in; verify an address first.",
    }

    def pre_social_login(self, request: HttpRequest, sociallogin: SocialLogin) -> None:
        # Stop where the address has an account that is not connected.
        # It would wait in the session, and nobody needs it any more.
        sociallogin.token = None
        is_sign_in = sociallogin.state.get("process", AuthProcess.LOGIN) == AuthProcess.LOGIN
        address = sociallogin.user.email if sociallogin.user else ""
        if sociallogin.is_existing or not is_sign_in or not address:
            return
        if not addresses.accounts_of(address).exists():
            return
        context = {"provider": sociallogin.provider, "address": address}
        raise ImmediateHttpResponse(render(request, "socialaccount/known_address.html", context, status=409))

    def on_authentication_error(
        self,
        request: HttpRequest,
        provider: Any,
        error: Any = None,
        exception: Exception | None = None,
        extra_context: dict[str, Any] | None = None,
    ) -> None:
        # The log has the kind of error, nothing that the provider said.
        if error == AuthError.CANCELLED:
            return
        log.warning("provider_failed", provider=provider.id, fault=type(exception).__name__)
        if extra_context is not None:
            extra_context["sentence"] = _sentence(provider.app.name, exception, request)


def _sentence(name: str, exception: Exception | None, request: HttpRequest) -> str:
    if isinstance(exception, requests.Timeout):
        return f"{name} did not answer in time. The fault is not yours: try again later."
    if isinstance(exception, requests.exceptions.JSONDecodeError | OAuth2Error):
        return f"The answer of {name} was not understood. The fault is not yours: try again later."
    if isinstance(exception, requests.RequestException):
        return f"{name} could not be reached, or failed. The fault is not yours: try again later."
    if "error" in request.GET:
        return f"{name} refused the sign-in."
    return (
        "This sign-in was started in another browser, was started more than ten minutes ago, or is already "
        "finished. Start the sign-in again."
    )


class ProviderSignupForm(OwnersAddress, SignupForm):
    """Address and name; an address that the provider verified counts as proved."""

    def save(self, request: HttpRequest) -> User:
        typed = self.cleaned_data["email"]
        verified = self.sociallogin.email_addresses
        self.sociallogin.email_addresses = [each for each in verified if each.email == typed]
        user: User = super().save(request)
        return user


class ConnectedForm(DisconnectForm):
    """Connected accounts of the providers that the site offers now."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        offered_here = settings.SOCIALACCOUNT_PROVIDERS
        mine = SocialAccount.objects.filter(user=kwargs["request"].user, provider__in=offered_here)
        super().__init__(*args, **kwargs)
        self.accounts = self.fields["account"].queryset = mine
        self.fields["account"].error_messages["required"] = "No account was chosen; expected one of the list."


def _of(name: str, views: type[OAuth2Adapter]) -> list[URLPattern]:
    login = OAuth2LoginView.adapter_view(views)
    callback = OAuth2CallbackView.adapter_view(views)
    return [
        path(f"{name}/login/", login, name=f"{name}_login"),
        path(f"{name}/login/callback/", callback, name=f"{name}_callback"),
    ]


_PATTERNS: Final[dict[str, list[URLPattern]]] = {
    "orcid": _of("orcid", OrcidViews),
    "github": _of("github", GitHubViews),
}
