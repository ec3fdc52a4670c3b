"""Rate limits of the API, of pages and of comparisons.

Reads are counted in each process's memory, writes in Django's cache for all processes together.
"""

import hashlib
import math
from datetime import datetime
from ipaddress import IPv6Address, ip_address, ip_network
from typing import TYPE_CHECKING, Any, Final

from django.conf import settings
from django.core.cache.backends.base import BaseCache
from django.core.cache.backends.locmem import LocMemCache
from rest_framework.throttling import BaseThrottle, SimpleRateThrottle

from leaderboard.models import CachedValue

if TYPE_CHECKING:  # views make their classes with these
    from rest_framework.views import APIView

# From more addresses at once it is an attack, which no counting of addresses ends.
IN_PROCESS: Final = LocMemCache("rate_limits", {"OPTIONS": {"MAX_ENTRIES": 10_000}})


def address_of(request: Any) -> str:
    """Return the address of a request, or with `TSTTC_TRUSTED_PROXIES` that in our proxy's header.

    IPv6 addresses count as one if their first 64 bits are equal.
    """
    try:
        address = ip_address(BaseThrottle().get_ident(request))
    except ValueError:
        return "unknown"
    return str(ip_network((address, 64), strict=False) if isinstance(address, IPv6Address) else address)


def account_or_address(request: Any) -> str:
    """Return the account, or the address of a visitor."""
    return f"account:{request.user.pk}" if request.user.is_authenticated else address_of(request)


def refusal(wait_s: float) -> str:
    """Return the message for a client that asked too often."""
    return f"Too many requests in a short time; try again in {math.ceil(wait_s)} s."


class Throttle(SimpleRateThrottle):
    """A rate of the settings, which may be None; `n_left` and `wait_s` are known after a request."""

    cache: BaseCache = IN_PROCESS
    rates = "API_RATES"
    key: str | None = None
    history: list[float]
    num_requests: int
    duration: int  # in seconds

    def get_rate(self) -> str | None:
        rate: str | None = getattr(settings, self.rates)[self.scope]
        return rate

    def allow_request(self, request: Any, view: "APIView | None" = None) -> bool:
        return bool(super().allow_request(request, view))  # type: ignore[arg-type]  # pages have no view

    def identity(self, request: Any) -> object | None:
        """Return what is counted; None where this throttle does not apply."""
        return address_of(request)

    def get_cache_key(self, request: Any, view: "APIView | None") -> str | None:
        # A hash, so that no address or account is in the cache.
        who = self.identity(request)
        text = f"{self.rates}:{self.scope}:{who}"
        return None if who is None else f"rate:{hashlib.sha256(text.encode()).hexdigest()}"

    @property
    def n_left(self) -> int:
        return max(0, self.num_requests - len(self.history))

    @property
    def wait_s(self) -> float:
        return 0.0 if self.n_left else self.wait() or 0.0


def purge_expired(*, now: datetime) -> int:
    """Delete expired rows of Django's cache. Returns how many."""
    n_values, _ = CachedValue.objects.filter(expires__lt=now).delete()
    return n_values
