"""Rate limits: throttles of Django REST framework, for the API, for pages and for comparisons.

A rate of 60 a minute lets 60 requests of the last minute through. Reading is counted by each process in its
memory, which asks the database nothing; what is sent is counted in Django's cache, by all processes together.
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
    """The address of a request. IPv6 addresses count as one if their first 64 bits are equal.

    It is that of the connection, or with `TSTTC_TRUSTED_PROXIES` the one in our own proxy's header.
    """
    try:
        address = ip_address(BaseThrottle().get_ident(request))
    except ValueError:
        return "unknown"
    return str(ip_network((address, 64), strict=False) if isinstance(address, IPv6Address) else address)


def account_or_address(request: Any) -> str:
    """The account that asks, wherever it comes from; else the address."""
    return f"account:{request.user.pk}" if request.user.is_authenticated else address_of(request)


def refusal(wait_s: float) -> str:
    """The sentence for a client that asked too often, on pages and in the API."""
    return f"Too many requests in a short time; the next one is answered in {math.ceil(wait_s)} s."


class Throttle(SimpleRateThrottle):
    """A rate of the settings, which may be None; `n_left` and `wait_s` are known once it has counted."""

    cache: BaseCache = IN_PROCESS
    rates = "API_RATES"
    key: str | None = None
    history: list[float]
    num_requests: int
    duration: int  # in seconds

    def get_rate(self) -> str | None:
        """The rate as the settings have it now."""
        rate: str | None = getattr(settings, self.rates)[self.scope]
        return rate

    def allow_request(self, request: Any, view: "APIView | None" = None) -> bool:
        """Count this request."""
        return bool(super().allow_request(request, view))  # type: ignore[arg-type]  # pages have no view

    def identity(self, request: Any) -> object | None:
        """Who is counted: the address. None: this throttle does not apply."""
        return address_of(request)

    def get_cache_key(self, request: Any, view: "APIView | None") -> str | None:
        """A hash, so that no address or account is in the cache."""
        who = self.identity(request)
        text = f"{self.rates}:{self.scope}:{who}"
        return None if who is None else f"rate:{hashlib.sha256(text.encode()).hexdigest()}"

    @property
    def n_left(self) -> int:
        """How many more are let through now."""
        return max(0, self.num_requests - len(self.history))

    @property
    def wait_s(self) -> float:
        """Seconds until the next is let through."""
        return 0.0 if self.n_left else self.wait() or 0.0


def purge_expired(*, now: datetime) -> int:
    """Remove what has expired in the table of Django's cache. Returns how many rows."""
    n_values, _ = CachedValue.objects.filter(expires__lt=now).delete()
    return n_values
