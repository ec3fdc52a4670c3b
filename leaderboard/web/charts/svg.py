"""Differences with their intervals as small SVG drawings on one scale, next to the numbers."""

import math
from collections.abc import Iterable
from typing import Final

from django.utils.html import format_html, format_html_join
from django.utils.safestring import SafeString

# In percent of the width.
_MARGIN: Final = 3.0
# Times a power of ten. Where 10 are too few for what begins between two ticks, 20 are enough.
_STEPS: Final = (1.0, 2.0, 2.5, 5.0, 10.0, 20.0)


def round_ticks(low: float, high: float, *, n: int) -> tuple[float, ...]:
    """Return at most `n` steps, two or more, in round numbers, from below `low` to above `high`.

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


def _x(value: float, end: float, start: float) -> str:
    share = (value - start) / (end - start)
    return f"{round(_MARGIN + (100 - 2 * _MARGIN) * share, 1):g}%"


def difference(
    end: float, value: float, low: float | None, high: float | None, *, start: float | None = None
) -> SafeString:
    """Draw a dot with its interval as a line, or a ring without one, and the line at 0.

    The scale begins at `start`, by default as far below 0 as its end is above.
    """
    start = -end if start is None else start
    line, css = SafeString(""), "ring"
    if low is not None and high is not None:
        template = '<line x1="{0}" x2="{1}" y1="7" y2="7"/>' + "".join(
            f'<line x1="{{{i}}}" x2="{{{i}}}" y1="4" y2="10"/>' for i in (0, 1)
        )
        line, css = format_html(template, _x(low, end, start), _x(high, end, start)), "dot"
    return format_html(
        '<svg class="whisker" aria-hidden="true"><line class="zero" x1="{0}" x2="{0}" y1="0" y2="14"/>{1}'
        '<circle class="{2}" cx="{3}" cy="7" r="2.4"/></svg>',
        _x(0.0, end, start),
        line,
        css,
        _x(value, end, start),
    )


def axis(end: float, *, start: float | None = None) -> SafeString:
    """Draw the scale for the head of a column.

    >>> [axis(80.0, start=start).count("<text") for start in (-80.0, -0.15)]
    [3, 2]
    """
    start = -end if start is None else start
    stops = [_x(at, end, start) for at in (start, 0.0, end)]
    # 0 is what one looks for: the start has a label only where it leaves room.
    first = format_html('<text x="0" y="9">{}</text>', tick_text(start)) if start < -end / 3 else ""
    ticks = format_html_join("", '<line x1="{0}" x2="{0}" y1="11" y2="14"/>', ((at,) for at in stops))
    return format_html(
        '<svg class="axis" aria-hidden="true"><line x1="{}" x2="{}" y1="14" y2="14"/>{}'
        '{}<text x="{}" y="9" text-anchor="middle">0</text>'
        '<text x="100%" y="9" text-anchor="end">{}</text></svg>',
        stops[0],
        stops[2],
        ticks,
        first,
        stops[1],
        tick_text(end),
    )


def tick_text(value: float) -> str:
    """Format a number with a true minus.

    >>> tick_text(-2.5), tick_text(20.0)
    ('−2.5', '20')
    """
    return f"{value:g}".replace("-", "−")
