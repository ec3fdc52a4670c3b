"""Small SVG drawings: scales and whiskers, in the colour of the page around them.

Whoever cannot see them reads the same numbers as text beside or behind them; the drawings say nothing alone.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from django.utils.html import format_html, format_html_join
from django.utils.safestring import SafeString

WIDTH_PX: Final = 96.0
HEIGHT_PX: Final = 14.0
_MARGIN_PX: Final = 4.0
_STEPS: Final = (1.0, 2.0, 2.5, 5.0, 10.0)


@dataclass(frozen=True)
class Scale:
    """A straight scale with round ends: values to pixels from the left."""

    low: float
    high: float
    ticks: tuple[float, ...]
    width_px: float = WIDTH_PX
    margin_px: float = _MARGIN_PX

    def x(self, value: float) -> float:
        """Where a value stands; what lies beyond an end stands at that end.

        >>> scale = Scale(0.0, 10.0, (0.0, 5.0, 10.0), width_px=108.0, margin_px=4.0)
        >>> scale.x(5.0), scale.x(99.0)
        (54.0, 104.0)
        """
        share = (value - self.low) / (self.high - self.low)
        inner_px = self.width_px - 2 * self.margin_px
        return round(self.margin_px + inner_px * min(1.0, max(0.0, share)), 1)

    def holds(self, value: float) -> bool:
        """Whether the value lies on the scale, and not beyond an end."""
        return self.low <= value <= self.high


def round_ticks(low: float, high: float, *, n: int) -> tuple[float, ...]:
    """At most `n` steps in round numbers, from below `low` to above `high`.

    >>> round_ticks(9.3, 31.0, n=4)
    (0.0, 10.0, 20.0, 30.0, 40.0)
    >>> round_ticks(-0.4, 1.1, n=4)
    (-0.5, 0.0, 0.5, 1.0, 1.5)
    >>> round_ticks(0.6, 0.6, n=3)
    (0.6, 0.7)
    """
    span = (high - low) or abs(high) or 1.0
    power = 10.0 ** math.floor(math.log10(span / n))
    steps = (factor * power for factor in (*_STEPS, 20.0, 25.0, 50.0))
    step = next(s for s in steps if math.ceil(high / s - 1e-9) - math.floor(low / s + 1e-9) <= n)
    first = math.floor(low / step + 1e-9)
    last = max(math.ceil(high / step - 1e-9), 1 + first)
    return tuple(round(i * step, 10) + 0.0 for i in range(first, last + 1))


def zero_scale(values: Iterable[float], *, width_px: float = WIDTH_PX) -> Scale:
    """A scale for differences: as far to the left of 0 as to the right.

    >>> zero_scale([-3.2, 1.0]).ticks
    (-4.0, 0.0, 4.0)
    """
    far = max((abs(value) for value in values), default=0.0) or 1.0
    high = round_ticks(0.0, far, n=4)[-1]
    return Scale(low=-high, high=high, ticks=(-high, 0.0, high), width_px=width_px)


def whisker(scale: Scale, value: float, low: float | None, high: float | None) -> SafeString:
    """A value as a dot with its interval as a line; without an interval, as a ring.

    What lies beyond the scale ends in an arrow. Hidden from those who read by ear: the cell says it in words.
    """
    middle = HEIGHT_PX / 2
    parts: list[SafeString] = []
    if low is not None and high is not None:
        left, right = scale.x(low), scale.x(high)
        path = f"M{left:g} {middle:g}H{right:g}"
        path += "".join(
            f"M{x:g} {middle - 3:g}v6" for x, end in ((left, low), (right, high)) if scale.holds(end)
        )
        parts.append(format_html('<path d="{}"/>', path))
    if value > scale.high:
        x = scale.x(value)
        parts.append(format_html('<path d="{}"/>', f"M{x - 4:g} {middle - 3.5:g}l4 3.5l-4 3.5"))
    else:
        css = "dot" if low is not None else "ring"
        parts.append(
            format_html(
                '<circle class="{}" cx="{}" cy="{}" r="2.6"/>', css, f"{scale.x(value):g}", f"{middle:g}"
            )
        )
    return _svg(scale, "whisker", parts)


def difference(scale: Scale, value: float, low: float | None, high: float | None) -> SafeString:
    """A difference with its interval, against the line where there is none."""
    zero = format_html('<path class="zero" d="{}"/>', f"M{scale.x(0.0):g} 0v{HEIGHT_PX:g}")
    drawn = whisker(scale, value, low, high)
    return SafeString(drawn.replace(">", f">{zero}", 1))


def axis(scale: Scale) -> SafeString:
    """The scale itself, for the head of a column: its round numbers over small marks."""
    shown = (scale.ticks[0], scale.ticks[-1])
    marks = "".join(f"M{scale.x(tick):g} {HEIGHT_PX - 3:g}v3" for tick in scale.ticks)
    left, right = (tick_text(tick) for tick in shown)
    parts = [
        format_html(
            '<path d="{}"/>', f"M{scale.x(scale.low):g} {HEIGHT_PX:g}H{scale.x(scale.high):g}{marks}"
        ),
        format_html('<text x="0" y="{}">{}</text>', f"{HEIGHT_PX - 5:g}", left),
        format_html(
            '<text x="{}" y="{}" text-anchor="end">{}</text>',
            f"{scale.width_px:g}",
            f"{HEIGHT_PX - 5:g}",
            right,
        ),
    ]
    return _svg(scale, "axis", parts)


def tick_text(value: float) -> str:
    """A number at a scale, with a minus that is one.

    >>> tick_text(-2.5), tick_text(20.0)
    ('−2.5', '20')
    """
    return f"{value:g}".replace("-", "−")


def _svg(scale: Scale, css: str, parts: list[SafeString]) -> SafeString:
    return format_html(
        '<svg class="{}" viewBox="0 0 {} {}" aria-hidden="true">{}</svg>',
        css,
        f"{scale.width_px:g}",
        f"{HEIGHT_PX:g}",
        format_html_join("", "{}", ((part,) for part in parts)),
    )
