"""Differences with their intervals as small SVG drawings on one symmetric scale, next to the numbers."""

import math
from collections.abc import Iterable
from typing import Final

from django.utils.html import format_html
from django.utils.safestring import SafeString

_WIDTH_PX: Final = 150.0
_MARGIN_PX: Final = 4.0
_STEPS: Final = (1.0, 2.0, 2.5, 5.0, 10.0, 20.0, 25.0, 50.0)


def round_ticks(low: float, high: float, *, n: int) -> tuple[float, ...]:
    """Return at most `n` steps in round numbers, from below `low` to above `high`.

    >>> round_ticks(9.3, 31.0, n=4), round_ticks(0.6, 0.6, n=3)
    ((0.0, 10.0, 20.0, 30.0, 40.0), (0.6, 0.7))
    """
    span = (high - low) or abs(high) or 1.0
    power = 10.0 ** math.floor(math.log10(span / n))
    steps = (factor * power for factor in _STEPS)
    step = next(s for s in steps if math.ceil(high / s - 1e-9) - math.floor(low / s + 1e-9) <= n)
    first = math.floor(low / step + 1e-9)
    last = max(math.ceil(high / step - 1e-9), 1 + first)
    return tuple(round(i * step, 10) + 0.0 for i in range(first, last + 1))


def scale_end(values: Iterable[float]) -> float:
    """Return the round number at the right end of a scale.

    >>> scale_end([-3.2, 1.0])
    4.0
    """
    far = max((abs(value) for value in values), default=0.0) or 1.0
    return round_ticks(0.0, far, n=4)[-1]


def _x(value: float, end: float) -> str:
    share = (value + end) / (2 * end)
    return f"{round(_MARGIN_PX + (_WIDTH_PX - 2 * _MARGIN_PX) * share, 1):g}"


def difference(end: float, value: float, low: float | None, high: float | None) -> SafeString:
    """Draw a dot with its interval as a line, or a ring without one, and the line at 0."""
    line, css = SafeString(""), "ring"
    if low is not None and high is not None:
        left, right = _x(low, end), _x(high, end)
        line, css = format_html('<path d="M{0} 7H{1}M{0} 4v6M{1} 4v6"/>', left, right), "dot"
    return format_html(
        '<svg class="whisker" viewBox="0 0 {} 14" aria-hidden="true">'
        '<path class="zero" d="M{} 0v14"/>{}<circle class="{}" cx="{}" cy="7" r="2.6"/></svg>',
        f"{_WIDTH_PX:g}",
        _x(0.0, end),
        line,
        css,
        _x(value, end),
    )


def axis(end: float) -> SafeString:
    """Draw the scale for the head of a column."""
    return format_html(
        '<svg class="axis" viewBox="0 0 {width} 14" aria-hidden="true">'
        '<path d="M{left} 14H{right}M{left} 11v3M{middle} 11v3M{right} 11v3"/>'
        '<text x="0" y="9">{low}</text><text x="{width}" y="9" text-anchor="end">{high}</text></svg>',
        width=f"{_WIDTH_PX:g}",
        left=_x(-end, end),
        middle=_x(0.0, end),
        right=_x(end, end),
        low=tick_text(-end),
        high=tick_text(end),
    )


def tick_text(value: float) -> str:
    """Format a number with a true minus.

    >>> tick_text(-2.5), tick_text(20.0)
    ('−2.5', '20')
    """
    return f"{value:g}".replace("-", "−")
