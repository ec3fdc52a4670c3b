"""How often one may ask: per account, else per address, which nobody can choose for themselves.

The address is the one that the connection comes from, or with `TSTTC_TRUSTED_PROXIES` the one that our own
proxy wrote down; what a visitor puts into X-Forwarded-For before that counts for nothing.
"""

from ipaddress import IPv6Address, ip_address, ip_network
from typing import TYPE_CHECKING

from django.conf import settings
from rest_framework.request import Request
from rest_framework.throttling import SimpleRateThrottle

if TYPE_CHECKING:  # views make their classes with these
    from rest_framework.views import APIView


class Throttle(SimpleRateThrottle):
    """A rate of the settings, which may be none."""

    def get_rate(self) -> str | None:
        """Read when it is needed and not once for ever, so that settings hold."""
        rate: str | None = settings.API_RATES[self.scope or ""]
        return rate

    def named(self, identity: object) -> str:
        """Under which the times of somebody's requests are kept."""
        return f"throttle:{self.scope}:{identity}"

    def address(self, request: Request) -> str:
        """Where a request comes from. Who has an IPv6 address has 2⁶⁴ of them: they count as one."""
        try:
            found = ip_address(self.get_ident(request))
        except ValueError:
            return "unknown"
        return str(ip_network((found, 64), strict=False) if isinstance(found, IPv6Address) else found)


class SignedInThrottle(Throttle):
    """Requests of one account, whatever token it uses."""

    scope = "signed_in"

    def get_cache_key(self, request: Request, view: "APIView") -> str | None:
        """None: not this throttle's concern."""
        return self.named(request.user.pk) if request.user.is_authenticated else None


class VisitorThrottle(Throttle):
    """Requests without an account from one address."""

    scope = "visitor"

    def get_cache_key(self, request: Request, view: "APIView") -> str | None:
        """None: not this throttle's concern."""
        return None if request.user.is_authenticated else self.named(self.address(request))


class SubmitThrottle(SignedInThrottle):
    """Files sent by one account: also those that cost no quota are read and written."""

    scope = "submit"

    def get_cache_key(self, request: Request, view: "APIView") -> str | None:
        """None: not this throttle's concern."""
        return super().get_cache_key(request, view) if request.method == "POST" else None


class RevokeThrottle(Throttle):
    """Reports of leaked tokens from one address."""

    scope = "revoke"

    def get_cache_key(self, request: Request, view: "APIView") -> str:
        """Everybody, also who is signed in."""
        return self.named(self.address(request))
