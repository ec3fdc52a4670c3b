"""The middleware of each request, and the content security policy."""

from collections.abc import Iterable
from typing import Any, Final

from csp.constants import NONE, SELF

MIDDLEWARE: Final = [
    # First, so that every line that a request causes carries its id.
    "leaderboard.web.middleware.request_log.RequestLogMiddleware",
    # What anything below answers, from memory or from a view, gets the same headers.
    "leaderboard.web.middleware.response_headers.HeadersMiddleware",
    # Before anything that asks for the name of the site.
    "leaderboard.web.middleware.monitoring_host.MonitoringHostMiddleware",
    "django.middleware.security.SecurityMiddleware",
    "whitenoise.middleware.WhiteNoiseMiddleware",
    "csp.middleware.CSPMiddleware",
    "django.middleware.clickjacking.XFrameOptionsMiddleware",
    # Around what is kept, so that an answer is whole where it is remembered and a 304 only for who has it.
    "leaderboard.api.middleware.ApiHeadersMiddleware",
    # Before sessions and accounts, which a visitor without either should not pay for.
    "leaderboard.web.middleware.public_answers.PublicAnswersMiddleware",
    "django.contrib.sessions.middleware.SessionMiddleware",
    "django.middleware.common.CommonMiddleware",
    "django.middleware.csrf.CsrfViewMiddleware",
    "django.contrib.auth.middleware.AuthenticationMiddleware",
    "django.contrib.messages.middleware.MessageMiddleware",
    "allauth.account.middleware.AccountMiddleware",
    "django_htmx.middleware.HtmxMiddleware",
    "leaderboard.web.middleware.second_factor.SecondFactorMiddleware",
    # Last on the way in: their pages need the rest, and nothing before them reads the body.
    "leaderboard.web.middleware.request_limits.RateLimitMiddleware",
    "leaderboard.web.middleware.request_limits.UploadLimitMiddleware",
]
# Where the form that signs in with a provider leads to.
_PROVIDERS: Final = {"orcid": "https://orcid.org", "github": "https://github.com"}


def content_security_policy(providers: Iterable[str]) -> dict[str, Any]:
    """Return the policy: content from this site, forms to it and to these providers."""
    return {
        "DIRECTIVES": {
            "default-src": [NONE],
            "script-src": [SELF],
            "style-src": [SELF],
            "img-src": [SELF, "data:"],
            "font-src": [SELF],
            "connect-src": [SELF],
            "form-action": [SELF, *(_PROVIDERS[name] for name in providers)],
            "base-uri": [NONE],
            "frame-ancestors": [NONE],
        }
    }
