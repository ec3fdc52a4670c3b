"""Small drawings next to numbers: values with their intervals on one scale, and values over time.

Drawings are sized in percent, so the same bytes fit every screen; the cell has the numbers as text.
"""

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from django.utils.html import format_html, format_html_join
from django.utils.safestring import SafeString

# Off the scale are outliers: values so many times larger than the last of most, this share of all values.
_MOST: Final = 0.8
_ROOM: Final = 5.0
# A scale that spans more than this factor is logarithmic, so that the leading rows do not share one pixel.
_LOG_FROM: Final = 2.5
# Room for the marks and labels at both ends, which would else touch the next column.
_MARGIN: Final = 15.0
# Two labels of an axis stand at least so far apart.
_LABEL_GAP: Final = 21.0
_STEPS: Final = (1.0, 2.0, 5.0), (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0)

_TICK: Final = '<line class="tick" x1="{0}%" x2="{0}%" y1="32%" y2="68%"/>'

Ends = tuple[float, float]


@dataclass(frozen=True)
class WhiskerScale:
    """From values to percent of a cell's width. `best` is the interval of the column's best value."""

    low: float
    high: float
    best: Ends | None = None
    margin: float = field(default=_MARGIN, repr=False)

    @property
    def is_log(self) -> bool:
        return self.low > 0 and self.high > _LOG_FROM * self.low

    def percent(self, value: float) -> float:
        """Return the position of a value; one beyond an end is drawn at that end.

        >>> WhiskerScale(10.0, 20.0).percent(15.0), WhiskerScale(1.0, 100.0).percent(10.0)
        (50.0, 50.0)
        """
        clamped = min(self.high, max(self.low, value))
        if self.is_log:
            share = math.log(clamped / self.low) / math.log(self.high / self.low)
        else:
            share = (clamped - self.low) / (self.high - self.low)
        return round(self.margin + (100.0 - 2 * self.margin) * share, 1)

    def labels(self) -> tuple[float, ...]:
        """Return the round numbers of the scale that have room for their text.

        >>> WhiskerScale(9.1, 84.0).labels(), WhiskerScale(11.2, 15.1).labels()
        ((10.0, 20.0, 50.0), (12.0, 14.0))
        """
        labels: list[float] = []
        for value in self._round_numbers():
            at = self.percent(value)
            is_apart = not labels or at - self.percent(labels[-1]) >= _LABEL_GAP
            if is_apart and 6.0 <= at <= 94.0:
                labels.append(value)
        return tuple(labels)

    def _round_numbers(self) -> Sequence[float]:
        if not self.is_log:
            power = 10.0 ** math.floor(math.log10((self.high - self.low) / 2))
            step = next(s * power for s in (1.0, 2.0, 5.0, 10.0) if (self.high - self.low) / (s * power) <= 4)
            first = math.ceil(self.low / step)
            return [round(i * step, 10) for i in range(first, math.floor(self.high / step) + 1)]
        powers = range(math.floor(math.log10(self.low)), math.ceil(math.log10(self.high)) + 1)
        coarse, fine = (
            [value for power in powers for step in steps if self._holds(value := step * 10.0**power)]
            for steps in _STEPS
        )
        return coarse if len(coarse) > 1 else fine

    def _holds(self, value: float) -> bool:
        return self.low <= value <= self.high


def scale_of(values: Iterable[float], intervals: Iterable[Ends], *, best: Ends | None) -> WhiskerScale | None:
    """Make a scale that shows these values but outliers; None for fewer than two.

    >>> scale_of([10.0, 11.0, 12.0, 13.0, 900.0], [(9.5, 10.5)], best=(9.5, 10.5))
    WhiskerScale(low=9.5, high=13.0, best=(9.5, 10.5))
    >>> scale_of([2.0, 3.0, 5.0, 20.0, 56.0], [], best=None)
    WhiskerScale(low=2.0, high=56.0, best=None)
    """
    ordered, ends = sorted(values), list(intervals)
    if len(ordered) < 2:
        return None
    limit = _ROOM * ordered[math.ceil(_MOST * len(ordered)) - 1]
    low = min([ordered[0], *(low for low, _ in ends)])
    high = max(value for value in [*ordered, *(high for _, high in ends)] if value <= limit)
    return WhiskerScale(low, max(high, low + 1e-9), best)


def whisker(scale: WhiskerScale, value: float, ends: Ends | None) -> SafeString:
    """Draw a tick on its interval, a ring without one, an arrow off the scale."""
    parts = [_band(scale)]
    if ends is not None and ends[0] <= scale.high:
        left, right = map(scale.percent, ends)
        parts.append(_line("span", left, right))
    if value > scale.high:
        parts.append(format_html('<text class="beyond" x="97%" y="50%">{}</text>', "→"))
    else:
        at = f"{scale.percent(value):g}"
        # Narrower than a dot would be, so that a short interval is seen on both sides of it.
        mark = '<circle class="ring" cx="{0}%" cy="50%" r="3.4"/>' if ends is None else _TICK
        parts.append(format_html(mark, at))
    return _svg("whisker", parts)


def axis(scale: WhiskerScale, labels: Mapping[float, float] | None = None) -> SafeString:
    """Draw the scale for the head of a column; `labels` by value, else round numbers."""
    named = labels or {value: value for value in scale.labels()}
    ticks = [(f"{scale.percent(value):g}", f"{label:g}") for value, label in named.items()]
    marks = format_html_join("", '<line x1="{0}%" x2="{0}%" y1="13" y2="17"/>', ((at,) for at, _ in ticks))
    texts = format_html_join("", '<text x="{}%" y="10" text-anchor="middle">{}</text>', ticks)
    return _svg("axis", [marks, texts])


def strip(values: Iterable[float], *, own: float) -> SafeString:
    """Draw a tick for each value on one scale with its axis, and a larger one for the own value."""
    known = sorted({*values, own})
    scale = WhiskerScale(known[0], max(known[-1], known[0] + 1e-9))
    ticks = dict.fromkeys(f"{scale.percent(value):g}" for value in known)
    others = format_html_join("", '<line x1="{0}%" x2="{0}%" y1="8" y2="20"/>', ((at,) for at in ticks))
    mine = format_html('<line class="own" x1="{0}%" x2="{0}%" y1="0" y2="26"/>', f"{scale.percent(own):g}")
    return format_html("{}{}", _svg("strip", [others, mine]), axis(scale))


def sparkline(values: Sequence[float]) -> SafeString:
    """Draw values in their order as a line, the lowest marked."""
    low = min(values)
    heights = WhiskerScale(low, max(low + 1e-9, *values))
    spread = WhiskerScale(0.0, max(1.0, len(values) - 1.0), margin=2.0)
    points = [(f"{spread.percent(i):g}", f"{100 - heights.percent(v):g}") for i, v in enumerate(values)]
    lines = format_html_join(
        "",
        '<line x1="{}%" y1="{}%" x2="{}%" y2="{}%"/>',
        ((*one, *following) for one, following in itertools.pairwise(points)),
    )
    best = format_html('<circle cx="{}%" cy="{}%" r="3.4"/>', *points[values.index(low)])
    return _svg("sparkline", [lines, best])


def _band(scale: WhiskerScale) -> SafeString:
    if scale.best is None:
        return SafeString("")
    left, right = map(scale.percent, scale.best)
    return format_html(
        '<rect class="band" x="{}%" width="{}%" height="100%"/>', f"{left:g}", f"{right - left:g}"
    )


def _line(css: str, left: float, right: float) -> SafeString:
    return format_html(
        '<line class="{}" x1="{}%" x2="{}%" y1="50%" y2="50%"/>', css, f"{left:g}", f"{right:g}"
    )


def _svg(css: str, parts: Iterable[SafeString]) -> SafeString:
    drawn = format_html_join("", "{}", ((part,) for part in parts))
    return format_html('<svg class="{}" aria-hidden="true">{}</svg>', css, drawn)
