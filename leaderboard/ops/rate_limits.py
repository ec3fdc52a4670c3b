"""Rate limits: counted for all web processes together, in one statement of the database.

A rate of `n` in a period lets `n` requests through at once, and after that one for each `period / n` seconds
(the generic cell rate algorithm). What is kept is a single time, at which the one who asked is as good as
new; moving it on and refusing are one conditional INSERT, so that no two processes take the last place.
"""

import hashlib
import math
import re
import threading
from dataclasses import dataclass
from datetime import UTC, datetime
from ipaddress import IPv6Address, ip_address, ip_network
from typing import Any, Final

from django.db import connection
from rest_framework.throttling import BaseThrottle

from leaderboard.models import Allowance, CachedValue

_MOVE_ON = """
INSERT INTO leaderboard_allowance (key, free_at_s) VALUES (%(key)s, %(now)s + %(step)s)
ON CONFLICT (key) DO UPDATE SET free_at_s = %(step)s + CASE
    WHEN leaderboard_allowance.free_at_s > %(now)s THEN leaderboard_allowance.free_at_s ELSE %(now)s END
WHERE leaderboard_allowance.free_at_s <= %(now)s + %(period)s - %(step)s
RETURNING free_at_s
"""
# Rounding of a float of today's seconds, which must not cost anybody a request.
_TOLERANCE_S = 1e-5
_MOST_IN_MEMORY = 10_000
_PERIODS_S: Final = {"s": 1, "m": 60, "h": 3600, "d": 86400}
_RATE: Final = re.compile(r"(?P<n>\d+)/(?P<period>[smhd])[a-z]*")


@dataclass(frozen=True)
class Rate:
    """`n` requests in `period_s` seconds."""

    n: int
    period_s: float

    @property
    def step_s(self) -> float:
        """What one request costs, in seconds."""
        return self.period_s / self.n


def rate_of(text: str) -> Rate:
    """A rate as the settings have it.

    >>> rate_of("600/min")
    Rate(n=600, period_s=60)
    """
    found = _RATE.fullmatch(text)
    if found is None:
        raise ValueError(f"{text!r} is not a rate; expected one such as '600/min'")
    return Rate(n=int(found["n"]), period_s=_PERIODS_S[found["period"]])


def address_of(request: Any) -> str:
    """Where a request comes from. Who has an IPv6 address has 2⁶⁴ of them: they count as one.

    It is that of the connection, or with `TSTTC_TRUSTED_PROXIES` the one that our own proxy wrote down.
    """
    try:
        found = ip_address(BaseThrottle().get_ident(request))
    except ValueError:
        return "unknown"
    return str(ip_network((found, 64), strict=False) if isinstance(found, IPv6Address) else found)


def refusal(wait_s: float) -> str:
    """What is said to who asked too often, on pages and in the API."""
    return f"Too many requests in a short time; the next one is answered in {math.ceil(wait_s)} s."


@dataclass(frozen=True)
class Decision:
    """Whether a request is let through, how many more would be at once, and when the next one is if none."""

    is_allowed: bool
    n_left: int
    wait_s: float


def _answer(rate: Rate, *, free_at_s: float, now_s: float, is_allowed: bool) -> Decision:
    ahead_s = max(0.0, free_at_s - now_s)
    n_left = int((rate.period_s - ahead_s + _TOLERANCE_S) / rate.step_s)
    wait_s = max(0.0, ahead_s + rate.step_s - rate.period_s)
    return Decision(is_allowed=is_allowed, n_left=max(0, n_left), wait_s=wait_s)


def take(*, who: str, rate: Rate, now_s: float) -> Decision:
    """Count one request of `who`, a name with the rate's in it, for every process on this database."""
    key = hashlib.sha256(who.encode()).hexdigest()
    values: dict[str, str | float] = {
        "key": key,
        "now": now_s,
        "step": rate.step_s,
        "period": rate.period_s + _TOLERANCE_S,
    }
    with connection.cursor() as cursor:
        cursor.execute(_MOVE_ON, values)
        rows = cursor.fetchall()
    if rows:
        return _answer(rate, free_at_s=rows[0][0], now_s=now_s, is_allowed=True)
    free_at_s = Allowance.objects.filter(pk=key).values_list("free_at_s", flat=True).first() or now_s
    return _answer(rate, free_at_s=free_at_s, now_s=now_s, is_allowed=False)


def purge_expired(*, now_s: float) -> int:
    """Remove what counts for nothing any more, of allowances and of the cache. Returns how many rows."""
    n_allowances, _ = Allowance.objects.filter(free_at_s__lt=now_s).delete()
    n_values, _ = CachedValue.objects.filter(expires__lt=datetime.fromtimestamp(now_s, tz=UTC)).delete()
    return n_allowances + n_values


class InMemory:
    """The same for this process alone: for requests that are not worth asking the database for."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._free_at_s: dict[str, float] = {}

    def take(self, *, who: str, rate: Rate, now_s: float) -> Decision:
        """Count one request."""
        with self._lock:
            free_at_s = max(self._free_at_s.get(who, now_s), now_s)
            is_allowed = free_at_s <= now_s + rate.period_s - rate.step_s + _TOLERANCE_S
            if is_allowed:
                free_at_s += rate.step_s
                self._free_at_s[who] = free_at_s
            if len(self._free_at_s) > _MOST_IN_MEMORY:
                # From that many addresses at once it is an attack, which no counting of addresses ends.
                self._free_at_s.clear()
        return _answer(rate, free_at_s=free_at_s, now_s=now_s, is_allowed=is_allowed)

    def forget(self) -> None:
        """Begin anew."""
        with self._lock:
            self._free_at_s.clear()
