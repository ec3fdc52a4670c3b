"""Protocols: frozen, named rule sets that turn predictions into numbers, and the names of these numbers."""

# A changed rule gets a new protocol name. Code that shows an edition reads metrics and TTC ranges from here.

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Final, Literal

from evaluator.metrics.registry import MID, RTE, WARNING, Metric

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from evaluator.metrics.scale import Floats

OVERALL: Final = "overall"
"""The name of the mean over all sequences, which is in no range."""

_NAME: Final = re.compile(r"[a-z][a-z0-9]*")


@dataclass(frozen=True, slots=True)
class TTCRange:
    """A TTC range: true times to contact in seconds; an end belongs to it unless it is open."""

    name: str
    low_s: float
    high_s: float
    is_low_open: bool = False
    is_high_open: bool = False

    def contains(self, ttc_s: Floats) -> NDArray[np.bool_]:
        """Whether each of these times lies in it: bool of the same shape."""
        above = ttc_s > self.low_s if self.is_low_open else ttc_s >= self.low_s
        return above & (ttc_s < self.high_s if self.is_high_open else ttc_s <= self.high_s)

    @property
    def letter(self) -> str:
        """The subscript of its columns."""
        return self.name[0]

    @property
    def ends(self) -> str:
        """Both ends, without their unit; brackets where one is open.

        >>> [ttc_range.ends for ttc_range in (*TTC_RANGES, TTCRange("near", 0, 3, is_high_open=True))]
        ['0–3', '3–6', '6–20', '−20–0', '[0, 3)']
        """
        low, high = (f"{end:g}".replace("-", "−") for end in (self.low_s, self.high_s))
        if not (self.is_low_open or self.is_high_open):
            return f"{low}–{high}"
        return f"{'[('[self.is_low_open]}{low}, {high}{'])'[self.is_high_open]}"

    @property
    def closed_ends(self) -> tuple[float, ...]:
        """The ends that belong to it, in seconds."""
        ends = ((self.low_s, self.is_low_open), (self.high_s, self.is_high_open))
        return tuple(end for end, is_open in ends if not is_open)

    @property
    def condition(self) -> str:
        """What holds of the true time to contact τ of its sequences.

        >>> TTC_RANGES[0].condition
        '0 s ≤ τ ≤ 3 s'
        """
        low, high = "≤<"[self.is_low_open], "≤<"[self.is_high_open]
        return f"{self.low_s:g} s {low} τ {high} {self.high_s:g} s".replace("-", "−")

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
    NaN and 0 are always rejected. Each of `metrics` has a score overall and in each of `ranges`; boards rank
    by the overall score of the first metric.
    """

    # A metric or range has the same meaning in every protocol that names it.

    name: str
    limit_s: float
    near_zero_s: tuple[float, float] | None
    ranges: tuple[TTCRange, ...] = TTC_RANGES
    metrics: tuple[Metric, ...] = (MID, RTE)

    def __post_init__(self) -> None:
        fault = next(_contradictions(self), None)
        if fault is not None:
            raise ValueError(f"Protocol {self.name!r}: {fault}.")

    @property
    def primary(self) -> Metric:
        """The metric that decides the ranks: the first one."""
        return self.metrics[0]

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


def _contradictions(protocol: Protocol) -> Iterator[str]:
    """What is wrong with a protocol, each with the two places that contradict each other."""
    if not protocol.metrics:
        yield "it has no metric; expected at least one, the first of which ranks"
    if not 0 < protocol.limit_s < math.inf:
        yield f"its limit is {protocol.limit_s:g} s; expected one above 0 s"
    low_s, high_s = protocol.near_zero_s or (-math.inf, math.inf)
    if protocol.near_zero_s and not -protocol.limit_s < low_s < 0 < high_s < protocol.limit_s:
        yield (
            f"near 0 it truncates to {low_s:g} s and {high_s:g} s, and its limit is {protocol.limit_s:g} s; "
            "expected the one between minus the limit and 0 s, the other between 0 s and the limit"
        )
    for ttc_range in protocol.ranges:
        if not ttc_range.low_s < ttc_range.high_s:
            yield f"the TTC range {ttc_range.name!r} is {ttc_range.seconds}; expected a later end"
    yield from _faulty_names(protocol)


def _faulty_names(protocol: Protocol) -> Iterator[str]:
    """Names that scores cannot have, and what has the name, symbol or letter of something else."""
    metrics = [(f"metric {each.symbol}", each.name) for each in protocol.metrics]
    ranges = [(f"TTC range {each.seconds}", each.name) for each in protocol.ranges]
    for what, name in metrics + ranges:
        if not _NAME.fullmatch(name) or name == OVERALL:
            yield f"the {what} is called {name!r}; expected lower-case letters and digits, not {OVERALL!r}"
    symbols = [(f"metric {each.name}", each.symbol) for each in protocol.metrics]
    letters = [(f"TTC range {each.name} ({each.seconds})", each.name[:1]) for each in protocol.ranges]
    names = [("are called", metrics + ranges), ("are called", symbols), ("begin with the letter", letters)]
    for kind, named in names:
        for (one, name), (other, same) in itertools.combinations(named, 2):
            if name == same:
                yield f"the {one} and the {other} both {kind} {name!r}; expected different ones"


def registered(*protocols: Protocol) -> dict[str, Protocol]:
    """These protocols by their names; raises `ValueError` where one name has two meanings."""
    by_name: dict[str, Protocol] = {}
    meanings: dict[str, tuple[TTCRange | Metric, str, str]] = {}
    for protocol in protocols:
        if protocol.name in by_name:
            raise ValueError(f"Two protocols are called {protocol.name!r}; expected different names.")
        by_name[protocol.name] = protocol
        parts: list[tuple[TTCRange | Metric, str]] = [
            *((each, f"the TTC range {each.seconds}") for each in protocol.ranges),
            *((each, f"the metric {each.title} ({each.symbol})") for each in protocol.metrics),
        ]
        for part, words in parts:
            first, first_words, owner = meanings.setdefault(part.name, (part, words, protocol.name))
            if first != part:
                raise ValueError(
                    f"{part.name!r} is {first_words} in protocol {owner!r} and {words} in protocol "
                    f"{protocol.name!r}; expected one meaning of a name in all protocols."
                )
    return by_name


PROTOCOLS: Final[dict[str, Protocol]] = registered(
    Protocol(name="tsttc-1", limit_s=20.0, near_zero_s=(-0.15, 0.05)),
    Protocol(name="tsttc-2", limit_s=20.0, near_zero_s=(-0.15, 0.05), metrics=(MID, RTE, WARNING)),
    Protocol(name="toolkit", limit_s=20.0, near_zero_s=None),
)
"""Every protocol by its name."""

ProtocolName = Literal["tsttc-1", "tsttc-2", "toolkit"]
"""For a type checker and an editor; `get_protocol` takes every name of `PROTOCOLS`."""

DEFAULT_PROTOCOL: Final = "tsttc-1"

SCORE_NAMES: Final = PROTOCOLS[DEFAULT_PROTOCOL].score_names
"""The scores of the default protocol; an edition may have another protocol."""


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


def primary_of(scores: Iterable[str]) -> str:
    """The score that ranks, of all names of an edition's scores in its protocol's order; "" of none.

    >>> primary_of(["rte", "rte_crucial", "mid"])
    'rte'
    """
    return next(iter(scores), "")


def primary_value(scores: Mapping[str, float | None] | None) -> float | None:
    """The value that ranks; None without scores."""
    return next(iter(scores.values()), None) if scores else None


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
