"""Protocols: frozen, named rule sets that turn predictions into numbers, and the names of these numbers."""

# A changed rule gets a new protocol name. Code that shows an edition reads metrics and TTC ranges from here.

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Final

from evaluator.metrics.registry import MID, RTE, Metric

OVERALL: Final = "overall"
"""The name of the mean over all sequences, which is in no range."""

PRIMARY: Final = "mid"
"""The score that boards rank by: every protocol has it first."""

_NAME: Final = re.compile(r"[a-z][a-z0-9]*")


@dataclass(frozen=True, slots=True)
class TTCRange:
    """A TTC range: true times to contact in seconds, closed at both ends."""

    name: str
    low_s: float
    high_s: float

    @property
    def letter(self) -> str:
        """The subscript of its columns."""
        return self.name[0]

    @property
    def ends(self) -> str:
        """Both ends, without their unit.

        >>> [ttc_range.ends for ttc_range in TTC_RANGES]
        ['0–3', '3–6', '6–20', '−20–0']
        """
        return f"{self.low_s:g}–{self.high_s:g}".replace("-", "−")

    @property
    def seconds(self) -> str:
        """Both ends with their unit, such as "0–3 s"."""
        return f"{self.ends} s"


TTC_RANGES: Final = (
    TTCRange("crucial", 0.0, 3.0),
    TTCRange("small", 3.0, 6.0),
    TTCRange("large", 6.0, 20.0),
    TTCRange("negative", -20.0, 0.0),
)
"""The paper's TTC ranges, in its order."""


def score_name(metric: str, ttc_range: str) -> str:
    """Return the name of a score; an overall score has the name of its metric.

    >>> score_name("mid", "overall"), score_name("mid", "crucial")
    ('mid', 'mid_crucial')
    """
    return metric if ttc_range == OVERALL else f"{metric}_{ttc_range}"


def split_name(name: str) -> tuple[str, str]:
    """Split a score's name into metric and TTC range, the inverse of `score_name`.

    >>> split_name("mid"), split_name("mid_crucial")
    (('mid', 'overall'), ('mid', 'crucial'))
    """
    metric, _, ttc_range = name.partition("_")
    return metric, ttc_range or OVERALL


@dataclass(frozen=True)
class Protocol:
    """The rules by which predicted times to contact (seconds) become scores.

    Predictions are truncated to [−limit_s, limit_s]. With `near_zero_s = (low, high)`, those in (low, 0)
    become `low` and those in (0, high) become `high`; with None, those without a defined MiD are rejected.
    NaN and 0 are always rejected. Each of `metrics` has a score overall and in each of `ranges`; the first
    metric is MiD.
    """

    # A metric or range has the same meaning in every protocol that names it.

    name: str
    limit_s: float
    near_zero_s: tuple[float, float] | None
    ranges: tuple[TTCRange, ...] = TTC_RANGES
    metrics: tuple[Metric, ...] = (MID, RTE)

    def __post_init__(self) -> None:
        names = [*self.overall_names, *(ttc_range.name for ttc_range in self.ranges)]
        if not all(map(_NAME.fullmatch, names)) or len({*names, OVERALL}) <= len(names):
            raise ValueError(f"Names of metrics and TTC ranges are words, each once; found {names}.")
        if names[0] != PRIMARY:
            raise ValueError(f"The first metric is {names[0]!r}; expected {PRIMARY!r}, which boards rank by.")

    @property
    def boundaries(self) -> dict[str, float]:
        """The values that truncation can produce, ascending, by name in reports."""
        values = (-self.limit_s, *(self.near_zero_s or ()), self.limit_s)
        return {f"{value:g}": value for value in values}

    @cached_property
    def range_names(self) -> tuple[str, ...]:
        """`overall`, then the TTC ranges in order."""
        return (OVERALL, *(ttc_range.name for ttc_range in self.ranges))

    @cached_property
    def score_names(self) -> tuple[str, ...]:
        """The names of scores in column order: `mid`, `mid_crucial`, …, `rte_negative`."""
        return tuple(score_name(m.name, ttc_range) for m in self.metrics for ttc_range in self.range_names)

    def names_of(self, metric: str) -> tuple[str, ...]:
        """Return the scores of one metric, all scores for an unknown metric."""
        return tuple(name for name in self.score_names if split_name(name)[0] == metric) or self.score_names

    @property
    def overall_names(self) -> tuple[str, ...]:
        """The scores over all sequences, one for each metric."""
        return tuple(metric.name for metric in self.metrics)

    @property
    def decimals(self) -> int:
        """The default number of decimals."""
        return max(metric.decimals for metric in self.metrics)


PROTOCOLS: Final[dict[str, Protocol]] = {
    protocol.name: protocol
    for protocol in (
        Protocol(name="tsttc-1", limit_s=20.0, near_zero_s=(-0.15, 0.05)),
        Protocol(name="toolkit", limit_s=20.0, near_zero_s=None),
    )
}

DEFAULT_PROTOCOL: Final = "tsttc-1"

SCORE_NAMES: Final = PROTOCOLS[DEFAULT_PROTOCOL].score_names
"""The ten numbers of the default protocol; of an edition, ask its own."""


def get_protocol(name: str) -> Protocol:
    """Return the protocol with this name; raises `ValueError` that lists the names.

    >>> get_protocol("tsttc-1").boundaries
    {'-20': -20.0, '-0.15': -0.15, '0.05': 0.05, '20': 20.0}
    """
    try:
        return PROTOCOLS[name]
    except KeyError:
        raise ValueError(f"Unknown protocol {name!r}; expected one of {', '.join(PROTOCOLS)}.") from None


# --- what names mean --------------------------------------------------------------------------------------


def metric_of(name: str) -> Metric:
    """Return the metric of a score; an unknown one has its name as symbol and no unit."""
    wanted, _ = split_name(name)
    return known_metrics().get(wanted) or Metric(wanted, wanted, "", wanted, 2, MID.function)


def column_words(name: str) -> str:
    """Name a score in a sentence.

    >>> column_words("mid"), column_words("rte_crucial")
    ('MiD', 'RTE on crucial')
    """
    symbol, ttc_range = metric_of(name).symbol, split_name(name)[1]
    return symbol if ttc_range == OVERALL else f"{symbol} on {ttc_range}"


def range_of(name: str) -> TTCRange | None:
    """Return the TTC range of a score, None for an overall or unknown one."""
    return known_ranges().get(split_name(name)[1])


def known_ranges() -> dict[str, TTCRange]:
    return {ttc_range.name: ttc_range for protocol in PROTOCOLS.values() for ttc_range in protocol.ranges}


def known_metrics() -> dict[str, Metric]:
    return {metric.name: metric for protocol in PROTOCOLS.values() for metric in protocol.metrics}


def known_names() -> tuple[str, ...]:
    """Return the names of scores of all protocols, each protocol's order kept."""
    there = {name for protocol in PROTOCOLS.values() for name in protocol.score_names}
    ranges = (OVERALL, *known_ranges())
    named = (score_name(metric, ttc_range) for metric in known_metrics() for ttc_range in ranges)
    return tuple(name for name in named if name in there)


def grouped_names(names: Iterable[str]) -> dict[Metric, list[str]]:
    """Group the names of scores by metric, in the given order."""
    groups: dict[Metric, list[str]] = {}
    for name in names:
        groups.setdefault(metric_of(name), []).append(name)
    return groups
