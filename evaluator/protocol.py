"""Protocols: the frozen, named rule sets by which predictions become numbers.

A change of any rule is a new protocol name; an existing one never changes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class Interval:
    """A range of the true time to contact in seconds, closed at both ends as in the dataset's toolkit."""

    name: str
    low_s: float
    high_s: float


INTERVALS: Final = (
    Interval("crucial", 0.0, 3.0),
    Interval("small", 3.0, 6.0),
    Interval("large", 6.0, 20.0),
    Interval("negative", -20.0, 0.0),
)

INTERVAL_NAMES: Final = ("overall", *(interval.name for interval in INTERVALS))
"""`overall`, the mean over all sequences, then the intervals in the paper's order."""

METRICS: Final = ("mid", "rte")

SCORE_NAMES: Final = tuple(
    metric if name == "overall" else f"{metric}_{name}" for metric in METRICS for name in INTERVAL_NAMES
)
"""The ten numbers of a result in the paper's column order: `mid`, `mid_crucial`, …, `rte_negative`."""


@dataclass(frozen=True, slots=True)
class Protocol:
    """How a predicted time to contact is prepared before its errors are taken.

    Predictions outside [−limit_s, limit_s] are truncated to its ends. With `near_zero_s = (low, high)`,
    predictions in (low, 0) become `low` and those in (0, high) become `high`; with None they stay, and those
    for which the errors are undefined are rejected. NaN and 0 are always rejected.
    """

    name: str
    limit_s: float
    near_zero_s: tuple[float, float] | None
    intervals: tuple[Interval, ...] = INTERVALS
    decimals: int = 2

    @property
    def boundaries(self) -> dict[str, float]:
        """The values that truncation can produce, ascending, under the names that reports use."""
        values = (-self.limit_s, *(self.near_zero_s or ()), self.limit_s)
        return {f"{value:g}": value for value in values}


PROTOCOLS: Final[dict[str, Protocol]] = {
    protocol.name: protocol
    for protocol in (
        Protocol(name="tsttc-1", limit_s=20.0, near_zero_s=(-0.15, 0.05)),
        Protocol(name="toolkit", limit_s=20.0, near_zero_s=None),
    )
}

DEFAULT_PROTOCOL: Final = "tsttc-1"


def get_protocol(name: str) -> Protocol:
    """The protocol called `name`; raises `ValueError` naming those that exist.

    >>> get_protocol("tsttc-1").boundaries
    {'-20': -20.0, '-0.15': -0.15, '0.05': 0.05, '20': 20.0}
    """
    try:
        return PROTOCOLS[name]
    except KeyError:
        raise ValueError(f"Unknown protocol {name!r}; expected one of {', '.join(PROTOCOLS)}.") from None
